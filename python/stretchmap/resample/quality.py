"""Measures of hexahedra."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Corner of a hexahedron and the three corners joined to it, positively oriented.
CORNERS = np.array(
    [[0, 1, 3, 4], [1, 2, 0, 5], [2, 3, 1, 6], [3, 0, 2, 7],
     [4, 7, 5, 0], [5, 4, 6, 1], [6, 5, 7, 2], [7, 6, 4, 3]]
)  # fmt: skip
# Parallel edges, one row for each of the three directions, and the directions of CORNERS' edges.
EDGES = np.array(
    [[[0, 1], [3, 2], [4, 5], [7, 6]],
     [[0, 3], [1, 2], [4, 7], [5, 6]],
     [[0, 4], [1, 5], [2, 6], [3, 7]]]
)  # fmt: skip
DIRECTIONS = np.array(
    [[0, 1, 2], [1, 0, 2], [0, 1, 2], [1, 0, 2], [1, 0, 2], [0, 1, 2], [1, 0, 2], [0, 1, 2]]
)


def corner_tets(H: NDArray[np.int32]) -> NDArray[np.int32]:
    """(8 k, 4) tets of the corners and their three neighbours."""
    return np.ascontiguousarray(H[:, CORNERS].reshape(-1, 4))


def jacobians(V: NDArray[np.float64], H: NDArray[np.int32]) -> NDArray[np.float64]:
    """(k, 8) Jacobians at the corners over the product of the lengths of the edges there."""
    corners = V[H[:, CORNERS]]
    edges = corners[:, :, 1:] - corners[:, :, :1]
    lengths = np.linalg.norm(edges, axis=-1).prod(axis=-1)
    return np.linalg.det(edges) / np.maximum(lengths, 1e-300)


def hex_volumes(V: NDArray[np.float64], H: NDArray[np.int32]) -> NDArray[np.float64]:
    """Volumes of the trilinear hexahedra, by Gauss quadrature that is exact for them."""
    signs = np.array(
        [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
         [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
    )  # fmt: skip
    total = np.zeros(len(H))
    for node in signs / np.sqrt(3.0):
        factors = 1.0 + signs * node
        slopes = (
            np.stack(
                [signs[:, a] * factors[:, (a + 1) % 3] * factors[:, (a + 2) % 3] for a in range(3)]
            )
            / 8.0
        )
        total += np.linalg.det(np.einsum("ac,kcx->kax", slopes, V[H]))
    return total
