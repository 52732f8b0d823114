"""All ordered pairs of nine vertebrae, with and without landmarks.

    python bench/robustness/registrations.py ../shared/meshes/surfaces
    python bench/robustness/registrations.py ../shared/meshes/surfaces --only L1_vhm --write

The surfaces are filled with tets first. Landmarks are found by rule from the registration without
(`stretchmap.registration.suggest`). Records, limits and resumption as in `run`.
"""

from __future__ import annotations

import argparse
import os
import sys
from itertools import permutations
from pathlib import Path
from typing import Any

import cases
import numpy as np
import pool
import report
from surfaces import fill

import stretchmap as sm

ROOT = Path(__file__).resolve().parents[2]
NAMES = (
    *(f"vertebra_L{k}_vhm" for k in range(1, 5)),
    *(f"vertebra_L{k}_ssm_16420" for k in range(2, 6)),
    "vertebra_tdem",
)
LANDMARKS = 30


def solids(folder: Path, out: Path) -> dict[str, Path]:
    """Files of the filled surfaces by short name; filled where they are not there."""
    files = {}
    for name in NAMES:
        files[name.removeprefix("vertebra_")] = file = out / "meshes" / f"{name}.npz"
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            solid = fill(sm.read(folder / f"{name}.ply"))
            np.savez(file, V=solid.V, T=solid.T)
    return files


def job_of(
    files: dict[str, Path], pair: tuple[str, str], marked: bool, options: argparse.Namespace
) -> dict[str, Any]:
    """What `register_task` has to know."""
    source, target = pair
    base = options.out / "register"
    plain = base / f"{source}-{target}"
    stem = base / f"{source}-{target}-landmarks" if marked else plain
    return {
        "kind": "register",
        "group": "landmarks" if marked else "no landmarks",
        "name": f"{source} to {target}",
        "seed": None,
        "size": 1.0,
        "mesh": str(files[source]),
        "target": str(files[target]),
        "landmarks": LANDMARKS,
        "guide": f"{plain}_map.npz" if marked else "",
        "record": f"{stem}.json",
        "map": f"{stem}_map.npz",
        "per_element": 1e-3 * options.limit,
    }


def main(arguments: list[str] | None = None) -> int:
    """Run, print the table, and return 1 if a registration is not certified."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of the vertebra surfaces")
    parser.add_argument("--only", default="", help="pairs whose name contains this")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--limit", type=float, default=1.0, help="processor ms per element")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "robustness")
    parser.add_argument("--again", action="store_true", help="run also what has a record")
    parser.add_argument("--write", action="store_true", help="update the documentation")
    options = parser.parse_args(arguments)
    options.out = options.out.resolve()
    files = solids(options.folder, options.out)
    pairs = [p for p in permutations(files, 2) if options.only in f"{p[0]} to {p[1]}"]
    records = []
    # Those without landmarks first: the rule that places landmarks needs them.
    for marked in (False, True):
        jobs = [job_of(files, pair, marked, options) for pair in pairs]
        records += pool.run_all(
            [cases.Case(job["group"], job["name"], Path(job["mesh"])) for job in jobs],
            jobs,
            processes=options.jobs,
            threads=options.threads,
            script=Path(__file__).with_name("register_task.py"),
            again=options.again,
        )
    return report.finish(records, "registrations" if options.write else None)


if __name__ == "__main__":
    sys.exit(main())
