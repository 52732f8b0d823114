"""Hexahedral grids: the O-grid of a solid torus, measures, and their repair in a solid.

A hexahedron is right where the Jacobian at each of its eight corners is positive, that is, where
the tet of the corner and its three neighbours is; divided by the product of the three edges it is
the scaled Jacobian, 1 at a right angle. Where a pulled-back grid has corners that are not positive,
or nearly not, it is repaired in two stages. First the corners are turned by the regularised energy
that untangles maps, with boxes for rest shapes: Newton steps of the inner points take turns with a
search that moves points one by one, inner ones in space, boundary ones along the surface. Then the
points are drawn back to where the map had put them, as far as no corner gets bad.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._flat import FlatSurface
from .progress import Progress, report

# Corner of a hexahedron and the three corners joined to it, positively oriented.
CORNERS = np.array(
    [[0, 1, 3, 4], [1, 2, 0, 5], [2, 3, 1, 6], [3, 0, 2, 7],
     [4, 7, 5, 0], [5, 4, 6, 1], [6, 5, 7, 2], [7, 6, 4, 3]]
)  # fmt: skip
# Parallel edges, one row for each of the three directions, and the directions of CORNERS' edges.
_EDGES = np.array(
    [[[0, 1], [3, 2], [4, 5], [7, 6]],
     [[0, 3], [1, 2], [4, 7], [5, 6]],
     [[0, 4], [1, 5], [2, 6], [3, 7]]]
)  # fmt: skip
_DIRECTIONS = np.array(
    [[0, 1, 2], [1, 0, 2], [0, 1, 2], [1, 0, 2], [1, 0, 2], [0, 1, 2], [1, 0, 2], [0, 1, 2]]
)
_SQUARE = 0.5  # half diagonal of the middle block over the radius of the section

_VOLUME_WEIGHT = 0.3
_LARGEST_EPSILON, _LEAST_EPSILON = 0.3, 1e-3
_MOST_ROUNDS, _DRAW_ROUNDS = 20, 5
_NEWTON_STEPS, _UNTANGLE_SWEEPS, _DRAW_SWEEPS = 2, 3, 5
_SLACK = 1.5  # of psi: the scaled Jacobian of a box sheared so far is about 0.25
_PULL, _SOFT_PULL = 3.0, 0.3  # while points are drawn back, and before
_ASPECT = 20.0  # largest of the boxes that corners are measured against
_REACH = 0.2  # of the mean edge at a point: first try of its own step


def o_grid(
    block: int, rings: int
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Points of the unit disk (n, 2), quads (q, 4), and the points on the rim."""
    side = np.linspace(-1.0, 1.0, block + 1)
    x, y = (a.ravel() for a in np.meshgrid(side, side, indexing="ij"))
    # The square bulges half-way towards its circumscribed circle.
    radius = np.maximum(np.abs(x), np.abs(y))
    round_off = radius * np.sqrt(2.0) / np.maximum(np.hypot(x, y), 1e-300)
    square = np.stack([x, y], axis=1) * (0.5 + 0.5 * round_off)[:, None] * _SQUARE / np.sqrt(2.0)
    index = np.arange((block + 1) ** 2).reshape(block + 1, block + 1)
    inner = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    start = square[rim]
    angle = np.arctan2(start[:, 1], start[:, 0])
    end = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    t = np.arange(1, rings + 1)[:, None, None] / rings
    around = ((1.0 - t) * start + t * end).reshape(-1, 2)
    layers = np.concatenate(
        [rim[None], len(square) + np.arange(rings * len(rim)).reshape(rings, -1)]
    )
    low, high = layers[:-1], layers[1:]
    outer_quads = np.stack(
        [low, high, np.roll(high, -1, axis=1), np.roll(low, -1, axis=1)], axis=-1
    )
    quads = np.concatenate([inner.reshape(-1, 4), outer_quads.reshape(-1, 4)])
    return np.concatenate([square, around]), quads, layers[-1]


def corner_tets(H: NDArray[np.int32]) -> NDArray[np.int32]:
    """(8 k, 4) tets of the corners and their three neighbours."""
    return np.ascontiguousarray(H[:, CORNERS].reshape(-1, 4))


def jacobians(V: NDArray[np.float64], H: NDArray[np.int32]) -> NDArray[np.float64]:
    """(k, 8) Jacobians at the corners over the product of the lengths of the edges there."""
    corners = V[H[:, CORNERS]]
    edges = corners[:, :, 1:] - corners[:, :, :1]
    lengths = np.linalg.norm(edges, axis=-1).prod(axis=-1)
    return np.linalg.det(edges) / np.maximum(lengths, 1e-300)


def hex_volumes(V: NDArray[np.float64], H: NDArray[np.int32]) -> NDArray[np.float64]:
    """Volumes of the trilinear hexahedra, by Gauss quadrature that is exact for them."""
    signs = np.array(
        [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
         [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
    )  # fmt: skip
    total = np.zeros(len(H))
    for node in signs / np.sqrt(3.0):
        factors = 1.0 + signs * node
        slopes = (
            np.stack(
                [signs[:, a] * factors[:, (a + 1) % 3] * factors[:, (a + 2) % 3] for a in range(3)]
            )
            / 8.0
        )
        total += np.linalg.det(np.einsum("ac,kcx->kax", slopes, V[H]))
    return total


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
        edges = self.H[:, _EDGES].reshape(-1, 2)
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
        newton = _core.SolidNewton(self._tets, rest, weights, motion, 2.0, 1.0, self.V, *no_faces)
        worst = newton.value(self.V, _core.EnergyWeights(1.0, 1.0, 1.0)).min_det
        epsilon = float(np.clip(0.5 * abs(worst), _LEAST_EPSILON, _LARGEST_EPSILON))
        energy = _core.EnergyWeights(1.0, _VOLUME_WEIGHT, epsilon)
        for _ in range(_NEWTON_STEPS):
            self.V, _ = newton.step(self.V, energy, 0.1, 60)
        self._move(rest, epsilon, 0.0, 1.0, _SOFT_PULL, _UNTANGLE_SWEEPS)

    def _count_bad(self) -> int:
        """Hexahedra with a corner that is not positive."""
        return int((~(jacobians(self.V, self.H) > 0.0)).any(axis=1).sum())

    def _boxes(self) -> NDArray[np.float64]:
        """(8 k, 9) rest matrices: a box with the mean edges of each hexahedron and its volume."""
        ends = self.V[self.H[:, _EDGES]]  # (k, 3, 4, 2, 3)
        sides = np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1).mean(axis=-1)
        sides = np.maximum(sides, sides.max(axis=1, keepdims=True) / _ASPECT)
        sides *= np.cbrt(self.volumes / sides.prod(axis=1))[:, None]
        rest = np.zeros((len(self.H), 8, 3, 3))
        rest[..., [0, 1, 2], [0, 1, 2]] = 1.0 / sides[:, _DIRECTIONS]
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
        self.y, self.V, self._reach, _, _ = _core.relax_grid(
            self._tets, rest, np.ones(len(rest)),
            _core.EnergyWeights(1.0, _VOLUME_WEIGHT, epsilon), slack, power,
            self._home, self._home_y, pull / self._mean_edge**2,
            self.surface.locator, surface.V, surface.F, self.surface.face_slopes,
            self.rim, sweeps, self.y, self.V, self._reach,
        )  # fmt: skip
