"""Points of a surface where its distance from a grid is sampled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.meshes import TriMesh

__all__ = ["surface_sites"]


def surface_sites(surface: TriMesh, count: int) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Points spread over the surface, and its vertices, which are where it is farthest out."""
    faces, weights = _spread(surface, count)
    used = np.unique(surface.F.ravel(), return_index=True)[1]
    return (
        np.concatenate([faces, (used // 3).astype(np.int32)]),
        np.concatenate([weights, np.eye(3)[used % 3]]),
    )


def _spread(surface: TriMesh, count: int) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Faces (count,) and weights (count, 3) of points at even steps of area along the faces."""
    ends = np.cumsum(surface.face_areas)
    faces = np.searchsorted(ends, (np.arange(count) + 0.5) / count * ends[-1])
    faces = np.minimum(faces, surface.n_faces - 1)
    # Inside a face a sequence of low discrepancy (Roberts' R2), folded into the triangle.
    a, b = (np.arange(1, count + 1)[:, None] * [0.7548776662466927, 0.5698402909980532] % 1.0).T
    out = a + b > 1.0
    a, b = np.where(out, 1.0 - a, a), np.where(out, 1.0 - b, b)
    return faces.astype(np.int32), np.ascontiguousarray(np.stack([1.0 - a - b, a, b], axis=1))
