"""Cutting tets along level surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.torus import TWO_PI, Torus
from ..mesh.meshes import TetMesh

if TYPE_CHECKING:
    pass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass

_NO_GATE = np.zeros(0)


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
        return _core.tet_volumes(np.ascontiguousarray(self.points[:, columns]), self.T)

    def cut(self, values: NDArray[np.float64], gate: NDArray[np.float64] = _NO_GATE) -> Pieces:
        split = _core.split_tets(self.T, np.ascontiguousarray(values), np.ascontiguousarray(gate))
        first, second = (self.points[split.cut_edges[:, k]] for k in (0, 1))
        added = first + split.cut_weight[:, None] * (second - first)
        return Pieces(
            points=np.concatenate([self.points, added]),
            T=split.tets,
            parent=self.parent[split.parent],
            side=split.side,
        )

    def sheet(self, axis: str, angle: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Function that vanishes on the sheet at an angle and on its continuation, and its gate."""
        a, b = self.points[:, [3, 4] if axis == "u" else [6, 5]].T
        c, s = math.cos(angle), math.sin(angle)
        return b * c - a * s, a * c + b * s


def cut_all(
    pieces: Pieces, axes: tuple[str, ...], levels: list[NDArray[np.float64]]
) -> tuple[Pieces, NDArray[np.int32]]:
    """Cut along every level; the pieces and the part of each."""
    for axis, cuts in zip(axes, levels, strict=True):
        for level in cuts:
            if axis == "s":
                pieces = pieces.cut(pieces.points[:, 7] - level)
            else:
                sheet, gate = pieces.sheet(axis, level)
                pieces = pieces.cut(sheet, gate if axis == "u" else _NO_GATE)
    # Every function is linear on a piece and has one sign in it, so its centroid tells the part.
    centre = 0.25 * sum(pieces.points[corner] for corner in pieces.T.T)
    labels = np.zeros(len(pieces.T), np.intp)
    for axis, cuts in zip(axes, levels, strict=True):
        if axis == "s":
            labels = labels * (len(cuts) + 1) + np.searchsorted(cuts, centre[:, 7])
            continue
        a, b = centre[:, [3, 4] if axis == "u" else [6, 5]].T
        turned = (np.arctan2(b, a) - cuts[0]) % TWO_PI
        labels = labels * len(cuts) + np.searchsorted(cuts[1:] - cuts[0], turned)
    return pieces, labels.astype(np.int32)


def part_volumes(
    pieces: Pieces, labels: NDArray[np.int32], shares: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    count = math.prod(len(share) for share in shares)
    return np.bincount(labels, pieces.volumes("source"), minlength=count)
