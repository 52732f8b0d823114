"""How the volume is distributed along each coordinate of the solid torus.

A minimiser of volume distortion balances many elements with a few that cannot be helped, most of
them at the boundary, and so the volume between two level surfaces of u, v or s is off by up to a
few tenths of a per cent. Two means against that:

- multipliers: the volume asked of every tet is multiplied by a function of the level it lies at,
  raised where a bin of levels has too little image volume and lowered where it has too much. The
  minimiser does what can be done at the least cost, in the layer of tets at the boundary too, but
  reacts slowly;
- shifts: each coordinate is replaced by a function of it, within a few ten-thousandths of the
  identity, chosen so that every level has as much image volume below it as source volume. That is
  exact at once, but within the layer at the boundary there is nothing to shift.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.torus import TWO_PI, Torus

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

__all__ = ["Marginals"]

_BINS = (8, 64)
_RELAXED = 1.5  # times what is missing: the minimizer gives way by a part of what it is asked
_TARGETS = (0.8, 1.25)  # what more is missing is beyond a correction


@dataclass(frozen=True)
class Marginal:
    """Volume along one coordinate.

    Attributes
    ----------
    values : ndarray, shape (n,)
        The coordinate of every vertex.
    period : float
        Its largest value; 2 pi for an angle.
    source, image : ndarray, shape (bins,)
        Volume in bins of equal width, each summing to 1.
    """

    values: NDArray[np.float64]
    period: float
    source: NDArray[np.float64]
    image: NDArray[np.float64]


class Marginals:
    """Volume of a solid and of its image along u, v and s, and how to equalise them.

    Parameters
    ----------
    T : ndarray of int32, shape (k, 4)
    shares : ndarray, shape (k,)
        Source volumes of the tets, summing to 1.
    boundary : ndarray of int32, shape (nb,)
        Vertices whose images lie on the torus.
    torus : Torus
    held : bool
        Whether the boundary vertices have to stay where they are; then only s can be shifted.
    """

    def __init__(
        self,
        T: NDArray[np.int32],
        shares: NDArray[np.float64],
        boundary: NDArray[np.int32],
        torus: Torus,
        *,
        held: bool,
    ) -> None:
        self.T, self.shares, self.boundary, self.torus = T, shares, boundary, torus
        self.held = held
        # About one bin per layer of tets.
        bins = int(np.clip(round(len(T) ** (1.0 / 3.0)), *_BINS))
        self.multipliers = np.zeros((3, bins))

    def measure(self, x: NDArray[np.float64]) -> list[Marginal]:
        """Of an image (n, 3): the marginals of ``(s / r)^2``, ``u`` and ``v``.

        The first is the share of the volume that lies further inside.
        """
        amounts = self._amounts(x)
        periods = (1.0, TWO_PI, TWO_PI)
        return [
            Marginal(values, period, *self._histograms(amounts, values, period))
            for values, period in zip(self._coordinates(x), periods, strict=True)
        ]

    def _coordinates(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        u, v, s = self.torus.coordinates(x)
        level = (s / self.torus.r) ** 2
        level[self.boundary] = 1.0
        return level, u, v

    def error(self, marginals: list[Marginal]) -> float:
        """Largest difference between image and source volume below any level.

        As a share of the whole; for angles up to a constant, since any level may be the first.
        """
        return max(float(np.abs(self._below(m.source, m.image, m.period)).max()) for m in marginals)

    def targets(self, marginals: list[Marginal]) -> NDArray[np.float64]:
        """Update the multipliers; the volume (k,) to ask of each tet, relative to its share."""
        targets = np.ones(len(self.T))
        for m, table in zip(marginals, self.multipliers, strict=True):
            missing = np.divide(
                m.source - m.image, m.source, where=m.source > 0.0, out=np.zeros_like(table)
            )
            table += _RELAXED * missing
            targets += _core.volume.level_lookup(
                self.T, m.values, table, m.period, m.period == TWO_PI
            )
        return np.clip(targets, *_TARGETS)

    def shifted(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Replace each coordinate by the function of it that makes its marginal exact.

        Each is treated as if the others stayed, and as if image volume moved as it does between the
        layers of a fine mesh: call again to remove what that leaves.

        Parameters
        ----------
        x : ndarray, shape (n, 3)
            Image.

        Returns
        -------
        ndarray, shape (n, 3)
            The torus is mapped to itself.
        """
        for axis in range(1 if self.held else 3):
            level, u, v = self._coordinates(x)
            if axis == 0:
                # A chord of the torus can leave it, and a vertex near the chord with it.
                shift = self._missing(x, level, 1.0)(level)
                level = np.maximum(level + np.where(level < 1.0, shift, 0.0), 0.0)
            elif axis == 1:
                u = u + TWO_PI * self._missing(x, u, TWO_PI)(u)
            else:
                # Volume per angle of a sector of the solid torus, relative to the mean.
                density = 1.0 + np.cos(v) / (1.5 * self.torus.ratio)
                v = v + TWO_PI * self._missing(x, v, TWO_PI)(v) / density
            moved = self.torus.xi(u, v, self.torus.r * np.sqrt(level))
            if self.held:
                moved[self.boundary] = x[self.boundary]
            x = moved
        return x

    def _amounts(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Shares of source and image volume (k, 2)."""
        volumes = _core.mesh.tet_volumes(x, self.T)
        return np.column_stack([self.shares, volumes / volumes.sum()])

    def _histograms(
        self, amounts: NDArray[np.float64], values: NDArray[np.float64], period: float
    ) -> NDArray[np.float64]:
        """Source and image volume in the bins of one coordinate, each summing to 1: (2, bins)."""
        bins = self.multipliers.shape[1]
        found = _core.volume.level_histogram(
            self.T, values, amounts, bins, period, period == TWO_PI
        )
        return np.ascontiguousarray(found.T)

    @staticmethod
    def _below(
        source: NDArray[np.float64], image: NDArray[np.float64], period: float
    ) -> NDArray[np.float64]:
        """Source minus image volume below the bins' ends, 0 and the whole included."""
        below = np.concatenate([[0.0], np.cumsum(source - image)[:-1], [0.0]])
        if period == TWO_PI:
            below -= below[1:].mean()  # so that shifts move the levels by nothing on average
        return below

    def _missing(
        self, x: NDArray[np.float64], values: NDArray[np.float64], period: float
    ) -> PchipInterpolator:
        """`_below` as a function of the level."""
        from scipy.interpolate import PchipInterpolator  # a quarter of what starting takes

        source, image = self._histograms(self._amounts(x), values, period)
        below = self._below(source, image, period)
        step = period / (len(below) - 1)
        if period != TWO_PI:
            return PchipInterpolator(np.arange(len(below)) * step, below)
        # Two more levels at either end make the slopes agree where the angle closes up.
        around = np.concatenate([below[-3:-1], below, below[1:3]])
        return PchipInterpolator(np.arange(-2, len(below) + 2) * step, around)
