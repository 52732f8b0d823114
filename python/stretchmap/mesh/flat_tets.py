"""Tets without volume, which constrained Delaunay meshes have on flat parts of a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .meshes import TetMesh
from .split_edges import TET_EDGES, split_edges

# How far the middle of an edge leaves it, as shares of its length, the best of which is taken.
_STEPS = 0.5 ** np.arange(1, 12)


def opened(solid: TetMesh) -> TetMesh:
    """Give volume to tets that have none, the surface and all vertices kept.

    An edge inside of the solid is split, and the new vertex moves off the plane of the flat tets
    round it, as far as the least tet there gains.

    Parameters
    ----------
    solid : TetMesh

    Returns
    -------
    TetMesh
        With a vertex more for every tet that was opened, behind all others; the same object if
        there is nothing to open. Flat tets that no edge opens stay.
    """
    stay: set[tuple[int, ...]] = set()
    while True:
        flat = [t for t in solid.diagnose().degenerate if tuple(solid.T[t]) not in stay]
        if not flat:
            return solid
        better = _opened(solid, flat[0])
        stay.add(tuple(solid.T[flat[0]]))
        solid = solid if better is None else better


def _opened(solid: TetMesh, tet: int) -> TetMesh | None:
    """With the best of its edges split, if there is one."""
    edges = np.sort(solid.T[tet][TET_EDGES], axis=1)
    on_surface = np.sort(solid.boundary_vertices[solid.surface.edges], axis=1)
    inside = ~(edges[:, None] == on_surface).all(axis=2).any(axis=1)
    splits = [_split(solid, tet, edge) for edge in edges[inside]]
    worst, best = max(splits, key=lambda found: found[0], default=(0.0, None))
    return best if worst > 0.0 else None


def _split(solid: TetMesh, tet: int, edge: NDArray[np.int32]) -> tuple[float, TetMesh | None]:
    """Least volume round the middle of an edge, over its length cubed, and the solid with it."""
    split = split_edges(solid, edge[None], np.array([0.5])).solid
    middle = len(solid.V)
    round_it = split.T[(split.T == middle).any(axis=1)]
    at = np.argmax(round_it == middle, axis=1)
    # Volumes are linear in the vertex that moves: what they gain on the way along the normal.
    normal = _normal(solid.V[solid.T[tet]])
    length = float(np.linalg.norm(np.subtract(*solid.V[edge])))
    corners = split.V[round_it]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    moved = corners.copy()
    moved[np.arange(len(at)), at] += length * normal
    gained = np.linalg.det(moved[:, 1:] - moved[:, :1]) / 6.0 - volumes
    steps = np.concatenate([_STEPS, -_STEPS])
    least = (volumes[:, None] + gained[:, None] * steps).min(axis=0)
    best = int(np.argmax(least))
    V = split.V.copy()
    V[middle] += steps[best] * length * normal
    return float(least[best]) / length**3, TetMesh(V, split.T)


def _normal(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normal of the plane that fits best."""
    return np.asarray(np.linalg.svd(points - points.mean(axis=0))[2][-1])
