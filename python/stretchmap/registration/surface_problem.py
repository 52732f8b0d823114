"""What is minimized where one surface is laid on another, seen from both.

The image of a face is flat. One that spans a process of the target is small, however much of the
target it stands for: judged by the image alone, processes are best cut off, and were. So the
distortion is taken twice, of the faces of the source by their images, and of those of the target by
what the map does at their centers, and the mean counts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .flat_torus import DampedSolver, FlatSurface

__all__ = ["SurfaceProblem"]

_NO_SLOPES = np.zeros((0, 6))
_PASSES, _LEFT = 12, 0.1  # a step leaves a face this share of its area in the flat torus
_CG_TOL = 1e-2  # steps that are cut short by single faces need not be solved for exactly
_SWEEPS = 2
_REACH = 0.25  # of the mean edge at a vertex: first try of its own step


class SurfaceProblem:
    """Positions y in the target's flat torus, their points in space and the energy there."""

    def __init__(self, source: FlatSurface, target: FlatSurface) -> None:
        surface = source.surface
        self.chart, self.target = source.chart, target
        self.rest = _core.volume.rest_triangles(
            surface.V, surface.F, target.surface.area / surface.area
        )
        self.weights = 0.5 * surface.face_areas / surface.area
        self._centers, self._metric = _samples(target)
        self._shares = 0.5 * target.surface.face_areas / target.surface.area
        self.held = np.zeros(surface.n_vertices, bool)
        self._edges = surface.edges
        self._reach: NDArray[np.float64] | None = None

    def place(self, y: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """Points (n, 3) at ``y`` and the energy, infinite if a face is folded."""
        points = self.target.points(y)
        value = _core.registration.match_value(self.chart, y, points, self.rest, self.weights)
        if not math.isfinite(value):
            return points, math.inf
        home = self._homes(y)
        if (home < 0).any():
            return points, math.inf
        return points, value + _core.registration.cover_value(
            self.chart, y, home, self._metric, self.rest, self._shares
        )

    def _homes(self, y: NDArray[np.float64]) -> NDArray[np.int32]:
        """The source face whose image holds the center of each face of the target."""
        home, _ = _core.registration.ChartLocator(self.chart, y).locate(self._centers)
        return np.asarray(home)

    def newton_step(
        self,
        y: NDArray[np.float64],
        points: NDArray[np.float64],
        tangent: bool,
        wish: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Newton step of all vertices but held ones; with ``wish`` (n, 2) these move by it instead,
        and the others as the energy's second derivatives have them follow."""
        slopes = self.target.slopes(y) if tangent else _NO_SLOPES
        gradient, hessian = _core.registration.match_model(
            self.chart, y, points, slopes, self.rest, self.weights
        )
        cover = _core.registration.cover_model(
            self.chart, y, self._homes(y), self._metric, self.rest, self._shares
        )
        gradient, hessian = gradient + cover[0], (hessian + cover[1]).tocsr()
        if wish is None and not self.held.any():  # only to lead there, or to where landmarks go
            return DampedSolver(_CG_TOL).step(gradient, hessian).reshape(-1, 2)
        free = np.flatnonzero(np.repeat(~self.held, 2))
        step = np.zeros(2 * len(y)) if wish is None else wish.ravel().copy()
        pull = gradient if wish is None else hessian @ step
        step[free] = DampedSolver().step(pull[free], hessian[free][:, free])
        return step.reshape(-1, 2)

    def unfolded(self, y: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
        """The step (n, 2), shortened at the corners of faces that it would fold or nearly so."""
        before, share = _core.area.turn_areas(self.chart, y), np.ones(len(y))
        for _ in range(_PASSES):
            taken = share[:, None] * step
            areas = _core.area.turn_areas(self.chart, y + taken)
            folded = np.flatnonzero(areas < _LEFT * before)
            if not len(folded):
                break
            share[np.unique(self.chart.faces[folded])] *= 0.5
        return taken

    def one_by_one(
        self, y: NDArray[np.float64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Every vertex that is not held moved by itself, if that lowers the source's half."""
        if self._reach is None:
            lengths = np.linalg.norm(points[self._edges[:, 1]] - points[self._edges[:, 0]], axis=1)
            ends = self._edges.ravel()
            total = np.bincount(ends, np.repeat(lengths, 2), minlength=len(y))
            self._reach = _REACH * total / np.bincount(ends, minlength=len(y))
        surface = self.target.surface
        y, points, self._reach, _, _ = _core.registration.relax_match(
            self.chart, self.target.locator, surface.V, surface.F, self.target.face_slopes,
            self.rest, self.weights, self.held.astype(np.uint8), _SWEEPS, y, points, self._reach,
        )  # fmt: skip
        return y, points


def _samples(target: FlatSurface) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centers (m, 2) of the faces in the flat torus, and row-major 2x2 matrices (m, 4) that take
    the flat torus to the plane of each."""
    centers = target.corners(np.arange(target.surface.n_faces)).mean(axis=1)
    slopes = target.face_slopes.reshape(-1, 3, 2)
    squares = np.einsum("nij,nik->njk", slopes, slopes)
    metric = np.linalg.cholesky(squares).transpose(0, 2, 1)
    return np.ascontiguousarray(centers), np.ascontiguousarray(metric.reshape(-1, 4))
