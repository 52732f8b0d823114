"""Raw surfaces as a scanner's software makes them, to certified maps by three commands.

Run: python bench/raw/run.py -o FOLDER [--unseen] [--faces N] [--cases NAME ...]

Voxel solids with one hole and surplus handles, noise correlated over three voxels, marching cubes;
then holes are torn, islands added, all faces turned inside out and corners stored one by one. Each
goes through ``stretchmap prepare``, ``volume`` and ``report``. Seeds below 100 are those the
preparation was developed with, ``--unseen`` takes others. One line of JSON per case is added to
FOLDER/results.jsonl, a table is printed at the end.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "python"))

import ct_like
import stretchmap as sm

DAMAGE = ct_like.Damage(holes=6, islands=8, inside_out=True, exploded=True)
# Voxels along an edge: about 10, 35, 90, 200 and 500 thousand faces.
SIZES = (50, 96, 160, 236, 372)
GENERA = (2, 3, 4, 5, 2)
LIMIT = 1800  # seconds for one command


def cases(first: int) -> list[dict[str, Any]]:
    """Two shapes at every size, each with a seed of its own."""
    found = []
    for k, (n, genus) in enumerate(zip(SIZES, GENERA, strict=True)):
        for j, shape in enumerate(("tube", "vertebra")):
            seed = first + 2 * k + j
            name = f"{shape}-{n}-g{genus}-s{seed}"
            found.append({"name": name, "shape": shape, "n": n, "genus": genus, "seed": seed})
    return found


def one(case: dict[str, Any], folder: Path, faces: int) -> dict[str, Any]:
    """All three commands on a case; stops at the first that fails."""
    voxels = ct_like.mask(case["seed"], case["shape"], case["genus"], case["n"])
    clean = sm.TriMesh(*ct_like.surface(voxels))
    V, F = ct_like.damaged(clean.V, clean.F, DAMAGE, case["seed"])
    raw, solid, mapped = (folder / f"{case['name']}{end}" for end in (".ply", ".npz", "-map.npz"))
    sm.write(raw, sm.TriMesh(V, F))
    row = case | {"raw_faces": len(F), "raw_genus": clean.genus, "pieces": clean.n_components}
    figures = {step: folder / f"{case['name']}-{step}.json" for step in ("prepare", "volume")}
    commands = {
        "prepare": [raw, "-o", solid, "--faces", str(faces), "--json", figures["prepare"]],
        "volume": [solid, "-o", mapped, "--json", figures["volume"]],
        "report": [mapped, "-o", folder / f"{case['name']}.html"],
    }
    for step, arguments in commands.items():
        start = time.perf_counter()
        row["failed"] = _command([step, *map(str, arguments)])
        row[f"{step}_seconds"] = round(time.perf_counter() - start, 1)
        if row["failed"]:
            return row
    done, found = (json.loads(path.read_text()) for path in figures.values())
    row |= {"cuts": len(done["cuts"]), "faces": done["n_faces"], "tets": done["n_tets"]}
    row |= {"steps": {step["name"]: round(step["seconds"], 1) for step in done["steps"]}}
    row |= {"certified": found["certified"], "error": found["element_error_mean"]}
    row["memory_mb"] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
    return row


def _command(arguments: list[str]) -> str:
    """What a command says where it fails; empty where not."""
    try:
        run = subprocess.run(
            [sys.executable, "-m", "stretchmap", *arguments],
            capture_output=True, text=True, timeout=LIMIT, env=os.environ, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"{arguments[0]}: not done in {LIMIT} s"
    return "" if run.returncode == 0 else f"{arguments[0]}: {run.stderr.strip()[-300:]}"


def table(rows: list[dict[str, Any]]) -> str:
    """One line per case."""
    lines = ["| case | raw faces | genus | cuts | tets | prepare s | volume s | certified | mean |"]
    lines.append("|" + 9 * "---|")
    for row in rows:
        if row["failed"]:
            lines.append(
                f"| {row['name']} | {row['raw_faces']} | {row['raw_genus']} | {row['failed']} |"
            )
            continue
        lines.append(
            f"| {row['name']} | {row['raw_faces']} | {row['raw_genus']} | {row['cuts']} "
            f"| {row['tets']} | {row['prepare_seconds']} | {row['volume_seconds']} "
            f"| {'yes' if row['certified'] else 'no'} | {row['error']:.4f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--unseen", action="store_true", help="seeds nothing was developed with")
    parser.add_argument("--faces", type=int, default=8000)
    parser.add_argument("--cases", nargs="*", default=[], help="parts of names; all if left out")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    rows = []
    for case in cases(100 if options.unseen else 0):
        if options.cases and not any(part in case["name"] for part in options.cases):
            continue
        rows.append(one(case, options.output, options.faces))
        print(json.dumps(rows[-1]), flush=True)
        with (options.output / "results.jsonl").open("a") as file:
            file.write(json.dumps(rows[-1]) + "\n")
    print(table(rows))


if __name__ == "__main__":
    main()
