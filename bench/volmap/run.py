"""The public benchmark of volume maps to simple domains: 50 maps with the boundary prescribed.

    python bench/volmap/run.py ../shared/volmap                     # all
    python bench/volmap/run.py ../shared/volmap --only bone/star pig/cube
    python bench/volmap/run.py ../shared/volmap --write             # and the table into the docs

Cherchi & Livesu, VOLMAP: a large scale benchmark for volume mappings to simple base domains,
Computer Graphics Forum 42(5), 2023. The folder holds NAME.npz with `V`, `T`, `ids` and the images
`cube`, `tet`, `pyr`, `octa`, `star` of the boundary vertices.

A map counts when it is proven to be a bijection by exact tests made anew, its boundary is bit for
bit the one prescribed, every input vertex is in its row, and it took at most 60 s of processor
time, all threads together: what other programs do meanwhile is no part of it.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "robustness"))
import pool
import report
from cases import Case

HERE = Path(__file__).resolve().parent
DOMAINS = ("cube", "tet", "pyr", "octa", "star")
_SECONDS = 60.0
COLUMNS = {
    "certified": "certified",
    "boundary exact": "boundary_exact",
    "rows kept": "rows_kept",
    f"within {_SECONDS:.0f} s": "in_time",
}


def cases_of(folder: Path, only: list[str]) -> list[Case]:
    """All pairs of mesh and domain, or those named NAME, NAME/DOMAIN or /DOMAIN.

    Raises
    ------
    SystemExit
        If nothing in the folder has such a name.
    """
    found = []
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as data:
            pairs = [f"{path.stem}/{domain}" for domain in DOMAINS if domain in data.files]
        found += [
            Case("volmap", pair, path.resolve())
            for pair in pairs
            if not only or any(pair == o or pair.split("/")[0] == o or pair.endswith(o)
                               for o in only)
        ]  # fmt: skip
    if not found:
        raise SystemExit(f"no such pairs in {folder}")
    return found


def job_of(case: Case, out: Path) -> dict[str, Any]:
    """What the task has to know."""
    stem = str(out / case.name.replace("/", "_"))
    return {
        "kind": "fill", "group": case.group, "name": case.name, "seed": None, "size": 1.0,
        "mesh": str(case.path), "record": f"{stem}.json", "map": f"{stem}_map.npz",
        "per_element": 1e-3,
    }  # fmt: skip


def misses(record: dict[str, Any]) -> list[str]:
    """What a map misses to count; notes ``in_time`` in its record."""
    record["in_time"] = record.get("cpu_seconds", np.inf) <= _SECONDS
    return [f"not {name}" for name, key in COLUMNS.items() if not record.get(key)]


def table(records: list[dict[str, Any]]) -> str:
    """A row per domain, and one for all."""
    head = ["", "maps", *COLUMNS, "added tets, %", "mean abs(ratio − 1)", "smallest ratio"]
    head += ["quasi-isometry", "processor seconds, median / largest", "µs per tet"]
    groups = {d: [r for r in records if r["name"].endswith(f"/{d}")] for d in DOMAINS}
    rows = []
    for name, members in (*groups.items(), ("all", records)):
        if not members:
            continue
        rows.append(
            [name, str(len(members))]
            + [str(sum(bool(r.get(key)) for r in members)) for key in COLUMNS.values()]
            + [
                report.pair("added_percent", 1.0, ".2g")(members),
                report.pair("mean", 1.0)(members),
                report.pair("ratio_min", 0.0)(members),
                report.pair("quasi_isometry", 1.0)(members),
                report.pair("cpu_seconds", 1.0, ".1f")(members),
                report.pair("microseconds_per_element", 1.0, ".0f")(members),
            ]
        )
    return report.markdown(head, rows)


def main(arguments: list[str] | None = None) -> int:
    """Run, print the table, and return 1 if a map does not count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[], help="NAME, NAME/DOMAIN or /DOMAIN")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=HERE.parents[1] / "build" / "volmap")
    parser.add_argument("--again", action="store_true", help="run also what has a record")
    parser.add_argument("--write", action="store_true", help="update the documentation")
    options = parser.parse_args(arguments)
    cases = cases_of(options.folder, options.only)
    records = pool.run_all(
        cases,
        [job_of(case, options.out.resolve()) for case in cases],
        processes=options.jobs,
        threads=options.threads,
        script=HERE / "fill_task.py",
        again=options.again,
    )
    short = [{**r, "reason": r.get("reason") or ", ".join(misses(r))} for r in records if misses(r)]
    good = len(records) - len(short)
    text = f"{table(records)}\n{good} of {len(records)} count. The others:\n\n"
    text += report.reasons(short)
    print(text)
    if options.write:
        report.put(HERE.parents[1] / "docs" / "robustness.md", "volmap", text)
    return int(good < len(records))


if __name__ == "__main__":
    sys.exit(main())
