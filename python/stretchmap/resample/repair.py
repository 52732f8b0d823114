"""Corners of hexahedra made positive."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress, report
from ..registration.flat_torus import FlatSurface
from .quality import DIRECTIONS, EDGES, corner_tets

_VOLUME_WEIGHT = 0.3
_LARGEST_EPSILON, _LEAST_EPSILON = 0.3, 1e-3
_MOST_ROUNDS, _DRAW_ROUNDS = 20, 5
_NEWTON_STEPS, _UNTANGLE_SWEEPS, _DRAW_SWEEPS = 2, 3, 5
_SLACK = 1.5  # of psi: the scaled Jacobian of a box sheared so far is about 0.25
_PULL, _SOFT_PULL = 3.0, 0.3  # while points are drawn back, and before
_ASPECT = 20.0  # largest of the boxes that corners are measured against
_REACH = 0.2  # of the mean edge at a point: first try of its own step


@dataclass
class GridRepair:
    """A grid of hexahedra in a solid, on its way to positive corners.

    Attributes
    ----------
    V : ndarray, shape (n, 3)
        Points, replaced as the repair goes on; to begin with, where they are drawn back to later.
    H : ndarray of int32, shape (k, 8)
    volumes : ndarray, shape (k,)
        Volume that each hexahedron ought to have.
    rim : ndarray of int32, shape (b,)
        Points on the boundary.
    surface : FlatSurface
        Boundary of the solid.
    y : ndarray, shape (b, 2)
        Positions of the rim in its flat torus, replaced too.
    """

    V: NDArray[np.float64]
    H: NDArray[np.int32]
    volumes: NDArray[np.float64]
    rim: NDArray[np.int32]
    surface: FlatSurface
    y: NDArray[np.float64]
    _reach: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.V = np.array(self.V)
        self.V[self.rim] = self.surface.points(self.y)
        self._home, self._home_y = self.V.copy(), self.y.copy()
        self._tets = corner_tets(self.H)
        edges = self.H[:, EDGES].reshape(-1, 2)
        lengths = np.linalg.norm(self.V[edges[:, 1]] - self.V[edges[:, 0]], axis=1)
        total = np.bincount(edges.ravel(), np.repeat(lengths, 2), minlength=len(self.V))
        self._mean_edge = total / np.bincount(edges.ravel(), minlength=len(self.V))
        self._reach = _REACH * self._mean_edge

    def run(self, progress: Progress | None = None) -> None:
        """Both stages; the second only if the first got all corners positive."""
        for done in range(_MOST_ROUNDS):
            left = self._count_bad()
            report(progress, "untangle", done, _MOST_ROUNDS, bad=left)
            if left == 0:
                break
            self._untangle()
        else:
            if self._count_bad():
                return
        self._reach = _REACH * self._mean_edge
        for done in range(_DRAW_ROUNDS):
            report(progress, "draw back", done, _DRAW_ROUNDS)
            self._move(self._boxes(), 0.0, _SLACK, 2.0, _PULL, _DRAW_SWEEPS)

    def _untangle(self) -> None:
        rest = self._boxes()
        weights = np.full(len(rest), 1.0 / len(rest))
        motion = np.zeros(len(self.V), np.uint8)
        motion[self.rim] = 1
        no_faces = (np.zeros((0, 3), np.int32), np.zeros((0, 4)), np.zeros(0))
        newton = _core.volume.SolidNewton(
            self._tets, rest, weights, motion, 2.0, 1.0, self.V, *no_faces
        )
        worst = newton.value(self.V, _core.volume.EnergyWeights(1.0, 1.0, 1.0)).min_det
        epsilon = float(np.clip(0.5 * abs(worst), _LEAST_EPSILON, _LARGEST_EPSILON))
        energy = _core.volume.EnergyWeights(1.0, _VOLUME_WEIGHT, epsilon)
        for _ in range(_NEWTON_STEPS):
            self.V, _ = newton.step(self.V, energy, 0.1, 60)
        self._move(rest, epsilon, 0.0, 1.0, _SOFT_PULL, _UNTANGLE_SWEEPS)

    def _count_bad(self) -> int:
        """Hexahedra with a corner that is not positive."""
        return int((~(_core.resample.scaled_jacobians(self.V, self.H) > 0.0)).any(axis=1).sum())

    def _boxes(self) -> NDArray[np.float64]:
        """(8 k, 9) rest matrices: a box with the mean edges of each hexahedron and its volume."""
        ends = self.V[self.H[:, EDGES]]  # (k, 3, 4, 2, 3)
        sides = np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1).mean(axis=-1)
        sides = np.maximum(sides, sides.max(axis=1, keepdims=True) / _ASPECT)
        sides *= np.cbrt(self.volumes / sides.prod(axis=1))[:, None]
        rest = np.zeros((len(self.H), 8, 3, 3))
        rest[..., [0, 1, 2], [0, 1, 2]] = 1.0 / sides[:, DIRECTIONS]
        return rest.reshape(-1, 9)

    def _move(
        self,
        rest: NDArray[np.float64],
        epsilon: float,
        slack: float,
        power: float,
        pull: float,
        sweeps: int,
    ) -> None:
        surface = self.surface.surface
        self.y, self.V, self._reach, _, _ = _core.resample.relax_grid(
            self._tets, rest, np.ones(len(rest)),
            _core.volume.EnergyWeights(1.0, _VOLUME_WEIGHT, epsilon), slack, power,
            self._home, self._home_y, pull / self._mean_edge**2,
            self.surface.locator, surface.V, surface.F, self.surface.face_slopes,
            self.rim, sweeps, self.y, self.V, self._reach,
        )  # fmt: skip
