"""The paper's way to landmarks: a piecewise-affine map of the flat torus."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from ..errors import LandmarkError

__all__ = ["affine_landmark_map"]


def affine_landmark_map(
    source: NDArray[np.float64], target: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Piecewise-affine map h of section 7.1 on a periodic Delaunay triangulation of the landmarks.

    Parameters
    ----------
    source, target : ndarray, shape (k, 2)
        Landmarks in turns; each target is taken the short way from its source.
    y : ndarray, shape (n, 2)
        Points to be mapped.

    Returns
    -------
    ndarray, shape (n, 2)

    Raises
    ------
    LandmarkError
        If a triangle turns over; ``ids`` are the two landmarks at fault.
    """
    move = target - source
    move = move - np.round(move)
    if not len(source):
        return y
    whole = np.floor(source)
    tiles = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)], float)
    nodes = ((source - whole)[None] + tiles[:, None]).reshape(-1, 2)
    moves = np.tile(move, (9, 1))
    triangulation = Delaunay(nodes)
    corners = triangulation.simplices
    before, after = _double_areas(nodes[corners]), _double_areas((nodes + moves)[corners])
    # Every triangle has a copy with a corner in the middle tile; those at the rim are no triangles
    # of the periodic triangulation.
    k = len(source)
    middle = ((corners >= 4 * k) & (corners < 5 * k)).any(axis=1)
    folded = np.flatnonzero(middle & ~(after * before > 0.0))
    if len(folded):
        pair = _worst_pair(nodes, moves, corners[folded]) % len(source)
        raise LandmarkError(
            f"landmarks {pair[0]} and {pair[1]} contradict each other: the map between them turns "
            "over; correct or drop one of them, or use landmark_map='smooth'",
            pair,
        )
    base = np.floor(y)
    found = triangulation.find_simplex(y - base)
    matrix = triangulation.transform[found]
    first = np.einsum("nij,nj->ni", matrix[:, :2], y - base - matrix[:, 2])
    weights = np.column_stack([first, 1.0 - first.sum(axis=1)])
    return np.asarray(y + np.einsum("ni,nij->nj", weights, moves[corners[found]]))


def _double_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _worst_pair(
    nodes: NDArray[np.float64], moves: NDArray[np.float64], triangles: NDArray[np.int32]
) -> NDArray[np.intp]:
    """The two corners whose difference in displacement is largest for their distance."""
    pairs = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    gap = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    strain = np.linalg.norm(moves[pairs[:, 0]] - moves[pairs[:, 1]], axis=1) / gap
    return np.asarray(pairs[int(np.argmax(strain))], np.intp)
