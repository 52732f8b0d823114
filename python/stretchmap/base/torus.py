"""The standard torus and solid torus (7.1) every map lands on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArrayError, NonFiniteError, OptionError
from .arrays import as_reals
from .options import real

__all__ = ["Torus"]

TWO_PI = 2.0 * math.pi
MOST_ANGLE = 1e3  # given, in radians or turns; far beyond, rounding would show
# R / r of maps: beyond three times that coordinates are rounded by more than the 1e-9 r by which
# `certify` lets points be off the torus.
MOST_RATIO = 1e6


def wrapped(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """The shortest way on a circle or flat torus that ends where so many turns do."""
    return turns - np.round(turns)


@dataclass(frozen=True)
class Torus:
    """The torus of revolution about the z-axis, and the solid torus it bounds.

    Attributes
    ----------
    R : float
        Distance from the axis to the centre of the tube, in units of length.
    r : float
        Radius of the tube, ``0 < r < R``.

    Raises
    ------
    OptionError
        If the radii are not finite or do not satisfy ``0 < r < R``.

    Examples
    --------
    >>> import stretchmap as sm
    >>> torus = sm.Torus(3.0, 1.0)
    >>> torus.xi(0.0, 0.0).tolist(), torus.xi(0.0, 0.0, s=0.0).tolist()
    ([4.0, 0.0, 0.0], [3.0, 0.0, 0.0])
    >>> u, v, s = torus.coordinates([[0.0, 3.0, 0.5]])
    >>> round(float(u[0]), 6), round(float(v[0]), 6), float(s[0])
    (1.570796, 1.570796, 0.5)
    """

    R: float
    r: float

    def __post_init__(self) -> None:
        R, r = real("R", self.R), real("r", self.r)
        if not 0.0 < r < R:
            raise OptionError(f"a torus needs radii with 0 < r < R, got R = {R}, r = {r}")
        object.__setattr__(self, "R", R)
        object.__setattr__(self, "r", r)

    @classmethod
    def from_ratio(
        cls, ratio: float, *, volume: float | None = None, area: float | None = None
    ) -> Torus:
        """Torus with ``R / r = ratio`` and a given volume or area (tube radius 1 without either).

        Parameters
        ----------
        ratio : float
            ``R / r > 1``.
        volume, area : float, optional
            Volume enclosed or surface area wanted; at most one of them.

        Raises
        ------
        OptionError
            If the ratio is not above 1, or volume or area is not positive, or both are given.

        Examples
        --------
        >>> import stretchmap as sm
        >>> round(sm.Torus.from_ratio(3.0, volume=1.0).volume, 12)
        1.0
        """
        if volume is not None and area is not None:
            raise OptionError("give the volume or the area of the torus, not both")
        torus = cls(real("ratio", ratio, above=1.0), 1.0)
        if volume is not None:
            return torus.with_volume(volume)
        return torus if area is None else torus.with_area(area)

    @property
    def ratio(self) -> float:
        """``R / r``."""
        return self.R / self.r

    @property
    def area(self) -> float:
        """Area ``4 pi^2 R r`` of the torus."""
        return TWO_PI * self.R * TWO_PI * self.r

    @property
    def volume(self) -> float:
        """Volume ``2 pi^2 R r^2`` of the solid torus."""
        return TWO_PI * self.R * math.pi * self.r * self.r

    def scaled(self, factor: float) -> Torus:
        """The torus with both radii multiplied by ``factor > 0``.

        Raises
        ------
        OptionError
            If the factor is not positive and finite.
        """
        factor = real("factor", factor, above=0.0)
        return Torus(self.R * factor, self.r * factor)

    def with_volume(self, volume: float) -> Torus:
        """The similar torus that encloses ``volume > 0``.

        Raises
        ------
        OptionError
            If the volume is not positive and finite.
        """
        return self.scaled((real("volume", volume, above=0.0) / self.volume) ** (1.0 / 3.0))

    def with_area(self, area: float) -> Torus:
        """The similar torus with surface ``area > 0``.

        Raises
        ------
        OptionError
            If the area is not positive and finite.
        """
        return self.scaled(math.sqrt(real("area", area, above=0.0) / self.area))

    def xi(self, u: ArrayLike, v: ArrayLike, s: ArrayLike | None = None) -> NDArray[np.float64]:
        """Points of the solid torus from toroidal coordinates, (7.1).

        Parameters
        ----------
        u, v : array_like
            Angle around the axis and angle around the tube, radians, broadcast together.
        s : array_like, optional
            Distance from the centre circle; the tube radius ``r`` if left out.

        Returns
        -------
        ndarray, shape (..., 3)
            ``((R + s cos v) cos u, (R + s cos v) sin u, s sin v)``.

        Raises
        ------
        ArrayError
            They hold no real numbers or cannot be broadcast together.
        NonFiniteError
            A NaN or an infinity.
        """
        u, v, s = _together(u=u, v=v, s=self.r if s is None else s)
        rho = self.R + s * np.cos(v)
        return np.stack([rho * np.cos(u), rho * np.sin(u), s * np.sin(v)], axis=-1)

    def coordinates(
        self, points: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Toroidal coordinates of points, the inverse of :meth:`xi`.

        Parameters
        ----------
        points : array_like, shape (..., 3)
            A NaN has coordinates NaN.

        Returns
        -------
        u, v : ndarray, shape (...,)
            Angles in ``[0, 2 pi)``; u is 0 on the axis and v is 0 on the centre circle.
        s : ndarray, shape (...,)
            Distance from the centre circle; below ``r`` inside.

        Raises
        ------
        ArrayError
            If the last axis does not have length 3, or they are no real numbers.
        NonFiniteError
            An infinity.
        """
        points = as_reals(points, "points", finite=False)
        if np.isinf(points).any():
            raise NonFiniteError("points has infinite values")
        if points.ndim == 0 or points.shape[-1] != 3:
            raise ArrayError(f"points must have shape (..., 3), got {points.shape}")
        x, y, z = np.moveaxis(points, -1, 0)
        radial = np.hypot(x, y) - self.R
        return _turn(np.arctan2(y, x)), _turn(np.arctan2(z, radial)), np.hypot(radial, z)

    def normal(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """Outward unit normals of the torus at ``(u, v)``, shape (..., 3); raises as `xi`."""
        u, v = _together(u=u, v=v)
        return np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1)


def _turn(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles brought into [0, 2 pi); the sum can round up to 2 pi itself."""
    angle = np.where(angle < 0.0, angle + TWO_PI, angle)
    return np.where(angle >= TWO_PI, 0.0, angle)


def _together(**values: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Arrays of one shape."""
    arrays = [as_reals(value, name) for name, value in values.items()]
    try:
        return np.broadcast_arrays(*arrays)
    except ValueError:
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise ArrayError(f"{', '.join(values)} do not go together: shapes {shapes}") from None
