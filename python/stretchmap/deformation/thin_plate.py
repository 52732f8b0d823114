"""Smooth deformations of a template: thin-plate splines in space, with few coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

__all__ = ["ThinPlate"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ThinPlate:
    """Displacements ``u(x) = a + B x + sum_i w_i |x - z_i|``, the w_i orthogonal to affine maps.

    Of all fields with the same values at the sites z they have the least ``int |D^2 u|^2`` over
    space (Duchon 1977; in three dimensions the kernel is the distance itself). Affine maps cost
    nothing; no length enters.

    Attributes
    ----------
    center, length
        Of the coordinates all is computed in: those of the template over its size.
    sites : ndarray, shape (m, 3)
    projector : ndarray, shape (m, m)
        Takes out of weights what is not orthogonal to affine maps.
    bending : ndarray, shape (m + 4, m + 4)
        Energy of coefficients, the first four those of the affine map.
    """

    center: Array
    length: float
    sites: Array
    projector: Array
    bending: Array

    @classmethod
    def of(cls, points: Array, n_sites: int) -> ThinPlate:
        """Sites spread evenly over points (n, 3): each the farthest from those before."""
        center = points.mean(axis=0)
        length = float(np.linalg.norm(np.ptp(points, axis=0)))
        scaled = (points - center) / length
        sites = scaled[_far_apart(scaled, min(n_sites, len(points)))]
        affine = np.column_stack([np.ones(len(sites)), sites])
        basis = np.zeros((0, len(sites)))
        for column in affine.T:  # by hand, since the bits of LAPACK depend on the threads of BLAS
            for _ in range(2):
                column = column - np.einsum("bm,b->m", basis, np.einsum("bm,m->b", basis, column))
            basis = np.vstack([basis, column / np.sqrt(np.einsum("m,m->", column, column))])
        outer = np.einsum("bi,bj->ij", basis, basis)
        projector = np.eye(len(sites)) - outer
        bending = np.zeros((len(sites) + 4, len(sites) + 4))
        bending[4:, 4:] = projector @ -cdist(sites, sites) @ projector + outer
        return cls(center, length, sites, projector, bending)

    def features(self, points: Array) -> Array:
        """(n, m + 4) What the coefficients (m + 4, 3) are multiplied by to give displacements."""
        scaled = (points - self.center) / self.length
        kernel = -cdist(scaled, self.sites) @ self.projector
        return np.column_stack([np.ones(len(scaled)), scaled, kernel])


def _far_apart(points: Array, count: int) -> NDArray[np.intp]:
    """Ids of points each of which is the farthest from those before."""
    chosen = [int(np.argmax(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
    nearest = np.full(len(points), np.inf)
    while len(chosen) < count:
        nearest = np.minimum(nearest, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(np.argmax(nearest)))
    return np.array(chosen)
