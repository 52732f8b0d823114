"""Two builds side by side: processor time, time by the clock, memory and quality of maps.

    python bench/speed.py --before FOLDER [--after FOLDER] [--json docs/data/speed.json] [--write]
    python bench/speed.py --draw docs/data/speed.json        # the table again, nothing measured

Volume maps of ``--cases``: meshes by name, or tori of so many tets, or, as ``bumpy:N``, bumpy ones;
area maps of ``--surfaces``: shaken tori of so many faces. Rows of a file that is there are kept, in
their places, unless they are measured again.

FOLDER holds the built package ``stretchmap``: the ``python`` folder of a checkout built in place,
or ``site-packages``. Every run is a process of its own, and the two builds take turns, so that both
see the same neighbors. Of repeated runs the one with the least processor time counts. Wall time
means something on an idle machine only; processor time, that of all threads, nearly everywhere.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from pathlib import Path
from typing import Any

from speed_page import (
    HERE,
    METHODS,
    PACKAGE,
    parser_of,
    run_worker,
    sample_of,
    save,
    show,
    solid_of,
)

KEYS = ("case", "method", "threads", "build")  # of a row
SURFACE = "area"  # the method of surfaces
MESHES = ("petal_ring_synth_14506", "vertebra_L3_ssm_16420", "rocker_arm_25182", "kitten_21584")


def peak() -> int:
    """Most bytes this process has had so far."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def surface_worker(n_faces: int) -> dict[str, Any]:
    """Basis, conformal and area map of a shaken torus in this process."""
    import time

    import stretchmap as sm
    from surface_stages import generated

    sm.area_map(sm.samples.torus_surface(24, 12))
    surface = generated(n_faces)
    base, cpu, wall = peak(), time.process_time(), time.perf_counter()
    result = sm.area_map(surface)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    grown = peak() - base
    image = sm.TriMesh(result.image, result.mesh.F)
    ratios = image.face_areas / image.area / (surface.face_areas / surface.area)
    return {
        "elements": surface.n_faces,
        "processor_seconds": cpu,
        "wall_seconds": wall,
        "bytes_per_element": grown / surface.n_faces,
        "ratio_std": float(ratios.std()),
        "certified": bool(sm.certify(result.mesh, result.image, result.torus).certified),
        "steps": len(result.history),
    }


def worker(job: dict[str, Any]) -> dict[str, Any]:
    """One map in this process, by whatever ``stretchmap`` is on the path."""
    import time

    import numpy as np

    import stretchmap as sm

    # Modules imported on first use are none of the mesh's business.
    sm.volume_map(sm.samples.solid_torus(500), **job["arguments"])
    solid = solid_of(job["mesh"])
    base, cpu, wall = peak(), time.process_time(), time.perf_counter()
    result = sm.volume_map(solid, **job["arguments"])
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    tets = result.mesh.T
    source, image = (
        np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]])
        for points in (result.mesh.V, result.image)
    )
    ratios = (image / image.sum()) / (source / source.sum())
    return {
        "elements": solid.n_tets,
        "processor_seconds": cpu,
        "wall_seconds": wall,
        "bytes_per_element": (peak() - base) / solid.n_tets,
        "ratio_std": float(ratios.std()),
        "flips": int(np.count_nonzero(ratios <= 0.0)),
        "certified": bool(result.certificate.certified),
        "steps": len(result.history),
    }


