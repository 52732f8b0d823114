"""Tets cut along all levels of a coordinate at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from .. import _core
from ..base.options import memory
from ..base.torus import TWO_PI
from .heights import Detours, Ids, Ladder, Reals
from .pieces import Pieces, volumes_of_parts

# How far cut points may move to make up for volume: an odds ratio, as a logarithm.
_TILT = 0.7
# Last steps at most, and the relative error of a part that needs none.
_POLISH, _EXACT = 20, 1e-13
# Bytes for each piece of a tet that is cut, and pieces for each slab of it.
_BYTES_PER_PIECE = 400
_PIECES = 5


class Slabs:
    """Tets cut along all levels of a coordinate, and others where they have to follow.

    A function that grows across a level vanishes at vertices the level is made to go through.
    Scaled on its positive side, by the exponential of a tilt, it moves the level everywhere else,
    between the same vertices: the volume of a part is set so. On a tet it stays linear, and levels
    do not cross as long as they do not cross on an edge.

    Parameters
    ----------
    chosen : ndarray of bool, shape (k,)
        The tets to cut. Vertices of no chosen one are on all levels, so that other tets are cut at
        edges between vertices of chosen ones and nowhere else: neighbors agree on every edge.
    snap : ndarray, shape (levels,)
        As `Ladder.places` takes it.
    detours : Detours
        Vertices a level passes by although it would go through them.
    """

    def __init__(
        self,
        pieces: Pieces,
        ladder: Ladder,
        chosen: NDArray[np.bool_],
        snap: Reals,
        detours: Detours,
    ) -> None:
        inner = np.zeros(len(pieces.points), bool)
        inner[pieces.T[chosen]] = True
        count = np.zeros(len(pieces.T), np.int8)
        for corner in pieces.T.T:  # several times as fast as sums along rows of four
            count += inner[corner]
        touched = np.flatnonzero(count > 1)
        untouched = np.setdiff1d(np.arange(len(pieces.T)), touched, assume_unique=True)
        T = np.ascontiguousarray(pieces.T[touched])
        self._before, self._ladder, self._detours = pieces, ladder, detours
        places = ladder.places(T, inner, snap, detours)
        self.own = pieces.only(touched[chosen[touched]])
        self.corners, self.volumes = places[chosen[touched]], self.own.volumes("source")
        known = self.corners != _core.partitions.EVERYWHERE
        self._low = np.minimum.reduce(list(np.where(known, self.corners, 2**30).T))
        self._high = np.maximum.reduce(list(self.corners.T))
        slabs = np.maximum(self._high - self._low, 0).sum(dtype=float) / 2 + len(T)
        memory("so many parts of pieces this small", _BYTES_PER_PIECE * _PIECES * slabs)
        split = _core.partitions.split_tets(T, len(pieces.points), places, ladder.period)
        self.origin = np.concatenate([untouched, touched[split.parent]])
        self._T = np.concatenate([pieces.T[untouched], split.tets])
        labels = split.slab if ladder.heights.pair is None else (split.slab - 1) % ladder.period
        self.labels = np.concatenate([np.full(len(untouched), -1), labels])
        self.labels[~chosen[self.origin]] = -1
        self._edges, self._levels = split.cut_edges, split.cut_level
        self._ends = [self._away(self._edges[:, k], self._levels) for k in (0, 1)]
        self._rises = ladder.heights.rise(self._edges[:, 0], self._edges[:, 1]) > 0.0
        for end, sign in zip(self._edges.T, (-1.0, 1.0), strict=True):
            by = detours.level[end] == self._levels
            self._rises[by] = sign * detours.values[end[by]] > 0.0

    def shares(self, tilts: Reals) -> Reals:
        """Where the cut points lie on their edges, 0 at the lower id."""
        scale = np.exp(tilts)[self._levels]
        first = self._ends[0] * np.where(self._rises, 1.0, scale)
        second = self._ends[1] * np.where(self._rises, scale, 1.0)
        return np.asarray(first / (first + second))

    def pieces(self, tilts: Reals) -> Pieces:
        """All tets, those that were not cut first."""
        before = self._before
        first, second = (before.points[self._edges[:, k]] for k in (0, 1))
        added = first + self.shares(tilts)[:, None] * (second - first)
        points = np.concatenate([before.points, added])
        return Pieces(points, self._T, before.parent[self.origin], before.center)

    def tilts(self, asked: Reals) -> tuple[Reals, Reals, NDArray[np.bool_]]:
        """Tilt of each level that gives the parts their volumes.

        Parameters
        ----------
        asked : ndarray, shape (p,)
            Chosen volume of each part.

        Returns
        -------
        tilts : ndarray, shape (levels,)
        missing : ndarray, shape (levels,)
            Volume below each level that no tilt makes up for, 0 elsewhere.
        crowded : ndarray of bool, shape (levels,)
            Levels that come too close to others.
        """
        count = len(self._ladder.levels)
        tilts, left, slopes = np.zeros(count), np.zeros(count), np.full(count, -np.inf)
        first = count - len(asked) + 1

        def set_tilt(level: int, missing: float) -> None:
            moved = self._moved(level)
            ends = moved(-_TILT) - missing, moved(_TILT) - missing
            if not ends[0] >= 0.0 >= ends[1]:
                left[level] = missing
            elif ends[0] > ends[1]:
                slopes[level] = (ends[1] - ends[0]) / (2.0 * _TILT)
                tilts[level] = brentq(
                    lambda tilt: moved(tilt) - missing, -_TILT, _TILT, xtol=1e-15, rtol=1e-15
                )

        if first:  # where the first part begins, as much before it as there was, if that can be
            set_tilt(0, self._drawn(0))
            left[0] = 0.0
        for level, missing in enumerate(self._missing(tilts, asked), first):
            set_tilt(level, float(missing))
        if not left.any():
            tilts = self._polished(tilts, slopes, asked)
        return tilts, left, self._crowded(tilts)

    def _polished(self, tilts: Reals, slopes: Reals, asked: Reals) -> Reals:
        """Tilts that agree with the tets as they are, whose rounding is more in thin parts."""
        first = len(tilts) - len(asked) + 1
        best, least = tilts, np.inf
        for _ in range(_POLISH):
            missing = self._missing(tilts, asked)
            worst = np.abs(np.diff(missing, prepend=0.0, append=0.0) / asked).max()
            if worst < least:
                best, least = tilts, worst
            if least < _EXACT:
                break
            tilts = tilts.copy()
            tilts[first:] += missing / slopes[first:]
        return best

    def _missing(self, tilts: Reals, asked: Reals) -> Reals:
        """Chosen volume that the parts below each level between two of them lack together.

        Summed up is what each lacks and not how large it is, and what all of them lack, which no
        level makes up for, is divided among them: else the last has the rounding of the whole, more
        than it may be of one part of hundreds.
        """
        inside = self.labels >= 0
        volumes = self.pieces(tilts).only(inside).volumes("source")
        lacking = asked - volumes_of_parts(self.labels[inside], volumes, len(asked))
        return np.cumsum(lacking - asked * (lacking.sum() / asked.sum()))[:-1]

    def _moved(self, level: int) -> Callable[[float], float]:
        """How much the chosen volume below a level grows by a tilt."""
        period, place = 2 * self._ladder.period, 2 * level + 1
        there = self._low + 1 + (place - self._low - 1) % period
        cut = np.flatnonzero(there < self._high)
        values, volumes = self.signed(cut, level, there[cut]), self.volumes[cut]

        def below(tilt: float) -> float:
            return _below_zero(np.where(values > 0.0, values * np.exp(tilt), values), volumes)

        flat = below(0.0)
        return lambda tilt: below(tilt) - flat

    def _drawn(self, level: int) -> float:
        """Chosen volume that is no longer below a level since it goes through vertices."""
        heights, at = self._ladder.heights, float(self._ladder.levels[level])
        corners = heights.corners(self.own.T) - at
        low = np.ceil(np.nanmin(corners, axis=1) / TWO_PI)
        cut = np.flatnonzero(low * TWO_PI < np.nanmax(corners, axis=1))
        place = 2 * level + 1 + 2 * self._ladder.period * low[cut].astype(np.intp)
        exact, volumes = heights.above(self.own.T[cut], at), self.volumes[cut]
        return _below_zero(exact, volumes) - _below_zero(self.signed(cut, level, place), volumes)

    def signed(self, tets: NDArray[np.intp], level: int, place: NDArray[np.integer]) -> Reals:
        """(k, 4) values, at corners of chosen tets, of the function that vanishes on a level."""
        corners = self.corners[tets]
        values = self._away(self.own.T[tets], level)
        values = np.where(corners > place[:, None], values, -values)
        on = (corners == place[:, None]) | (corners == _core.partitions.EVERYWHERE)
        return np.where(on, 0.0, values)

    def _away(self, vertices: Ids, levels: Ids | int) -> Reals:
        """How far vertices are from levels, none of which goes through them."""
        away = np.abs(self._ladder.heights.above(vertices, self._ladder.levels[levels]))
        by = self._detours.level[vertices] == levels
        return np.where(by, np.abs(self._detours.values[vertices]), away)

    def _crowded(self, tilts: Reals) -> NDArray[np.bool_]:
        """Levels that move to less than half their distance from another on some edge."""
        before, after = self.shares(np.zeros(len(tilts))), self.shares(tilts)
        order = np.lexsort((before, self._edges[:, 1], self._edges[:, 0]))
        edges = self._edges[order]
        same = (edges[1:] == edges[:-1]).all(axis=1)
        near = same & (np.diff(after[order]) < 0.5 * np.diff(before[order]))
        crowded = np.zeros(len(tilts), bool)
        for side in (order[:-1][near], order[1:][near]):
            crowded[self._levels[side]] = True
        return crowded


def _below_zero(values: Reals, volumes: Reals) -> float:
    """Volume where values at the corners of tets, (k, 4), are negative."""
    T = np.arange(values.size, dtype=np.int32).reshape(-1, 4)
    return _core.partitions.volume_below(T, volumes, values.ravel())
