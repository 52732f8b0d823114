"""Cutting tets along level surfaces."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.options import memory
from ..base.torus import TWO_PI, Torus
from ..mesh.meshes import TetMesh

_NO_GATE = np.zeros(0)
# Bytes for each piece while the next level is cut, most of which leave it alone.
_BYTES_PER_PIECE = 600


@dataclass(frozen=True)
class Pieces:
    """A tet mesh being cut. Columns of ``points``: source, image, hypot(x, y) - R, (s / r)^2."""

    points: NDArray[np.float64]
    T: NDArray[np.int32]
    parent: NDArray[np.int32]
    side: NDArray[np.int32]  # (k,) of the last cut

    @classmethod
    def of(cls, mesh: TetMesh, image: NDArray[np.float64], torus: Torus) -> Pieces:
        radial = np.hypot(image[:, 0], image[:, 1]) - torus.R
        share = (radial**2 + image[:, 2] ** 2) / torus.r**2
        k = len(mesh.T)
        return cls(
            points=np.column_stack([mesh.V, image, radial, share]),
            T=mesh.T,
            parent=np.arange(k, dtype=np.int32),
            side=np.zeros(k, np.int32),
        )

    def volumes(self, of: str) -> NDArray[np.float64]:
        columns = slice(0, 3) if of == "source" else slice(3, 6)
        return _core.mesh.tet_volumes(np.ascontiguousarray(self.points[:, columns]), self.T)

    def only(self, chosen: NDArray[np.bool_]) -> Pieces:
        """The chosen tets, with the same points."""
        T = np.ascontiguousarray(self.T[chosen])
        return Pieces(self.points, T, self.parent[chosen], self.side[chosen])

    def cut(self, axis: str, level: float, *, gated: bool = True) -> Pieces:
        """All tets cut along one level of a coordinate, ungated its continuation as well."""
        values, gate = self.level_function(axis, level)
        return self._split(self.T, values, gate if gated else _NO_GATE)[0]

    def cut_within(
        self, chosen: NDArray[np.bool_], axis: str, level: float
    ) -> tuple[Pieces, NDArray[np.intp]]:
        """The chosen tets cut along a level, and the others only where they have to follow.

        At vertices of no chosen tet the function is taken to vanish, so that another tet is cut at
        edges between two vertices of chosen ones and nowhere else: neighbours agree on every edge.

        Returns
        -------
        Pieces
        ndarray, shape (k',)
            The tet here that each tet there was cut from.
        """
        values, gate = self.level_function(axis, level)
        inner = np.zeros(len(values), bool)
        inner[self.T[chosen]] = True
        values = np.where(inner, values, 0.0)
        touched = np.flatnonzero(inner[self.T].sum(axis=1) > 1)
        untouched = np.setdiff1d(np.arange(len(self.T)), touched, assume_unique=True)
        split, parent = self._split(np.ascontiguousarray(self.T[touched]), values, gate)
        origin = np.concatenate([untouched, touched[parent]])
        return Pieces(
            points=split.points,
            T=np.concatenate([self.T[untouched], split.T]),
            parent=self.parent[origin],
            side=np.concatenate([self.side[untouched], split.side]),
        ), origin

    def _split(
        self, T: NDArray[np.int32], values: NDArray[np.float64], gate: NDArray[np.float64]
    ) -> tuple[Pieces, NDArray[np.int32]]:
        memory("so many parts of pieces this small", _BYTES_PER_PIECE * len(self.T))
        split = _core.partitions.split_tets(
            T, np.ascontiguousarray(values), np.ascontiguousarray(gate)
        )
        first, second = (self.points[split.cut_edges[:, k]] for k in (0, 1))
        added = first + split.cut_weight[:, None] * (second - first)
        return Pieces(
            points=np.concatenate([self.points, added]),
            T=split.tets,
            parent=self.parent[split.parent],
            side=split.side,
        ), split.parent

    def level_function(
        self, axis: str, level: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Function that vanishes on a level, and the gate that is positive where to cut.

        For angles it vanishes on the continuation of the sheet, too: that of ``u`` lies across the
        hole and is gated off, that of ``v`` is cut, since all sheets meet in the core.
        """
        if axis == "s":
            return self.points[:, 7] - level, _NO_GATE
        a, b = self.angle_pair(axis)
        c, s = math.cos(level), math.sin(level)
        return b * c - a * s, a * c + b * s if axis == "u" else _NO_GATE

    def angle_pair(self, axis: str) -> NDArray[np.float64]:
        """Cosine and sine of ``u`` or ``v``, each times a length, (2, n)."""
        return self.points[:, [3, 4] if axis == "u" else [6, 5]].T

    def parts_along(self, axis: str, cuts: NDArray[np.float64]) -> NDArray[np.intp]:
        """Part of each tet between levels along which all are cut already."""
        # The function is linear on a piece and has one sign in it, so its centroid tells the part.
        if axis == "s":
            places = np.searchsorted(cuts, self.points[self.T, 7].mean(axis=1))
        else:
            a, b = (values[self.T].mean(axis=1) for values in self.angle_pair(axis))
            turned = (np.arctan2(b, a) - cuts[0]) % TWO_PI
            places = np.searchsorted(cuts[1:] - cuts[0], turned)
        return np.asarray(places, np.intp)


def middle_first(levels: NDArray[np.float64]) -> Iterator[float]:
    """Ascending levels in an order in which each cuts what few before it have cut.

    One after the other, every level cuts all the pieces that those before it have left of the rest
    of a tet, and their number grows with its cube.
    """
    if not len(levels):
        return
    middle = len(levels) // 2
    yield float(levels[middle])
    yield from middle_first(levels[:middle])
    yield from middle_first(levels[middle + 1 :])


def cut_all(
    pieces: Pieces, axes: tuple[str, ...], levels: list[NDArray[np.float64]]
) -> tuple[Pieces, NDArray[np.int32]]:
    """Cut the whole along every level; the pieces and the part of each."""
    for axis, cuts in zip(axes, levels, strict=True):
        for level in middle_first(cuts):
            pieces = pieces.cut(axis, level)
    labels = np.zeros(len(pieces.T), np.intp)
    for axis, cuts in zip(axes, levels, strict=True):
        labels = labels * (len(cuts) + (axis == "s")) + pieces.parts_along(axis, cuts)
    return pieces, labels.astype(np.int32)


def part_volumes(
    pieces: Pieces, labels: NDArray[np.int32], shares: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Volume of every part in the source, (product of the numbers of shares,)."""
    count = math.prod(len(share) for share in shares)
    return np.bincount(labels, pieces.volumes("source"), minlength=count).astype(float)
