"""Where the flat image triangles of a boundary leave the target's surface, and how to bring them
back.

In the flat torus the edges of source and target cut each other into pieces. On each piece both the
surface and the image triangle are linear, so their distance is largest at a corner of a piece: at a
target vertex inside a face, or where an edge of the source crosses one of the target. A face with a
vertex at all of these lies on the surface exactly, and two such faces cannot cross.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .flat_torus import FlatSurface

_SAMPLES = 19  # of an edge; the crossings next to them are found
_EXACT = 1e-9  # of the target's size: no distance
_LEAST_PART = 1e-3  # of a face, in the flat torus
_LEAST_SHARE = 0.1  # of an edge on the source, where the place is free

Splits = tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]


def overlay_splits(
    image: FlatSurface,
    target: FlatSurface,
    points: NDArray[np.float64],
    faces: NDArray[np.intp],
) -> Splits:
    """An edge of each of some faces to be split, and where its new vertex goes.

    A face with target vertices inside gets the one farthest from it as a vertex, others get one
    where their longest edge that leaves the surface does so most: were it the edge that does so
    most of all, ever shorter ones would be split, and never the one they run along.

    Parameters
    ----------
    image, target : FlatSurface
        Both in the flat torus of the latter.
    points : ndarray, shape (n, 3)
        Vertices of the former on the target's surface.
    faces : ndarray of intp, shape (k,)
        Ascending.

    Returns
    -------
    edges : ndarray of int32, shape (e, 2)
        Most urgent first, none twice; empty if all faces lie on the surface.
    shares : ndarray, shape (e,)
        Where to split the source, as a share of the way from the first end.
    where : ndarray, shape (e, 2)
        The new vertices in the flat torus, as seen from the first end.
    """
    exact = _EXACT * float(np.linalg.norm(np.ptp(target.surface.V, axis=0)))
    by_vertex = _at_target_vertices(image, target, points, faces, exact)
    by_edge = _at_crossings(image, target, points, faces, exact)
    edges = np.concatenate([by_vertex[0], by_edge[0]])
    shares = np.concatenate([by_vertex[1], by_edge[1]])
    where = np.concatenate([by_vertex[2], by_edge[2]])
    _, once = np.unique(edges, axis=0, return_index=True)
    once.sort()
    return edges[once], np.clip(shares[once], _LEAST_SHARE, 1.0 - _LEAST_SHARE), where[once]


def _at_crossings(
    image: FlatSurface,
    target: FlatSurface,
    points: NDArray[np.float64],
    faces: NDArray[np.intp],
    exact: float,
) -> Splits:
    """The longest edge of each face that leaves the surface, where it does so most."""
    sides = np.sort(image.surface.F[faces][:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    edges, index = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    start, way = image.turns[edges[:, 0]], image.ways(edges)
    samples = np.tile(np.linspace(0.0, 1.0, _SAMPLES), (len(edges), 1))
    found, weights = target.locate(
        (start[:, None] + samples[..., None] * way[:, None]).reshape(-1, 2)
    )
    # Where the line enters and leaves the target faces found.
    corners = target.corners(found)
    inverse = np.linalg.inv(np.stack([corners[:, k] - corners[:, 0] for k in (1, 2)], axis=-1))
    change = np.einsum("nij,nj->ni", inverse, np.repeat(way, _SAMPLES, axis=0))
    change = np.column_stack([-change.sum(axis=1), change])
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = -weights / change
    leave = np.where(change < -1e-14, np.maximum(zero, 0.0), np.inf).min(axis=1)
    enter = np.where(change > 1e-14, np.minimum(zero, 0.0), -np.inf).max(axis=1)
    shares = np.hstack([samples + ends.reshape(-1, _SAMPLES) for ends in (enter, leave)])
    shares[~((shares > 1e-6) & (shares < 1.0 - 1e-6))] = 0.0
    where = start[:, None] + shares[..., None] * way[:, None]
    there = target.points(where.reshape(-1, 2)).reshape(*shares.shape, 3)
    first, last = points[edges[:, 0]], points[edges[:, 1]]
    chord = (last - first)[:, None]
    strays = np.linalg.norm(there - first[:, None] - shares[..., None] * chord, axis=2)
    best = strays.argmax(axis=1)
    rows = np.arange(len(edges))
    length = np.where(strays[rows, best] > exact, np.linalg.norm(last - first, axis=1), -1.0)
    index = index.reshape(-1, 3)
    chosen = np.unique(index[np.arange(len(faces)), length[index].argmax(axis=1)])
    chosen = chosen[length[chosen] > 0.0]
    chosen = chosen[np.argsort(-length[chosen], kind="stable")]
    at = chosen, best[chosen]
    return edges[chosen], shares[at], where[at]


def _at_target_vertices(
    image: FlatSurface,
    target: FlatSurface,
    points: NDArray[np.float64],
    faces: NDArray[np.intp],
    exact: float,
) -> Splits:
    """The target vertex farthest from each face it lies in, put on one of the face's edges."""
    F = image.surface.F
    home, weights = image.locator.locate(target.turns)
    inside = np.isin(home, faces) & (weights.min(axis=1) > 1e-9)
    v = np.flatnonzero(inside)
    f, weights = home[v], weights[v]
    there = np.einsum("ij,ijk->ik", weights, points[F[f]])
    far = np.linalg.norm(target.surface.V[v] - there, axis=1)
    order = np.lexsort((-far, f))
    order = order[np.diff(f[order], prepend=-1) > 0]
    order = order[far[order] > exact]
    v, f, weights, far = v[order], f[order], weights[order], far[order]
    # The edge that leaves the largest of the four parts the smallest: the vertex need not be on it.
    corners = image.corners(f)
    t = np.einsum("ij,ijk->ik", weights, corners)
    across = _across(F, len(points))[f]
    parts = np.empty((len(v), 3))
    for k in range(3):
        a, b, c = (corners[:, (k + j) % 3] for j in range(3))
        d = a + image.ways(np.stack([F[f, k], across[:, k]], axis=-1))
        here = np.minimum(_area(a, t, c), _area(t, b, c)) / _area(a, b, c)
        there = np.minimum(_area(t, a, d), _area(b, t, d)) / _area(b, a, d)
        parts[:, k] = np.minimum(here, there)
    side = parts.argmax(axis=1)
    rows = np.flatnonzero(parts.max(axis=1, initial=0.0) > _LEAST_PART)
    rows = rows[np.argsort(-far[rows], kind="stable")]
    f, side, weights = f[rows], side[rows], weights[rows]
    n = np.arange(len(rows))
    ends = np.stack([F[f, side], F[f, (side + 1) % 3]], axis=1)
    share = np.stack([weights[n, side], weights[n, (side + 1) % 3]], axis=1)
    up = np.argsort(ends, axis=1)
    ends, share = np.take_along_axis(ends, up, axis=1), np.take_along_axis(share, up, axis=1)
    seen = image.turns[ends[:, 0]] - corners[rows, (side + up[:, 0]) % 3]
    return ends, share[:, 1] / share.sum(axis=1), t[rows] + seen


def _across(F: NDArray[np.int32], n: int) -> NDArray[np.int32]:
    """(m, 3) vertex on the other side of the edge from corner k to corner k + 1."""
    first, second = F.astype(np.int64), np.roll(F, -1, axis=1)
    key, twin = (first * n + second).ravel(), (second.astype(np.int64) * n + first).ravel()
    order = np.argsort(key)
    return np.roll(F, 1, axis=1).ravel()[order[np.searchsorted(key[order], twin)]].reshape(F.shape)


def _area(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    p, q = b - a, c - a
    return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
