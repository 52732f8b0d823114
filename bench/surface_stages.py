"""Stages of surface maps against the number of faces.

    python bench/surface_stages.py [CASE ...] [--json docs/data/surfaces.json] [--write]
    python bench/surface_stages.py --draw docs/data/surfaces.json   # only drawn again

A case is a file of a surface, FILE:K one whose faces are divided into four K times, or a number of
faces: a bumpy torus whose vertices are moved at random along it. Every case is a process of its own
on one thread. The growth is the exponent p of seconds ~ faces^p from the first case to the last
of its kind.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from speed_page import parser_of, run_worker, save, show

if TYPE_CHECKING:
    import stretchmap as sm

STAGES = ("homology", "conformal", "area")
CASES = ("25000", "100000", "250000")


def generated(n_faces: int) -> sm.TriMesh:
    """A torus with bumps, its grid shaken so that no two vertices have the same surroundings."""
    import numpy as np

    import stretchmap as sm

    tube = round(math.sqrt(n_faces / 4.0))
    torus = sm.samples.torus_surface(2 * tube, tube, R=2.0)
    u = np.arctan2(torus.V[:, 1], torus.V[:, 0])
    v = np.arctan2(torus.V[:, 2], np.hypot(torus.V[:, 0], torus.V[:, 1]) - 2.0)
    random = np.random.default_rng(1)
    u, v = (x + k / tube * random.uniform(-1, 1, len(x)) for x, k in ((u, 0.7), (v, 1.4)))
    radius = 1.0 + 0.25 * np.sin(3.0 * u + 2.0 * v) + 0.1 * np.cos(7.0 * u - 3.0 * v)
    axis = 2.0 + radius * np.cos(v)
    points = np.column_stack([axis * np.cos(u), axis * np.sin(u), radius * np.sin(v)])
    return sm.TriMesh(points, torus.F)


def divided(surface: sm.TriMesh) -> sm.TriMesh:
    """Every face cut into four at the middles of its edges."""
    import numpy as np

    import stretchmap as sm

    middle = len(surface.V) + surface.topology.edge.reshape(-1, 3)
    a, b, c = middle.T
    i, j, k = surface.F.T
    parts = [(i, a, c), (a, j, b), (c, b, k), (a, b, c)]
    faces = np.concatenate([np.column_stack(part) for part in parts])
    return sm.TriMesh(np.concatenate([surface.V, surface.V[surface.edges].mean(axis=1)]), faces)


def surface_of(case: str) -> sm.TriMesh:
    """The surface of a case."""
    import stretchmap as sm

    if case.isdigit():
        return generated(int(case))
    file, _, times = case.partition(":")
    surface = sm.read_surface(file)
    for _ in range(int(times or 0)):
        surface = divided(surface)
    return surface


def worker(case: str) -> dict[str, Any]:
    """All stages of one case in this process."""
    import resource
    import time

    import stretchmap as sm

    # Modules imported on first use are none of the surface's business.
    sm.area_map(sm.samples.torus_surface(24, 12))
    surface = surface_of(case)
    seconds: dict[str, float] = {}
    clock = time.process_time()

    def lap(stage: str) -> None:
        nonlocal clock
        seconds[stage] = time.process_time() - clock
        clock = time.process_time()

    basis = sm.homology_basis(surface)
    lap("homology")
    conformal = sm.conformal_map(surface, basis=basis)
    lap("conformal")
    result = sm.area_map(surface, conformal=conformal, keep_best=True)
    lap("area")
    return {
        "case": case if case.isdigit() else Path(case).name,
        "faces": surface.n_faces,
        "seconds": seconds,
        "peak_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "face_std": result.distortion.element_std,
        "ring_std": result.distortion.ring_std,
        "converged": result.converged,
        "certified": result.certificate.certified,
    }


def kind(row: dict[str, Any]) -> str:
    """What cases have in common whose times are compared."""
    return "torus" if row["case"].isdigit() else row["case"].split(":")[0]


def growth(rows: list[dict[str, Any]], stage: str) -> float:
    """The exponent between the smallest and the largest case."""
    first, last = rows[0], rows[-1]
    return math.log(last["seconds"][stage] / first["seconds"][stage]) / math.log(
        last["faces"] / first["faces"]
    )


def table(rows: list[dict[str, Any]]) -> str:
    """A line per case, and one per kind with the exponents."""
    lines = [
        "| surface | faces | homology s | conformal s | area s | area µs a face | face SD "
        "| ring SD | bytes a face | certified |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    kinds: dict[str, list[dict[str, Any]]] = {}
    for row in sorted(rows, key=lambda row: (kind(row), row["faces"])):
        kinds.setdefault(kind(row), []).append(row)
    for name, group in kinds.items():
        for row in group:
            times = " | ".join(f"{row['seconds'][stage]:.2f}" for stage in STAGES)
            lines.append(
                f"| {name} | {row['faces']:,} | {times} "
                f"| {1e6 * row['seconds']['area'] / row['faces']:.0f} "
                f"| {row['face_std']:.4f} | {row['ring_std']:.0e} "
                f"| {row['peak_bytes'] / row['faces']:,.0f} "
                f"| {'yes' if row['certified'] else 'no'} |"
            )
        if len(group) > 1:
            powers = " | ".join(f"{growth(group, stage):.2f}" for stage in STAGES)
            lines.append(f"| {name} | growth | {powers} | | | | | |")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure or draw."""
    parser = parser_of(__doc__)
    parser.add_argument("cases", nargs="*", default=CASES)
    options = parser.parse_args(arguments)
    if options.worker:
        print(json.dumps(worker(options.worker)))
        return 0
    rows: list[dict[str, Any]] = json.loads(options.draw.read_text()) if options.draw else []
    for case in () if options.draw else options.cases:
        rows.append(run_worker(__file__, [case], threads=1))
        print(rows[-1], flush=True)
        save(options.json, rows)
    show(options, "surfaces", table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
