"""The common stretch of all tets: one axis in other units, layers, a scan with thick slices.

Ratios of volumes do not change under an affine map of the source, but shapes do: of a solid with
one axis stretched a hundred times every tet is a needle, and no shape is worth keeping.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core

__all__ = ["unstretching"]

_SAMPLE = 20_000  # tets
_STEPS, _TOL = 100, 1e-4
_FROM, _TO = np.triu_indices(4, 1)
_MUCH = 3.0  # ratio of axes up to which a mesh is as good as even


def unstretching(V: NDArray[np.float64], T: NDArray[np.int32]) -> NDArray[np.float64] | None:
    """Matrix A, det A = 1, after which the edges of the tets of ``V @ A`` have no direction.

    Parameters
    ----------
    V : ndarray, shape (n, 3)
    T : ndarray of int32, shape (k, 4)

    Returns
    -------
    ndarray, shape (3, 3), or None
        None where they have little as it is.

    Notes
    -----
    The scatter of the edges' directions by Tyler's fixed point (Annals of Statistics 15, 1987),
    which long edges do not sway.
    """
    T = T[:: -(-len(T) // _SAMPLE)]
    # All six: of grids cut along diagonals, those at a tet's first corner have the diagonal's.
    edges = (V[T[:, _TO]] - V[T[:, _FROM]]).reshape(-1, 3)
    edges = edges / np.linalg.norm(edges, axis=1, keepdims=True).mean()
    scatter = np.eye(3)
    for _ in range(_STEPS):
        new = _core.measures.direction_scatter(edges, np.linalg.inv(scatter))
        new *= 3.0 / np.trace(new)
        done = np.abs(new - scatter).max() <= _TOL * np.linalg.eigvalsh(new)[0]
        scatter = new
        if done:
            break
    values, axes = np.linalg.eigh(scatter)
    if not values[0] > 0.0 or values[2] <= _MUCH**2 * values[0]:
        return None
    scale = values**-0.5
    scale /= scale.prod() ** (1.0 / 3.0)
    matrix: NDArray[np.float64] = (axes * scale) @ axes.T
    return matrix
