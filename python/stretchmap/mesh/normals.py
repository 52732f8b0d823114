"""Unit normals at the vertices of a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core

__all__ = ["vertex_normals"]


def vertex_normals(V: NDArray[np.float64], F: NDArray[np.int32]) -> NDArray[np.float64]:
    """Mean normals of the faces round each vertex by area, (n, 3); NaN where they cancel."""
    face = _core.mesh.face_area_vectors(V, F)
    sums = [np.bincount(F.ravel(), np.repeat(c, 3), minlength=len(V)) for c in face.T]
    normals = np.stack(sums, axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))
