"""Tets being cut, with their place in source and image."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.torus import Torus
from ..mesh.meshes import TetMesh


@dataclass(frozen=True)
class Pieces:
    """A tet mesh being cut. Columns of ``points``: source, image, hypot(x, y) - R, (s / r)^2, z.

    The last of the image once more, since v is the angle of a function that is made to vanish at
    the vertices of the core. The points of the source are those less ``center``, so that nothing is
    lost far from the origin.
    """

    points: NDArray[np.float64]
    T: NDArray[np.int32]
    parent: NDArray[np.int32]
    center: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: TetMesh, image: NDArray[np.float64], torus: Torus) -> Pieces:
        radial = np.hypot(image[:, 0], image[:, 1]) - torus.R
        share = (radial**2 + image[:, 2] ** 2) / torus.r**2
        center = mesh.V.mean(axis=0)
        return cls(
            points=np.column_stack([mesh.V - center, image, radial, share, image[:, 2]]),
            T=mesh.T,
            parent=np.arange(len(mesh.T), dtype=np.int32),
            center=center,
        )

    def volumes(self, of: str) -> NDArray[np.float64]:
        columns = slice(0, 3) if of == "source" else slice(3, 6)
        return _core.mesh.tet_volumes(np.ascontiguousarray(self.points[:, columns]), self.T)

    def only(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> Pieces:
        """The chosen tets, with the same points."""
        T = np.ascontiguousarray(self.T[chosen])
        return Pieces(self.points, T, self.parent[chosen], self.center)

    def compact(self) -> Pieces:
        """The same tets, without points that none of them has."""
        used = np.zeros(len(self.points), bool)
        used[self.T] = True
        place = (np.cumsum(used) - 1).astype(np.int32)
        return Pieces(self.points[used], place[self.T], self.parent, self.center)


def volumes_of_parts(
    labels: NDArray[np.integer], volumes: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Volume of each part. Thin ones are what large ones leave, so these are summed in pairs."""
    order = np.argsort(labels, kind="stable")
    ends = np.searchsorted(labels[order], np.arange(count + 1))
    sorted_ = volumes[order]
    return np.array([sorted_[a:b].sum() for a, b in itertools.pairwise(ends)])
