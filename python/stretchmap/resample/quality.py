"""Measures of hexahedra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

_SAMPLES = 200_000  # of the boundary of a grid ...
_PER_SIDE = (4, 10)  # ... with at least and at most so many along a side of a quad
MOST_MISSED = 0.02  # of the volume; a grid that misses more is made another way

# Faces, seen from outside.
FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
)
# Parallel edges, one row for each of the three directions.
EDGES = np.array(
    [[[0, 1], [3, 2], [4, 5], [7, 6]],
     [[0, 3], [1, 2], [4, 7], [5, 6]],
     [[0, 4], [1, 5], [2, 6], [3, 7]]]
)  # fmt: skip

# Directions of the edges from each corner to its three neighbors, in the order of the core.
DIRECTIONS = np.array([[0, 1, 2], [1, 0, 2], [0, 1, 2], [1, 0, 2]] + [[1, 0, 2], [0, 1, 2]] * 2)


def angle_weighted_normals(surface: TriMesh) -> NDArray[np.float64]:
    """(n, 3) unit normals, means of the faces' weighted by their angles."""
    V, F = surface.V, surface.F
    edges = [V[F[:, (k + 1) % 3]] - V[F[:, k]] for k in range(3)]
    normals = np.cross(edges[0], -edges[2])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    total = np.zeros_like(V)
    for k in range(3):
        first, second = edges[k], -edges[k - 1]
        sine = np.linalg.norm(np.cross(first, second), axis=1)
        angle = np.arctan2(sine, (first * second).sum(axis=1))
        for axis in range(3):
            total[:, axis] += np.bincount(F[:, k], angle * normals[:, axis], minlength=len(V))
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))


def boundary_quads(H: NDArray[np.int32]) -> NDArray[np.int32]:
    """(b, 4) faces that belong to one hexahedron only, seen from outside."""
    faces = H[:, FACES].reshape(-1, 4)
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.ascontiguousarray(faces[np.sort(first[count == 1])])


def boundary_distances(
    V: NDArray[np.float64], quads: NDArray[np.int32], surface: TriMesh
) -> tuple[float, float]:
    """Largest distances from quads to a surface and from the surface to the quads.

    Points of a quad are sampled on the bilinear patch of its corners, which for the way back is
    replaced by triangles between them: quads may be ten times as long as wide, and warped. Of the
    surface the vertices and the centers of its faces are sampled.
    """
    side = int(np.clip(np.sqrt(_SAMPLES / len(quads)), *_PER_SIDE))
    t = np.linspace(0.0, 1.0, side)
    x, y = (a.ravel() for a in np.meshgrid(t, t))
    weights = np.stack([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y], axis=1)
    there = np.ascontiguousarray(np.einsum("sc,bcx->bsx", weights, V[quads]).reshape(-1, 3))
    outward = _largest_distance(surface.V, surface.F, there)
    here = np.arange(side * side).reshape(side, side)
    a, b, c, d = here[:-1, :-1], here[:-1, 1:], here[1:, 1:], here[1:, :-1]
    cells = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    patches = (cells + side * side * np.arange(len(quads))[:, None, None]).reshape(-1, 3)
    sites = np.concatenate([surface.V, surface.V[surface.F].mean(axis=1)])
    return outward, _largest_distance(there, patches.astype(np.int32), sites)


def _largest_distance(
    V: NDArray[np.float64], F: NDArray[np.int32], queries: NDArray[np.float64]
) -> float:
    feet, _, _ = _core.maps.SurfaceTree(V, F).closest(np.ascontiguousarray(queries))
    return float(np.linalg.norm(feet - queries, axis=1).max())


def missed_volume(V: NDArray[np.float64], H: NDArray[np.int32], surface: TriMesh) -> float:
    """Share of the volume that is missing or too much; 1 if a hexahedron is not valid."""
    if (_core.resample.valid_hexes(V, H) == 0).any():
        return 1.0
    return abs(float(_core.resample.hex_volumes(V, H).sum()) / surface.volume - 1.0)
