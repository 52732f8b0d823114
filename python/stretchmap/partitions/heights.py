"""Where the vertices of tets lie between levels of a coordinate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.torus import TWO_PI
from ..mesh.split_edges import TET_EDGES

# A vertex this close to a level, in radians or as a share of all values, is on it.
_ROUNDING = 1e-12
# Vertices farther from a level than this share of the way to the next are left where they are, so
# that no part is drawn in to nothing.
_OF_SLAB = 0.25

CORE = [6, 8]  # columns of the points of `Pieces` whose angle v is
TET_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])

Reals = NDArray[np.float64]
Ids = NDArray[np.int32]


@dataclass(frozen=True)
class Heights:
    """A coordinate at all vertices.

    Attributes
    ----------
    values : ndarray, shape (n,)
        ``(s / r)^2``, or an angle from 0 to a whole turn.
    pair : ndarray, shape (2, n), or None
        Cosine and sine of the angle, each times a length; zero on the axis, where it is none.
    """

    values: Reals
    pair: Reals | None

    @classmethod
    def of(cls, points: Reals, axis: str, start: float) -> Heights:
        """Of the points of `Pieces`; angles are counted from ``start``."""
        if axis == "s":
            return cls(points[:, 7], None)
        a, b = points[:, [3, 4] if axis == "u" else CORE].T
        c, s = np.cos(start), np.sin(start)
        pair = np.stack([a * c + b * s, b * c - a * s])
        # Once more, since the rest of a tiny negative angle is rounded to a whole turn.
        return cls(np.arctan2(pair[1], pair[0]) % TWO_PI % TWO_PI, pair)

    @property
    def nowhere(self) -> NDArray[np.bool_]:
        """Vertices on the axis of an angle."""
        if self.pair is None:
            return np.zeros(len(self.values), bool)
        return np.asarray((self.pair == 0.0).all(axis=0))

    def rise(self, first: Ids, second: Ids) -> Reals:
        """How much higher the second ends of edges are, angles the short way round."""
        if self.pair is None:
            return np.asarray(self.values[second] - self.values[first])
        # From the lower id to the higher, so that all tets around an edge agree.
        (a, b), (c, d) = (
            self.pair[:, v] for v in (np.minimum(first, second), np.maximum(first, second))
        )
        turn = np.arctan2(a * d - b * c, a * c + b * d)
        return np.asarray(np.where(first < second, turn, -turn))

    def corners(self, T: Ids) -> Reals:
        """(k, 4) heights at the corners of each tet, without a jump; NaN where there is none."""
        nowhere = self.nowhere[T]
        first = T[np.arange(len(T)), np.argmin(nowhere, axis=1)][:, None]
        heights = self.values[first] + self.rise(np.broadcast_to(first, T.shape), T)
        return np.where(nowhere, np.nan, heights)

    def above(self, vertices: Ids, level: Reals | float) -> Reals:
        """A function linear on every tet that vanishes on a level and grows with the height."""
        if self.pair is None:
            return np.asarray(self.values[vertices] - level)
        a, b = self.pair[:, vertices]
        return np.asarray(b * np.cos(level) - a * np.sin(level))

    def turns(self, T: Ids) -> NDArray[np.intp]:
        """(k, 4) how often the angle goes round on the boundary of the face opposite a corner."""
        faces = T[:, TET_FACES]
        around = sum(self.rise(faces[..., i], faces[..., (i + 1) % 3]) for i in range(3))
        return np.where(self.nowhere[faces].any(axis=2), 0, np.rint(around / TWO_PI)).astype(
            np.intp
        )


@dataclass(frozen=True)
class Detours:
    """Vertices near a level that it passes by.

    Attributes
    ----------
    level : ndarray of int32, shape (n,)
        That level, -1 of other vertices.
    values : ndarray, shape (n,)
        Of the function that vanishes on it; negative where the vertex is below.
    """

    level: Ids
    values: Reals

    @classmethod
    def none(cls, count: int) -> Detours:
        return cls(np.full(count, -1, np.int32), np.zeros(count))


@dataclass(frozen=True)
class Ladder:
    """Ascending levels of heights, those of angles once more after every turn."""

    heights: Heights
    levels: Reals

    @property
    def period(self) -> int:
        """Number of levels after which they are the same again; more than all for ``s``."""
        return len(self.levels) + (2 if self.heights.pair is None else 0)

    def at(self, i: NDArray[np.intp]) -> Reals:
        """Heights of levels; of s the lowest and the highest value are those before and after."""
        n, values = len(self.levels), self.heights.values
        if self.heights.pair is None:
            ends = np.concatenate([[values.min()], self.levels, [values.max()]]).astype(float)
            return np.asarray(ends[np.clip(i, -1, n) + 1])
        return self.levels[i % n] + TWO_PI * (i // n)

    def places(self, T: Ids, inner: NDArray[np.bool_], snap: Reals, detours: Detours) -> Ids:
        """Places of the corners of tets, (k, 4), as `split_tets` takes them.

        A level that passes an inner vertex within a share ``snap`` of an edge's length goes through
        it. Other vertices are everywhere.
        """
        heights, n = self.heights, len(self.levels)
        slab = np.searchsorted(self.levels, heights.values, side="right")
        place, values = 2 * slab, heights.values.copy()
        scale = 1.0 if heights.pair is not None else float(values.max())
        for level in (slab - 1, slab):
            there = self._is_level(level)
            on = there & (np.abs(self.at(level) - values) <= _ROUNDING * scale)
            place[on] = 2 * level[on] + 1
        vertex, level = self._snapped(T, inner & ~heights.nowhere, place, snap)
        place[vertex] = 2 * level + 1
        on = place % 2 == 1
        if heights.pair is not None:
            place[on] = 2 * ((place[on] // 2) % n) + 1
        values[on] = self.at(place[on] // 2)
        by = on & (detours.level == place // 2)
        place[by] += np.where(detours.values[by] < 0.0, -1, 1)
        corners = place[T]
        if heights.pair is not None:
            around = np.rint((heights.corners(T) - values[T]) / TWO_PI)
            corners = corners + 2 * n * np.nan_to_num(around).astype(np.intp)
        nowhere = ~inner | heights.nowhere
        corners = np.where(nowhere[T], _core.partitions.EVERYWHERE, corners)
        return np.ascontiguousarray(corners, np.int32)

    def _is_level(self, i: NDArray[np.intp]) -> NDArray[np.bool_]:
        if self.heights.pair is not None:
            return np.ones(len(i), bool)
        return (i >= 0) & (i < len(self.levels))

    def _snapped(
        self, T: Ids, inner: NDArray[np.bool_], place: NDArray[np.intp], snap: Reals
    ) -> tuple[Ids, NDArray[np.intp]]:
        """Vertices between levels that one passes by closely, and the nearest of these."""
        heights = self.heights
        edges = T[:, TET_EDGES].reshape(-1, 2)
        a, b = edges[inner[edges].all(axis=1)].T
        apart = place[a] != place[b]
        if heights.pair is not None:  # the short way round may lead through all levels
            apart |= np.abs(heights.values[a] - heights.values[b]) > np.pi
        a, b = a[apart], b[apart]
        rise = heights.rise(a, b)
        up = rise >= 0.0
        low, high, rise = np.where(up, a, b), np.where(up, b, a), np.abs(rise)
        found = []
        for near, far, step, sign in ((low, high, 0, 1.0), (high, low, -1, -1.0)):
            slab = place[near] // 2
            level, height = slab + step, heights.values[near]
            away = sign * (self.at(level) - height)
            free = (place[near] % 2 == 0) & self._is_level(level)
            crossed = free & (away < rise)
            crossed &= away <= _OF_SLAB * (self.at(slab) - self.at(slab - 1))
            near, far, level = near[crossed], far[crossed], level[crossed]
            cut = self.at(level)
            first, second = (np.abs(heights.above(v, cut)) for v in (near, far))
            level = level % self.period
            close = first < snap[level] * (first + second)
            found.append((near[close], level[close], (first / (first + second))[close]))
        vertex, level, share = (np.concatenate(columns) for columns in zip(*found, strict=True))
        order = np.lexsort((share, vertex))
        vertex, kept = np.unique(vertex[order], return_index=True)
        return vertex, level[order][kept]
