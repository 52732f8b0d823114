"""Refining a boundary where it is too coarse for the map prescribed on it.

The image's vertices lie on the target's surface, but its triangles are flat. Where the map bends
sharply inside a triangle, the flat one may be turned over in the target's flat torus; where the
target folds sharply between them, or is thinner than they are bent, two may cross. Such triangles
are refined, crossing ones where their image leaves the surface most. The new vertices lie on the
surface too, so the image follows it more and more closely there; nothing changes elsewhere. If that
does not help, such triangles are cut along the edges of the target instead (`_overlay`), until they
do not cross any more, at the latest when they lie on its surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..mesh.meshes import TriMesh
from ..mesh.split_edges import SplitSolid
from .flat_torus import FlatSurface
from .overlay import Splits, overlay_splits
from .surface_problem import SurfaceProblem

_ROUNDS = 40
_PATIENCE = 6  # rounds that do not lower the number of crossings
_MOST_TIMES = 20  # crossings may multiply along target edges before they vanish, but not so much
_MOST_PAIRS = 10_000
_NEAR, _SETTLE = 2, 10  # rings of vertices that make room for new ones, and how often each moves
_MOST_ADDED = 0.5  # as a share of the boundary's vertices
# Of an edge: its ends, and where it may be split.
_SHARES = np.concatenate([[0.0], np.linspace(0.1, 0.9, 17), [1.0]])
_LONGEST = 0.5  # turns: a point farther than half a turn from a face's center is taken for a copy


def split_long_edges(split: SplitSolid, flat: FlatSurface) -> tuple[SplitSolid, FlatSurface]:
    """Halve boundary edges, where they are and in the flat torus, until none is longer there than
    half a turn; the surface stays what it is.

    Parameters
    ----------
    split : SplitSolid
    flat : FlatSurface
        Its boundary.
    """
    while True:
        edges = flat.surface.edges
        ways = flat.ways(edges)
        lengths = np.abs(ways).max(axis=1)
        order = np.argsort(-lengths, kind="stable")
        bad = order[: np.count_nonzero(lengths > _LONGEST)]
        if not len(bad):
            return split, flat
        middles = flat.turns[edges[bad, 0]] + 0.5 * ways[bad]
        split, flat = _split(split, flat, (edges[bad], np.full(len(bad), 0.5), middles))


def halve_edges_once(split: SplitSolid, flat: FlatSurface) -> tuple[SplitSolid, FlatSurface]:
    """Halve boundary edges, as above, the longest of the surface first and none next to another."""
    edges = flat.surface.edges
    ends = flat.surface.V[edges]
    order = np.argsort(-np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), kind="stable")
    middles = flat.turns[edges[:, 0]] + 0.5 * flat.ways(edges)
    return _split(split, flat, (edges[order], np.full(len(order), 0.5), middles[order]))


def unfold_boundary(
    split: SplitSolid,
    flat: FlatSurface,
    bend: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> tuple[SplitSolid, FlatSurface, NDArray[np.intp]]:
    """Split boundary edges of a solid until a map of the flat torus turns no face over.

    Parameters
    ----------
    split : SplitSolid
    flat : FlatSurface
        Its boundary, free of folds.
    bend : callable
        One-to-one map (n, 2) -> (n, 2) of the flat torus, no farther than half a turn.

    Returns
    -------
    split : SplitSolid
        The solid, refined.
    bent : FlatSurface
        The boundary of that after the map.
    folded : ndarray of intp
        Faces that are still turned over.
    """
    most_vertices = (1.0 + _MOST_ADDED) * len(flat.turns)
    for _ in range(_ROUNDS):
        bent = flat.at(bend(flat.turns))
        folded = np.flatnonzero(~(_core.area.turn_areas(bent.chart, bent.turns) > 0.0))
        if len(flat.turns) > most_vertices or not len(folded):
            break
        split, flat = _split(split, flat, _worst_edges(flat, folded, bend))
    return split, bent, folded


@dataclass(frozen=True)
class EmbeddedBoundary:
    """What `embed_boundary` leaves behind.

    Attributes
    ----------
    split : SplitSolid
        The source, boundary edges split where that was needed.
    points : ndarray, shape (nb, 3)
        Image of each of its boundary vertices, on the target's surface.
    crossings : ndarray of int32, shape (c, 2)
        Empty; or, if refinement did not help, the pairs of boundary faces whose images cross in the
        source as it was given, which is then returned.
    """

    split: SplitSolid
    points: NDArray[np.float64]
    crossings: NDArray[np.int32]


def embed_boundary(
    source: SplitSolid,
    target: FlatSurface,
    image: FlatSurface,
    points: NDArray[np.float64],
    held: NDArray[np.int32],
) -> EmbeddedBoundary:
    """Split boundary edges of the source until the images of its boundary faces do not cross.

    Parameters
    ----------
    source : SplitSolid
    target : FlatSurface
    image : FlatSurface
        Its boundary where it goes in the target's flat torus, free of folds.
    points : ndarray, shape (nb, 3)
        The same on the target's surface.
    held : ndarray of int32
        Boundary vertices that stay where they are: landmarks.
    """
    crossings = crossing_faces(points, source.solid.surface)
    start = EmbeddedBoundary(source, points, crossings)
    for way in (_follow, _overlay):
        if not len(crossings):
            break
        result = way(start, target, image, held)
        if not len(result.crossings):
            return result
    return start


def crossing_faces(points: NDArray[np.float64], surface: TriMesh) -> NDArray[np.int32]:
    """Pairs (c, 2) of faces that cross where vertices go to ``points``; of very many only some."""
    return np.asarray(_core.certificate.crossing_faces(points, surface.F, _MOST_PAIRS))


def _follow(
    start: EmbeddedBoundary,
    target: FlatSurface,
    image: FlatSurface,
    held: NDArray[np.int32],
) -> EmbeddedBoundary:
    """New vertices where edges of crossing faces leave the surface most, and room made for them."""
    split, points, crossings = start.split, start.points, start.crossings
    most_vertices = (1.0 + _MOST_ADDED) * len(points)
    fewest, since = len(crossings), 0
    while len(crossings) and since < _PATIENCE and len(points) < most_vertices:
        bad = _worst_edges(image, np.unique(crossings), target.points)
        split, image = _split(split, image, bad)
        n_new = len(image.turns) - len(points)
        points = np.concatenate([points, target.points(image.turns[-n_new:])])
        image, points = _settled(image, target, points, held, n_new)
        crossings = crossing_faces(points, image.surface)
        since = 0 if len(crossings) < fewest else since + 1
        fewest = min(fewest, len(crossings))
    return EmbeddedBoundary(split, points, crossings)


def _overlay(
    start: EmbeddedBoundary,
    target: FlatSurface,
    image: FlatSurface,
    held: NDArray[np.int32],
) -> EmbeddedBoundary:
    """New vertices where crossing faces meet vertices and edges of the target; all others stay."""
    split, points, crossings = start.split, start.points, start.crossings
    most_vertices = (1.0 + _MOST_ADDED) * len(points)
    most = min(_MOST_PAIRS - 1, _MOST_TIMES * len(crossings))
    for _ in range(_ROUNDS):
        enough = len(crossings) > most or len(points) > most_vertices
        if enough or not len(crossings):
            break
        bad = overlay_splits(image, target, points, np.unique(crossings))
        if not len(bad[0]):
            break
        split, image = _split(split, image, bad)
        points = np.concatenate([points, target.points(image.turns[len(points) :])])
        crossings = crossing_faces(points, image.surface)
    return EmbeddedBoundary(split, points, crossings)


def _split(split: SplitSolid, flat: FlatSurface, wanted: Splits) -> tuple[SplitSolid, FlatSurface]:
    """A solid and its boundary with new vertices on edges of the latter."""
    edges, shares, where = wanted
    split, kept = split.split(split.solid.boundary_vertices[edges], shares)
    return split, flat.split(split.solid.surface, edges[kept], where[kept])


def _settled(
    image: FlatSurface,
    target: FlatSurface,
    points: NDArray[np.float64],
    held: NDArray[np.int32],
    n_new: int,
) -> tuple[FlatSurface, NDArray[np.float64]]:
    """The last ``n_new`` vertices and those near them moved for less distortion, one by one.

    What is straight in the flat torus is crooked on the surface; left there, the new vertices would
    make the image more crooked, not less.
    """
    edges, y = image.surface.edges, image.turns
    loose = np.zeros(len(y), bool)
    loose[-n_new:] = True
    for _ in range(_NEAR):
        loose[edges[loose[edges].any(axis=1)]] = True
    loose[held] = False
    problem = SurfaceProblem(image, target)
    problem.held = ~loose
    for _ in range(_SETTLE):
        y, points = problem.one_by_one(y, points)
    return image.at(y), points


def _worst_edges(
    flat: FlatSurface,
    faces: NDArray[np.intp],
    place: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> Splits:
    """The edge of each of some faces whose image under ``place`` strays most from its chord, and
    where; worst first, none twice.
    """
    F = flat.surface.F[faces]
    edges = np.sort(F[:, [[0, 1], [1, 2], [2, 0]]], axis=2)  # (m, 3, 2)
    start = flat.turns[edges[..., 0]][:, :, None]
    way = start + _SHARES[:, None] * flat.ways(edges)[:, :, None]
    there = place(way.reshape(-1, 2)).reshape(*way.shape[:3], -1)
    first, last = there[:, :, :1], there[:, :, -1:]
    strays = np.linalg.norm(there - first - _SHARES[:, None] * (last - first), axis=3)
    lengths = np.linalg.norm(last - first, axis=3)[..., 0]
    # An edge that follows the surface gives way to a long one.
    score = strays.max(axis=2) + 1e-6 * lengths
    rows, side = np.arange(len(F)), np.argmax(score, axis=1)
    straight = strays[rows, side].max(axis=1) <= 1e-9 * lengths[rows, side]
    found = np.where(straight, len(_SHARES) // 2, np.argmax(strays[rows, side], axis=1))
    order = np.argsort(-score[rows, side], kind="stable")
    chosen = edges[rows, side][order]
    _, once = np.unique(chosen, axis=0, return_index=True)
    keep = order[np.sort(once)]
    return edges[keep, side[keep]], _SHARES[found[keep]], way[keep, side[keep], found[keep]]
