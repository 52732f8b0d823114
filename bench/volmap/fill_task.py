"""One map with a prescribed boundary in a process of its own; called by `run`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

import stretchmap as sm

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "robustness"))
import figures
import task


def prescribed(path: str, domain: str, solid: sm.TetMesh) -> np.ndarray:
    """The image of the boundary vertices in a file of the set, in the order the solid has them."""
    with np.load(path) as data:
        order = np.argsort(data["ids"])
        ids = data["ids"][order]
        if not np.array_equal(ids, solid.boundary_vertices):
            raise ValueError(f"{path}: ids are not the boundary vertices")
        return np.ascontiguousarray(data[domain][order])


def map_fill(solid: sm.TetMesh, job: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Fill the boundary image; the proof is made anew, without what the map says of itself."""
    boundary = prescribed(job["mesh"], job["name"].split("/")[1], solid)
    result = sm.fill(solid, boundary, keep_best=True)
    n = solid.n_vertices
    proof = sm.certify(result.mesh, result.image)
    found = figures.of_solid_map(solid, result)
    return result, found | {
        "certified": proof.certified,
        "reason": "" if proof.certified else proof.reason,
        "boundary_exact": np.array_equal(result.image[:n][solid.boundary_vertices], boundary),
        "boundary_split": result.mesh.surface.n_faces != solid.surface.n_faces,
    }


if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    task.write_json(Path(job["record"]), task.run(job, {"fill": map_fill}))
