"""Solid-torus coordinates (7.1) of a mapped solid, and the map and its inverse at any point.

A map is affine on every tet. A point is sent to its image by finding the source tet it lies in, and
back by finding the image tet; both directions use the barycentric coordinates there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_indices, as_points, as_reals
from ..base.options import real
from ..errors import ArrayError, KindError
from ..mesh.meshes import TetMesh, TriMesh

__all__ = ["Located", "PointMap"]


@dataclass(frozen=True, eq=False)
class Located:
    """Points carried through a map.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Where each point goes; NaN for a point outside the mesh, nothing is guessed.
    inside : ndarray of bool, shape (n,)
    tets : ndarray of int32, shape (n,)
        The tet each point was found in, -1 outside.
    weights : ndarray, shape (n, 4)
        Barycentric coordinates there, summing to one; NaN outside.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> found = sm.volume_map(solid).point_map.forward([[3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    >>> found.inside.tolist(), found.points.shape
    ([True, False], (2, 3))
    """

    points: NDArray[np.float64]
    inside: NDArray[np.bool_]
    tets: NDArray[np.int32]
    weights: NDArray[np.float64]

    def interpolate(self, T: NDArray[np.int32], values: ArrayLike) -> NDArray[np.float64]:
        """Values at the points from values at the vertices of the mesh.

        Parameters
        ----------
        T : array_like of int, shape (k, 4)
            Tets of the mesh the points were found in: the source of `PointMap.forward` and
            `PointMap.inverse` alike.
        values : array_like, shape (m,) or (m, c)
            One row per vertex.

        Returns
        -------
        ndarray, shape (n,) or (n, c)
            NaN outside.

        Raises
        ------
        ArrayError, IndexRangeError, NonFiniteError
            No such arrays, or too few tets for the points that were found in them.
        """
        reals = as_reals(values, "values", (None,), (None, None))
        tets = as_indices(T, 4, len(reals), "T")
        if self.tets.max(initial=-1) >= len(tets):
            raise ArrayError(
                f"the points were found in a mesh of more than {len(tets)} tets; T is another's"
            )
        return _interpolate(reals, tets, self.tets, self.weights)


class ImageOfMesh(Protocol):
    """What a `PointMap` needs of a map."""

    @property
    def mesh(self) -> TriMesh | TetMesh: ...
    @property
    def image(self) -> NDArray[np.float64]: ...


class PointMap:
    """A map of a solid as a function of points, in both directions.

    The search structures are built on first use and kept.

    Parameters
    ----------
    result : VolumeMap, Registration, LoadedMap or any map result of a solid
        Its own ``point_map`` has the default tolerance.
    tolerance : float
        A point of the boundary counts as inside if it lies no farther than this outside, as a share
        of the diagonal of the bounding box. Its image is extrapolated from the nearest tet at hand,
        so that there and back is the identity for it, too.

    Raises
    ------
    KindError
        If it is no map, or that of a surface.
    NonFiniteError
        If the image has NaN or infinite coordinates.
    OptionError
        If the tolerance is negative or not finite.

    Notes
    -----
    The image of a curved boundary is a polyhedron: a point of the torus between its vertices lies
    outside it by the height of the chord, far more than the tolerance.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> points = sm.PointMap(sm.volume_map(solid))
    >>> centers = solid.V[solid.T].mean(axis=1)
    >>> there = points.forward(centers).points
    >>> bool(np.allclose(points.inverse(there).points, centers))
    True
    """

    def __init__(self, result: ImageOfMesh, tolerance: float = 1e-9) -> None:
        mesh = getattr(result, "mesh", None)
        if not isinstance(mesh, TetMesh):
            what = "the map of a surface" if isinstance(mesh, TriMesh) else type(result).__name__
            raise KindError(f"points are carried by maps of solids; this is {what}")
        self._T = mesh.T
        self._ends = (mesh.V, as_points(result.image, "image"))
        self._tolerance = real("tolerance", tolerance, 0.0)
        self._locators: list[_core.maps.TetLocator | None] = [None, None]

    def __getstate__(self) -> dict[str, Any]:
        """Without the search structures, which are built anew where they are needed."""
        return {**self.__dict__, "_locators": [None, None]}

    def forward(self, points: ArrayLike) -> Located:
        """Carry points of the source to the image.

        Parameters
        ----------
        points : array_like, shape (n, 3)

        Returns
        -------
        Located

        Raises
        ------
        ArrayError
            If ``points`` does not have that shape.
        NonFiniteError
            If a coordinate is NaN or infinite.
        """
        return self._carry(points, 0)

    def inverse(self, points: ArrayLike) -> Located:
        """Carry points of the image to the source; as `forward`."""
        return self._carry(points, 1)

    def _carry(self, points: ArrayLike, start: int) -> Located:
        queries = as_points(points, "points", or_none=True)
        locator = self._locators[start]
        if locator is None:
            V = self._ends[start]
            diagonal = float(np.linalg.norm(np.ptp(V, axis=0)))
            locator = _core.maps.TetLocator(V, self._T, self._tolerance * diagonal)
            self._locators[start] = locator
        tets, weights = locator.locate(queries)
        return Located(
            points=_interpolate(self._ends[1 - start], self._T, tets, weights),
            inside=tets >= 0,
            tets=tets,
            weights=weights,
        )


def _interpolate(
    values: NDArray[np.float64],
    T: NDArray[np.int32],
    tets: NDArray[np.int32],
    weights: NDArray[np.float64],
) -> NDArray[np.float64]:
    """A point outside has tet -1, any tet's corners, and weights NaN."""
    corners = T[tets]
    out = sum(
        weights[:, k].reshape((-1,) + (1,) * (values.ndim - 1)) * values[corners[:, k]]
        for k in range(4)
    )
    return np.asarray(out)
