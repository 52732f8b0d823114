"""Long edges halved, the shape kept: what remeshing needs of the slivers of CAD surfaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.meshes import TriMesh
from .soup import Faces, Points

__all__ = ["split_long_edges"]

_MOST_FACES = 200_000
# Corners 0 to 2 and middles 3 (of 01), 4 (of 12), 5 (of 20), by what is split and, for two edges,
# by the diagonal of the quadrangle left.
_ONE = ((0, 3, 2), (3, 1, 2))
_TWO_FROM_MIDDLE = ((3, 1, 4), (0, 3, 2), (3, 4, 2))
_TWO_FROM_CORNER = ((3, 1, 4), (0, 3, 4), (0, 4, 2))
_THREE = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))


def split_long_edges(surface: TriMesh, limit: float) -> TriMesh:
    """Halve edges, in both faces at each, until none is longer than the limit.

    Parameters
    ----------
    surface : TriMesh
        Its vertices are the first of the result.
    limit : float
        Passed over where there would be far more than 200 000 faces.

    Returns
    -------
    TriMesh
        The same set of points, of the same topology.
    """
    V, F = surface.V, surface.F
    while len(F) < _MOST_FACES:
        ends = np.stack([F, np.roll(F, -1, axis=1)], axis=2)
        is_long = np.linalg.norm(V[ends[..., 0]] - V[ends[..., 1]], axis=2) > limit
        if not is_long.any():
            break
        V, F = _halved(V, F, np.sort(ends, axis=2), is_long)
    return TriMesh(V, F)


def _halved(V: Points, F: Faces, ends: Faces, is_long: NDArray[np.bool_]) -> tuple[Points, Faces]:
    """One round: the middles of some edges become vertices."""
    pairs, which = np.unique(ends[is_long], axis=0, return_inverse=True)
    middle = np.full(F.shape, -1)
    middle[is_long] = len(V) + which.reshape(-1)
    V = np.vstack([V, V[pairs].mean(axis=1)])
    count = is_long.sum(axis=1)
    # Turned so that the first edge is the one split, or the last the one kept.
    first = np.where(count == 1, is_long.argmax(axis=1), 0)
    first = np.where(count == 2, (is_long.argmin(axis=1) + 1) % 3, first)
    turn = (first[:, None] + np.arange(3)) % 3
    six = np.hstack([np.take_along_axis(F, turn, 1), np.take_along_axis(middle, turn, 1)])
    from_middle = _length(V, six[:, [3, 2]]) < _length(V, six[:, [0, 4]])
    parts = [F[count == 0]]
    for rows, pattern in (
        (count == 1, _ONE),
        ((count == 2) & from_middle, _TWO_FROM_MIDDLE),
        ((count == 2) & ~from_middle, _TWO_FROM_CORNER),
        (count == 3, _THREE),
    ):
        parts.append(six[rows][:, np.array(pattern)].reshape(-1, 3))
    return V, np.vstack(parts).astype(np.int32)


def _length(V: Points, ends: Faces) -> Points:
    return np.asarray(np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1))
