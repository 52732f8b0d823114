"""Four methods, one energy, one start: who is down first, and who lets no tet suffer?

    OMP_NUM_THREADS=1 python bench/race/run.py [--tets 20000] [--limit 60]

writes rows.json and docs/race.png.

Needs stretchmap and, for CHOLMOD, cvxopt and pymetis; without them the factorization is SuperLU's.
The solids are generated. All methods start at the same map without folds, hold its boundary and
lower the barrier energy that certified maps are made by; processor time of one thread is counted,
set-up included.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from draw import draw
from first_order import foldover_free, scipy_lbfgs
from newton import direct, direct_solver, ours
from problem import Problem, Stop, Trace, make_problem

import stretchmap as sm

HERE = Path(__file__).resolve().parent
PICTURE = HERE.parents[1] / "docs" / "race.png"

Method = Callable[[Problem, Trace], None]


def methods() -> dict[str, Method]:
    """By the names of the picture."""
    return {
        "stretchmap": ours,
        f"projected Newton, {direct_solver()[0]}": direct,
        "L-BFGS, SciPy": scipy_lbfgs,
        "L-BFGS, foldover-free": foldover_free,
    }


def race(problem: Problem, limit: float) -> dict[str, list[dict[str, float]]]:
    """Rows of every method; one that is not done at the limit is stopped there."""
    found = {}
    for name, method in methods().items():
        trace = Trace(problem, limit)
        try:
            method(problem, trace)
        except Stop:
            pass
        found[name] = trace.rows
        last = trace.rows[-1]
        print(
            f"  {name:32} {len(trace.rows) - 1:5} steps {last['seconds']:7.2f} s   energy "
            f"{last['energy']:.6f}   worst tet {last['worst']:.3g}",
            flush=True,
        )
    return found


def main(arguments: list[str] | None = None) -> int:
    """Run, write, draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tets", type=int, default=20_000)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for each method")
    parser.add_argument("--json", type=Path, default=HERE / "rows.json")
    parser.add_argument("--picture", type=Path, default=PICTURE)
    options = parser.parse_args(arguments)
    samples = {
        "bumpy torus": sm.samples.bumpy_torus(options.tets),
        "vertebra": sm.samples.vertebra_like(options.tets),
    }
    rows: dict[str, Any] = {}
    with sm.threads(1):
        for name, sample in samples.items():
            problem, begin = make_problem(sample)
            title = f"{name}, {problem.solid.n_tets:,} tets, {begin}"
            print(title)
            rows[title] = race(problem, options.limit)
    options.json.write_text(json.dumps(rows) + "\n", encoding="utf-8")
    draw(rows, options.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
