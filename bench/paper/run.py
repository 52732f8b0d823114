"""Regenerate the paper's tables side by side with its own columns, and the table of certified maps.

    python bench/paper/run.py                       # all tables, four meshes like the paper's
    python bench/paper/run.py --tables 6.3 6.4
    python bench/paper/run.py --all-solids          # the default map of every solid in the folder

Meshes come from the folder STRETCHMAP_MESHES (default ../shared/meshes beside the checkout);
without it generated solids stand in, and the paper's columns stay empty.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import published
import tables

import stretchmap as sm
from stretchmap import samples
from stretchmap.mesh.meshes import TetMesh

DEFAULT = Path(__file__).resolve().parents[3] / "shared" / "meshes"


def load(names: Iterable[str]) -> dict[str, TetMesh]:
    """The named solids, or generated ones when there is no mesh folder."""
    folder = Path(os.environ.get("STRETCHMAP_MESHES", DEFAULT)) / "tets"
    if not folder.is_dir():
        print(f"no folder {folder}: generated solids instead", file=sys.stderr)
        return {
            "vertebra_like": samples.vertebra_like(20_000),
            "vertebra_like_1": samples.vertebra_like(15_000, seed=1),
            "bumpy_torus": samples.bumpy_torus(20_000),
        }
    paths = {name: folder / f"{name}.npz" for name in names} or {
        path.stem: path for path in sorted(folder.glob("*.npz"))
    }
    meshes = {}
    for name, path in paths.items():
        mesh = sm.read(path)
        assert isinstance(mesh, TetMesh), f"{path} is not a solid"
        meshes[name] = mesh
    return meshes


def markdown(title: str, rows: list[tuple[Any, ...]]) -> str:
    """A table with its heading."""
    head, *body = [[str(cell) for cell in row] for row in rows]
    lines = [f"## {title}", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in body]) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Print the tables; exit code 1 if a certified map was asked for and one is not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--meshes", nargs="*", default=list(published.MESHES))
    parser.add_argument("--tables", nargs="*", default=list(tables.TABLES), choices=tables.TABLES)
    parser.add_argument("--all-solids", action="store_true")
    parser.add_argument("--out", type=Path, help="markdown file to write as well")
    parser.add_argument("--json", type=Path, help="the same as JSON")
    options = parser.parse_args(arguments)
    logging.getLogger("stretchmap").setLevel(logging.ERROR)  # the tables say what the log would

    wanted = {"all": ("All solids", tables.all_solids)} if options.all_solids else {
        key: tables.TABLES[key] for key in options.tables
    }  # fmt: skip
    meshes = load([] if options.all_solids else options.meshes)
    texts, data, failed = [], {}, False
    for key, (title, build) in wanted.items():
        given = load(published.VERTEBRAE) if key == "registration" else meshes
        rows = list(build(given))
        texts.append(markdown(title, rows))
        print(texts[-1], flush=True)
        data[key] = [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]
        if key in ("all", "certified"):
            failed |= any(
                row["certified"] == "no" and "vsem" not in row.get("method", "")
                for row in data[key]
            )
    if options.out:
        head = "# Results\n\nWritten by `bench/paper/run.py`; seconds are of one busy machine.\n\n"
        options.out.write_text(head + "\n".join(texts))
    if options.json:
        options.json.write_text(json.dumps(data, indent=1, default=str) + "\n")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
