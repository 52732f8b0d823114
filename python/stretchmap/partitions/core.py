"""The core of the solid torus as edges of a mesh, where all sheets of v meet."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import SolverError
from ..mesh.split_edges import TET_EDGES
from .heights import CORE, TET_FACES, Heights
from .pieces import Pieces

# The core goes through a vertex or an edge nearer to it than this share of a face.
_SNAP = 0.05
_ROUNDS = 10_000


def with_core(pieces: Pieces) -> Pieces:
    """The pieces cut so that no tet has the core inside, and the function of v is 0 on its edges.

    Raises
    ------
    SolverError
        The image has no such core.
    """
    pieces = _at_core(pieces, _near_vertices(pieces))
    for _ in range(_ROUNDS):
        faces, weights = _core_faces(pieces)
        if not len(faces):
            return pieces
        order = np.sort(weights, axis=1)
        to_vertex, to_edge = order[:, 1] < _SNAP, order[:, 0] < _SNAP
        if to_vertex.any():
            near = np.argmax(weights[to_vertex], axis=1)
            pieces = _at_core(pieces, faces[to_vertex, near])
        elif to_edge.any():
            pieces = _split_edges(pieces, faces[to_edge], weights[to_edge])
        else:
            pieces = _split_faces(pieces, faces, weights)
    raise SolverError("the image has no core to divide it round; is the map certified?")


def _at_core(pieces: Pieces, vertices: NDArray[np.integer]) -> Pieces:
    points = pieces.points.copy()
    points[vertices[:, None], CORE] = 0.0
    return dataclasses.replace(pieces, points=points)


def _near_vertices(pieces: Pieces) -> NDArray[np.integer]:
    """Vertices nearer to the core than a share of every edge they have."""
    ends = pieces.T[:, TET_EDGES].reshape(-1, 2)
    image, at = pieces.points[:, 3:6], pieces.points[:, CORE]
    length = np.linalg.norm(image[ends[:, 0]] - image[ends[:, 1]], axis=1)
    shortest = np.full(len(at), np.inf)
    for column in ends.T:
        np.minimum.at(shortest, column, length)
    return np.flatnonzero(np.linalg.norm(at, axis=1) <= _SNAP * shortest)


def _core_faces(pieces: Pieces) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Faces the core goes through, lowest vertex first, and where: barycentric coordinates."""
    T = pieces.T[_round_core(pieces)]
    tet, corner = np.nonzero(Heights.of(pieces.points, "v", 0.0).turns(T))
    faces = np.unique(np.sort(T[tet[:, None], TET_FACES[corner]], axis=1), axis=0)
    a, b = pieces.points[:, CORE].T[:, faces]  # (faces, 3)
    on, after = [1, 2, 0], [2, 0, 1]
    areas = np.abs(a[:, on] * b[:, after] - a[:, after] * b[:, on])
    return faces, areas / areas.sum(axis=1, keepdims=True)


def _round_core(pieces: Pieces) -> NDArray[np.bool_]:
    """Tets whose corners lie on both sides of the core, along each axis: all it can go through."""
    found = np.ones(len(pieces.T), bool)
    for column in CORE:
        corners = list(pieces.points[:, column][pieces.T].T)
        found &= (np.minimum.reduce(corners) <= 0.0) & (np.maximum.reduce(corners) >= 0.0)
    return found


def _split_edges(pieces: Pieces, faces: NDArray[np.int32], weights: NDArray[np.float64]) -> Pieces:
    """The edges the core passes by, of those in one tet only one, split where it does."""
    rows = np.arange(len(faces))[:, None]
    ends = np.sort(np.argsort(weights, axis=1)[:, 1:], axis=1)
    edges, first = np.unique(faces[rows, ends], axis=0, return_index=True)
    share = (weights[rows, ends] / weights[rows, ends].sum(axis=1, keepdims=True))[first, 1]
    n = len(pieces.points)
    keys = edges[:, 0].astype(np.int64) * n + edges[:, 1]
    own = np.sort(pieces.T[:, TET_EDGES], axis=2).astype(np.int64) @ [n, 1]  # (k, 6)
    which = np.where(np.isin(own, keys), np.searchsorted(keys, own), len(keys))
    lowest = which.min(axis=1)
    alone = np.ones(len(keys) + 1, bool)
    alone[which[which > lowest[:, None]]] = False
    touched = np.flatnonzero((lowest < len(keys)) & alone[lowest])
    T = np.ascontiguousarray(pieces.T[touched])
    places = np.full(T.shape, _core.partitions.EVERYWHERE, np.int32)
    for k in (0, 1):
        places[edges[lowest[touched], k, None] == T] = 2 * k
    split = _core.partitions.split_tets(T, n, places, 3)
    cut = split.cut_edges
    place = np.searchsorted(keys, cut[:, 0].astype(np.int64) * n + cut[:, 1])
    start, end = pieces.points[cut[:, 0]], pieces.points[cut[:, 1]]
    added = start + share[place, None] * (end - start)
    return _with(pieces, added, touched, split.tets, touched[split.parent])


def _split_faces(pieces: Pieces, faces: NDArray[np.int32], weights: NDArray[np.float64]) -> Pieces:
    """Faces cut in three where the core goes through, with the tets on both sides."""
    n = len(pieces.points)
    pairs = np.unique(faces[:, 0].astype(np.int64) * n + faces[:, 1])

    def numbered(faces: NDArray[np.int32]) -> NDArray[np.int64]:
        """A number for each face of those cut, lowest vertex first, and -1 for others."""
        pair = faces[..., 0].astype(np.int64) * n + faces[..., 1]
        place = np.minimum(np.searchsorted(pairs, pair), len(pairs) - 1)
        return np.where(pairs[place] == pair, place * n + faces[..., 2], -1)

    keys = numbered(faces)
    added = (weights[:, :, None] * pieces.points[faces]).sum(axis=1)
    while True:
        own = numbered(np.sort(pieces.T[:, TET_FACES], axis=2))  # (k, 4)
        found = np.isin(own, keys)
        touched = np.flatnonzero(found.any(axis=1))
        if not len(touched):
            return pieces
        corner = np.argmax(found[touched], axis=1)
        new = n + np.searchsorted(keys, own[touched, corner])
        base = pieces.T[touched[:, None], TET_FACES[corner]]
        apex = pieces.T[touched, corner]
        tets = [np.column_stack([apex, base[:, i], base[:, (i + 1) % 3], new]) for i in range(3)]
        T = np.stack(tets, axis=1).reshape(-1, 4).astype(np.int32)
        pieces = _with(pieces, added, touched, T, np.repeat(touched, 3))
        added = added[:0]


def _with(
    pieces: Pieces,
    added: NDArray[np.float64],
    replaced: NDArray[np.intp],
    T: NDArray[np.int32],
    origin: NDArray[np.intp],
) -> Pieces:
    """Pieces with further points, all on the core, and some tets replaced."""
    added[:, CORE] = 0.0
    kept = np.setdiff1d(np.arange(len(pieces.T)), replaced, assume_unique=True)
    return dataclasses.replace(
        pieces,
        points=np.concatenate([pieces.points, added]),
        T=np.concatenate([pieces.T[kept], T]),
        parent=pieces.parent[np.concatenate([kept, origin])],
    )
