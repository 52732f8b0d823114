"""A map as a function of points, and the coordinates it brings to them."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import read_only
from ..base.torus import Torus
from ..errors import KindError, OptionError
from ..mesh.meshes import TetMesh, TriMesh
from .frames import CoordinateField, coordinate_field, without_jump
from .points import PointMap

__all__ = ["CarriesPoints"]


class CarriesPoints:
    """What every map does with points."""

    if TYPE_CHECKING:

        @property
        def mesh(self) -> TriMesh | TetMesh: ...
        @property
        def image(self) -> NDArray[np.float64]: ...
        @property
        def torus(self) -> Torus | None: ...

    @cached_property
    def point_map(self) -> PointMap:
        """The map as a function of points, which also says what lies outside and in which tet."""
        return PointMap(self)

    def forward(self, points: ArrayLike) -> NDArray[np.float64]:
        """Carry points of the source solid through the map.

        Parameters
        ----------
        points : array_like, shape (n, 3)

        Returns
        -------
        ndarray, shape (n, 3)
            NaN for points outside the source; ``point_map.forward`` says more.

        Raises
        ------
        KindError
            If the map is that of a surface.
        ArrayError
            If ``points`` does not have that shape.
        NonFiniteError
            If a coordinate is NaN or infinite.
        """
        return self.point_map.forward(points).points

    def inverse(self, points: ArrayLike) -> NDArray[np.float64]:
        """Carry points of the image back to the source solid; as `forward`."""
        return self.point_map.inverse(points).points

    def coordinates(self, points: ArrayLike | None = None) -> NDArray[np.float64]:
        """Solid-torus coordinates (u, v, s) of (7.1).

        Parameters
        ----------
        points : array_like, shape (n, 3), optional
            Points of the source; its vertices if left out.

        Returns
        -------
        ndarray, shape (n, 3)
            Angles u, v in [0, 2 pi) and the distance s from the centre circle; NaN outside.

        Raises
        ------
        OptionError
            If the map has no torus.
        ArrayError, NonFiniteError
            As `forward`.
        """
        torus = self._torus()
        image = self.image if points is None else self.forward(points)
        return read_only(np.stack(torus.coordinates(image), axis=-1))

    def coordinate_field(self, points: ArrayLike | None = None) -> CoordinateField:
        """Coordinates (7.1) with gradients and orthonormal frames: for fibers, laminates, grading.

        Parameters
        ----------
        points : array_like, shape (n, 3), optional
            Points of the source; the centers of its tets if left out, where gradients and frames
            are those of the tets.

        Returns
        -------
        CoordinateField
            NaN outside.

        Raises
        ------
        OptionError
            If the map has no torus.
        KindError
            If the map is that of a surface.
        ArrayError, NonFiniteError
            As `forward`.

        Examples
        --------
        >>> import stretchmap as sm
        >>> result = sm.volume_map(sm.samples.solid_torus(600))
        >>> result.coordinate_field().frames.shape[0] == result.mesh.n_tets
        True
        >>> result.coordinate_field([[3.0, 0.0, 0.1]]).gradients.shape
        (1, 3, 3)
        """
        torus, mesh = self._torus(), self._solid()
        if points is None:
            return coordinate_field(mesh, self.image, torus)
        found = self.point_map.forward(points)
        return coordinate_field(mesh, self.image, torus, found.tets, found.weights)

    def corner_angles(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """u and v at the corners of every tet without the jump at the seam, where they start anew.

        Returns
        -------
        angles : ndarray, shape (k, 4, 2)
            Each tet in one piece: the first corner's in [0, 2 pi), the others' next to it. Tets
            cut by a seam are those where this is not ``coordinates()[T]``.
        single : ndarray of bool, shape (k, 2)
            False where the corners do not fit into half a turn, as those of v in the tets round
            the core, where v has no continuous values.

        Raises
        ------
        OptionError
            If the map has no torus.
        KindError
            If the map is that of a surface.
        """
        u, v, _ = self._torus().coordinates(self.image)
        pairs = [without_jump(angle, self._solid().T) for angle in (u, v)]
        values, single = (np.stack(arrays, axis=-1) for arrays in zip(*pairs, strict=True))
        return read_only(values), read_only(single)

    def _torus(self) -> Torus:
        if self.torus is None:
            raise OptionError("the map has no torus, so there are no coordinates on it")
        return self.torus

    def _solid(self) -> TetMesh:
        if not isinstance(self.mesh, TetMesh):
            raise KindError("gradients are those of the map of a solid, this is that of a surface")
        return self.mesh
