"""One case in a process of its own: load the mesh, set the limit, map it, write the record.

    python task.py '{"kind": "volume", "mesh": "a.npz", "record": "a.json", ...}'

Called by `pool`; a process that is killed leaves no record, and `pool` writes one that says so.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import figures
import numpy as np

import stretchmap as sm
from stretchmap.errors import StretchmapError

_LEAST_SECONDS = 5.0  # allowed to a tiny mesh


def write_json(path: Path, record: dict[str, Any]) -> None:
    """Write a record in one piece or not at all; what is not finite becomes null."""
    plain = {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in record.items()
    }
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(json.dumps(plain, indent=1, allow_nan=False) + "\n")
    os.replace(temporary, path)


def limit_processor_time(seconds: float) -> None:
    """End this process once it has used that much more processor time (whole seconds)."""
    used = time.process_time()
    resource.setrlimit(
        resource.RLIMIT_CPU, (math.ceil(used + seconds), math.ceil(used + seconds) + 5)
    )


def peak_mib() -> float:
    """Largest resident size of this process; Linux counts what it was forked from in getrusage."""
    status = Path("/proc/self/status")
    if status.exists():
        words = status.read_text().partition("VmHWM:")[2].split()
        return float(words[0]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def load(path: str) -> sm.TetMesh | sm.TriMesh:
    """A mesh; tets of an ``.npz`` are oriented, as some benchmarks leave that open."""
    if path.endswith(".npz"):
        with np.load(path) as data:
            return sm.TetMesh(data["V"], data["T"], orient=True)
    return sm.read(path)


def map_volume(mesh: sm.TetMesh, job: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """The default volume map within the limit, the best one kept where it is not certified."""
    options = sm.VolumeOptions(time_limit=job["per_element"])
    result = sm.volume_map(mesh, options=options, keep_best=True)
    return result, figures.of_solid_map(mesh, result)


def map_area(mesh: sm.TetMesh | sm.TriMesh, job: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """The default area map of a surface, or of the boundary of a solid, within the limit."""
    surface = mesh.surface if isinstance(mesh, sm.TetMesh) else mesh
    result = sm.area_map(surface, time_limit=job["per_element"], keep_best=True)
    proof = sm.certify(result.mesh, result.image, result.torus)
    added = 0 if result.refinement is None else result.refinement.n_added_faces
    return result, figures.of_ratios(result.distortion.ratios) | {
        "added_percent": 100.0 * added / surface.n_faces,
        "certified": proof.certified,
        "converged": bool(result.converged),
        "reason": "" if proof.certified else proof.reason,
        "stop_reason": result.stop_reason,
        "flips": len(proof.ids.get("boundary_oriented", ())),
        "reported_flips": int(result.distortion.flips or 0),
        "steps": len(result.history),
        "stages": {name: round(value, 3) for name, value in result.seconds.items()},
    }


KINDS: dict[str, Callable[..., tuple[Any, dict[str, Any]]]] = {
    "volume": map_volume,
    "area": map_area,
}


def run(job: dict[str, Any], kinds: dict[str, Callable[..., Any]] = KINDS) -> dict[str, Any]:
    """Map the mesh of a job and return its record.

    Parameters
    ----------
    job : dict
        ``kind``, ``mesh``, ``map``, ``record`` (paths), ``per_element`` (seconds of processor time
        allowed per element) and what the kind asks for.
    """
    mesh = load(job["mesh"])
    solid = isinstance(mesh, sm.TetMesh)
    n = (
        mesh.n_tets
        if solid and job["kind"] != "area"
        else (mesh.surface if solid else mesh).n_faces
    )
    elements = mesh.T if solid else mesh.F
    digest = hashlib.sha256(np.ascontiguousarray(mesh.V).tobytes() + elements.tobytes())
    record = {
        **{key: job[key] for key in ("kind", "group", "name", "seed", "size")},
        "elements": n,
        "vertices": mesh.n_vertices,
        "mesh_sha256": digest.hexdigest()[:16],
        "version": sm.__version__,
        "certified": False,
        "converged": False,
    }
    allowed = max(job["per_element"] * n, _LEAST_SECONDS)
    record["allowed_seconds"] = allowed
    for name in ("volume_map", "area_map", "fill"):
        getattr(sm, name)  # loaded on first use, which is no map's doing
    limit_processor_time(allowed)
    clock, used = time.perf_counter(), time.process_time()
    result = None
    try:
        result, found = kinds[job["kind"]](mesh, job)
        record |= found
    except StretchmapError as error:
        record["reason"] = f"{type(error).__name__}: {error}"
    record["cpu_seconds"] = time.process_time() - used
    record["seconds"] = time.perf_counter() - clock
    record["microseconds_per_element"] = 1e6 * record["cpu_seconds"] / n
    record["peak_mib"] = peak_mib()
    if result is not None and job.get("map"):
        result.save(job["map"])
    return record


def main() -> int:
    """Run the job of the command line."""
    job = json.loads(sys.argv[1])
    write_json(Path(job["record"]), run(job))
    return 0


if __name__ == "__main__":
    sys.exit(main())
