"""Exact distribution of the volume along each coordinate of the solid torus.

A minimiser of volume distortion balances many elements with a few that cannot be helped, most of
them at the boundary, and so the volume between two level surfaces of u, v or s is off by up to a
few tenths of a per cent. Moving the level surfaces themselves mends that: each coordinate is
replaced by a function of it, chosen so that every level has as much image volume below it as source
volume. The functions are within a few thousandths of the identity, the torus is mapped to itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from . import _core
from .torus import TWO_PI, Torus

__all__ = ["Marginals"]

_BINS = (8, 64)


@dataclass(frozen=True)
class Marginals:
    """Volume of a solid along the coordinates of its image.

    Attributes
    ----------
    T : ndarray of int32, shape (k, 4)
    shares : ndarray, shape (k,)
        Source volumes of the tets, summing to 1.
    boundary : ndarray of int32, shape (nb,)
        Vertices whose images lie on the torus.
    torus : Torus
    held : bool
        Whether the boundary vertices have to stay where they are; then only s can be replaced.
    """

    T: NDArray[np.int32]
    shares: NDArray[np.float64]
    boundary: NDArray[np.int32]
    torus: Torus
    held: bool

    @property
    def bins(self) -> int:
        """Levels per coordinate: about one per layer of tets."""
        return int(np.clip(round(len(self.T) ** (1.0 / 3.0)), *_BINS))

    def equalise(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """Replace each coordinate by the function of it that makes its marginal exact.

        Each coordinate is treated as if the others stayed, so what one leaves of another is of
        second order; call again to remove it.

        Parameters
        ----------
        x : ndarray, shape (n, 3)
            Image.

        Returns
        -------
        x : ndarray, shape (n, 3)
        error : float
            Largest difference between image and source volume below any level before the move, as a
            share of the whole; for angles up to a constant.
        """
        error = 0.0
        for axis in "s" if self.held else "suv":
            u, v, s = self.torus.coordinates(x)
            level = (s / self.torus.r) ** 2
            level[self.boundary] = 1.0
            volumes = _core.signed_tet_volumes(x, self.T)
            if axis == "s":
                missing = self._missing(level, 1.0, volumes)
                # A chord of the torus can leave it, and a vertex near the chord with it.
                level = level + np.where(level < 1.0, missing(level), 0.0)
            elif axis == "u":
                missing = self._missing(u, TWO_PI, volumes)
                u = u + TWO_PI * missing(u)
            else:
                missing = self._missing(v, TWO_PI, volumes)
                # Volume per angle of a sector of the solid torus, relative to the mean.
                v = v + TWO_PI * missing(v) / (1.0 + np.cos(v) / (1.5 * self.torus.ratio))
            error = max(error, float(np.abs(missing.c[-1]).max()))
            moved = self.torus.xi(u, v, self.torus.r * np.sqrt(np.maximum(level, 0.0)))
            if self.held:
                moved[self.boundary] = x[self.boundary]
            x = moved
        return x, error

    def _missing(
        self, value: NDArray[np.float64], period: float, volumes: NDArray[np.float64]
    ) -> PchipInterpolator:
        """Source minus image volume below a level, as a function of the level."""
        angle = period == TWO_PI
        bins = self.bins
        excess = self.shares - volumes / volumes.sum()
        missing = np.zeros(bins + 1)
        missing[1:-1] = np.cumsum(
            _core.level_histogram(self.T, value, excess, bins, period, angle)
        )[:-1]
        levels = np.linspace(0.0, period, bins + 1)
        if not angle:
            return PchipInterpolator(levels, missing)
        # The constant is free; this one moves the levels by nothing on average. Two more levels at
        # either end make the slopes agree where the angle closes up.
        missing -= missing[1:].mean()
        inner = missing[:-1]
        around = np.concatenate([inner[-2:], missing, inner[1:3]])
        step = levels[1]
        return PchipInterpolator(np.arange(-2, bins + 3) * step, around)
