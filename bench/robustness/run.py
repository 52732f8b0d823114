"""Map random genus-one solids, and solids from files, and say what became of them.

    python bench/robustness/run.py                              # the odd seeds of all families
    python bench/robustness/run.py --seeds tune --families knots spiky --size 0.5
    python bench/robustness/run.py --surfaces                   # area maps of their boundaries
    python bench/robustness/run.py --files ../shared/hard ../shared/meshes/tets
    python bench/robustness/run.py --write                      # and put the tables into the docs

Each case gets a record OUT/KIND/GROUP_NAME.json beside its map and runs in a process of its own,
told its limit and killed at it, 1 ms of processor time per tet, or 20 ms per face (`--limit`). A
second run goes on where the first stopped; `--again` starts anew.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

import cases
import pool
import report
from families import families

ROOT = Path(__file__).resolve().parents[2]


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--families", nargs="*", default=[], choices=families(), metavar="NAME")
    parser.add_argument("--seeds", default="report", help="tune, report, all, a:b or a,b,c")
    parser.add_argument("--size", type=float, default=1.0, help="factor of the number of tets")
    parser.add_argument("--files", type=Path, nargs="*", help="meshes or folders of them instead")
    parser.add_argument("--surfaces", action="store_true", help="area maps of the boundaries")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--threads", type=int, help="threads of each; default: all cores, shared")
    parser.add_argument(
        "--limit", type=float, help="processor ms per tet, 1 if left out, or per face, 20"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "robustness")
    parser.add_argument("--again", action="store_true", help="run also what has a record")
    parser.add_argument("--no-maps", action="store_true", help="keep the records only")
    parser.add_argument("--write", metavar="SECTION", nargs="?", const="", help="update the docs")
    return parser.parse_args(arguments)


def job_of(case: cases.Case, options: argparse.Namespace, kind: str) -> dict[str, Any]:
    """What `task` has to know."""
    stem = f"{case.group}_{case.name}" + ("" if case.size == 1.0 else f"_{case.size:g}")
    base = options.out / kind / stem
    return {
        "kind": kind,
        "group": case.group,
        "name": case.name,
        "seed": case.seed,
        "size": case.size,
        "mesh": str(case.path),
        "record": f"{base}.json",
        "map": None if options.no_maps else f"{base}_map.npz",
        "per_element": 1e-3 * (options.limit or (20.0 if kind == "area" else 1.0)),
    }


def main(arguments: list[str] | None = None) -> int:
    """Run, print the tables, and return 1 if a map is not certified."""
    options = parse(arguments)
    options.out = options.out.resolve()
    kind = "area" if options.surfaces else "volume"
    if options.files is None:
        chosen = cases.drawn(
            options.families, cases.seeds_of(options.seeds), options.size, options.out
        )
    else:
        chosen = cases.from_files(options.files)
    threads = options.threads or max((os.cpu_count() or 1) // options.jobs, 1)
    records = pool.run_all(
        chosen,
        [job_of(case, options, kind) for case in chosen],
        processes=options.jobs,
        threads=threads,
        again=options.again,
    )
    section = options.write
    if section == "":
        section = f"{kind} {'files' if options.files else options.seeds}"
    return report.finish(records, section)


if __name__ == "__main__":
    sys.exit(main())
