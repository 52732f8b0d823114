"""Signed areas of image faces: against the torus' normals, and in the flat chart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.torus import TWO_PI, Torus


def outward_areas(
    image: NDArray[np.float64], faces: NDArray[np.int32], torus: Torus
) -> NDArray[np.float64]:
    """(m,) area each face shows to the outside of the torus at its centroid, negative if flipped.

    Parameters
    ----------
    image : ndarray, shape (n, 3)
    faces : ndarray of int32, shape (m, 3)
    torus : Torus
    """
    u, v, _ = torus.coordinates(image[faces].mean(axis=1))
    vectors = _core.mesh.face_area_vectors(image, faces)
    areas: NDArray[np.float64] = np.einsum("ij,ij->i", torus.normal(u, v), vectors)
    return areas


def chart_areas(faces: NDArray[np.int32], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed areas of faces in the (u, v) chart, each edge taken the short way round.

    Parameters
    ----------
    faces : ndarray of int32, shape (m, 3)
    angles : ndarray, shape (n, 2)
        (u, v) in radians, any branch.

    Returns
    -------
    ndarray, shape (m,)
    """
    corner = angles[faces]
    a = corner[:, 1] - corner[:, 0]
    b = corner[:, 2] - corner[:, 0]
    a -= TWO_PI * np.round(a / TWO_PI)
    b -= TWO_PI * np.round(b / TWO_PI)
    return 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