def jobs_of(options: argparse.Namespace) -> list[tuple[str, str, dict[str, Any]]]:
    """Case, method and what the worker is told."""
    jobs: list[tuple[str, str, dict[str, Any]]] = []
    for case in options.cases:
        file = options.meshes / f"{case}.npz"
        mesh = str(file) if file.exists() else case
        jobs += [
            (case, method, {"mesh": mesh, "arguments": METHODS[method]})
            for method in options.methods
        ]
    return jobs + [(case, SURFACE, {"surface": int(case)}) for case in options.surfaces]


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Rows of all cases, methods and numbers of threads; each build's best of the repeats."""
    builds = {"before": options.before, "after": options.after}
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    if options.json and options.json.exists():
        known = json.loads(options.json.read_text())["rows"]
        rows = {tuple(row[key] for key in KEYS): row for row in known}
    machine = {"processor": platform.machine(), "cores": os.cpu_count()}
    data = {"machine": machine, "labels": options.labels, "rows": list(rows.values())}
    for case, method, job in jobs_of(options):
        for threads in options.threads:
            best: dict[str, dict[str, Any]] = {}
            for _ in range(options.repeat):
                for name, package in builds.items():
                    row = run_worker(__file__, [json.dumps(job)], threads, package)
                    least = best.setdefault(name, row)
                    if row["processor_seconds"] < least["processor_seconds"]:
                        best[name] = row
            for name, row in best.items():
                key = (case, method, threads, name)
                rows[key] = {**dict(zip(KEYS, key, strict=True)), **row}
                print(rows[key], flush=True)
            data["rows"] = list(rows.values())
            save(options.json, data)
    return data


def table(data: dict[str, Any]) -> str:
    """Of all rows, the two builds side by side."""
    found: dict[tuple[str, str, int], dict[str, dict[str, Any]]] = {}
    for row in data["rows"]:
        found.setdefault((row["case"], row["method"], row["threads"]), {})[row["build"]] = row
    before, after = data["labels"]
    lines = [
        f"Before: {before}; after: {after}. Microseconds of processor time and bytes per tet, "
        "or per face of a surface.",
        "",
        "| mesh | tets or faces | method | threads | µs before | µs after | ratio "
        "| wall s before | after | bytes before | after | SD of ratios before | after "
        "| certified |",
        "|---|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for (case, method, threads), pair in found.items():
        if len(pair) < 2:
            continue
        old, new = pair["before"], pair["after"]
        micro = [1e6 * row["processor_seconds"] / row["elements"] for row in (old, new)]
        kind, n_tets = sample_of(case)
        name = f"{kind} {n_tets:,}" if n_tets else case
        lines.append(
            f"| {name} | {new['elements']:,} | {method} | {threads} "
            f"| {micro[0]:.1f} | {micro[1]:.1f} | {micro[1] / micro[0]:.2f} "
            f"| {old['wall_seconds']:.1f} | {new['wall_seconds']:.1f} "
            f"| {old['bytes_per_element']:.0f} | {new['bytes_per_element']:.0f} "
            f"| {old['ratio_std']:.4f} | {new['ratio_std']:.4f} "
            f"| {'yes' if new['certified'] else 'no'} |"
        )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure or draw."""
    parser = parser_of(__doc__)
    parser.add_argument("--before", type=Path, help="folder of the package to compare with")
    parser.add_argument("--after", type=Path, default=PACKAGE)
    parser.add_argument("--labels", nargs=2, default=("0.1.0", "this version"))
    parser.add_argument("--cases", nargs="*", default=[*MESHES, "100000", "350000", "bumpy:350000"])
    parser.add_argument("--surfaces", nargs="*", default=["25000", "100000"])
    parser.add_argument("--methods", nargs="+", default=["certified", "vsem"])
    parser.add_argument("--threads", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument(
        "--meshes", type=Path,
        default=Path(os.environ.get("STRETCHMAP_MESHES", HERE.parent.parent / "shared" / "meshes"))
        / "tets",
    )  # fmt: skip
    options = parser.parse_args(arguments)
    if options.worker:
        job = json.loads(options.worker)
        print(json.dumps(surface_worker(job["surface"]) if "surface" in job else worker(job)))
        return 0
    if options.draw is None and options.before is None:
        parser.error("--before or --draw is needed")
    data = json.loads(options.draw.read_text()) if options.draw else measure(options)
    show(options, "speed", table(data))
    return 0


if __name__ == "__main__":
    sys.exit(main())
