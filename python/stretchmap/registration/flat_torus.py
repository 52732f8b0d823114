"""The flat torus of a surface, and the choice of how two of them lie on each other."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .. import _core
from ..area.flat import unfolded_turns
from ..base.arrays import describe
from ..base.rotation import kabsch
from ..conformal.map import conformal_map
from ..errors import SolverError
from ..mesh.meshes import TriMesh

_log = logging.getLogger("stretchmap")

_SEM_STEPS = 10
# Where faces begin next to nothing, far out on a limb, each step makes them a little larger only:
# it takes up to a hundred, elsewhere twenty.
_FLAT_STEPS, _FLAT_TOL = 300, 1e-3
_SHORTEST = 1e-4  # of a Newton step
_GRID = 20  # shifts tried along either coordinate
_SAMPLE = 300  # vertices the rigid fit is judged by


@dataclass(frozen=True, eq=False)
class FlatSurface:
    """A genus-one surface with coordinates on the unit flat torus.

    Neither areas nor angles are true, but together they are distorted as little as can be, and no
    face is squeezed.

    Attributes
    ----------
    surface : TriMesh
    forms : ndarray of int32, shape (2, e)
        Integer closed 1-forms of the coordinates, as in `ConformalMap`.
    turns : ndarray, shape (n, 2)
    """

    surface: TriMesh
    forms: NDArray[np.int32]
    turns: NDArray[np.float64]

    @classmethod
    def of(cls, surface: TriMesh, name: str = "surface") -> FlatSurface:
        """Conformal map, stretch energy minimisation (Algorithm 4.1) in the flat torus, and Newton
        steps on the distortion of area and shape (``flat_value``).

        Of the iterates of Algorithm 4.1 the one with the least ``sum |f| (ratio + 1 / ratio)`` is
        taken. By itself it will not do: faces may nearly collapse in it, and near those what is
        straight in the flat torus is crooked on the surface.

        Raises
        ------
        MeshError
            As `conformal_map`.
        SolverError
            As there; or faces of the boundary of the solid that is called ``name`` are shrunk to
            nothing, ``ids`` are those.
        """
        conformal = conformal_map(surface)
        chart = _core.area.SurfaceChart(surface.topology, conformal.forms)
        sem = _core.area.SurfaceSem(chart, surface.face_areas, conformal.aspect, conformal.turns)
        shares = surface.face_areas / surface.area
        best, turns = math.inf, sem.turns
        for _ in range(_SEM_STEPS + 1):
            # Stretch energy does not mind a face that collapses, this measure does.
            areas = _core.area.turn_areas(chart, np.ascontiguousarray(sem.turns))
            ratio = np.maximum(areas / shares, 1e-300)
            value = float((shares * (ratio + 1.0 / ratio)).sum())
            if value < best:
                best, turns = value, sem.turns.copy()
            try:
                sem.step()
            except SolverError:  # faces have collapsed: what it made of them before counts
                break
        turns = _least_distorted(surface, chart, conformal.lattice, np.ascontiguousarray(turns))
        lost = np.flatnonzero(~(_core.area.turn_areas(chart, turns) > 0.0))
        if len(lost):
            # Conformal maps lose the tips of limbs in rounding; others begin next to nothing there.
            try:
                turns = np.ascontiguousarray(unfolded_turns(surface, conformal))
            except SolverError as error:
                _log.info("the %s: %s", name, error)
            turns = _least_distorted(surface, chart, conformal.lattice, turns)
            lost = np.flatnonzero(~(_core.area.turn_areas(chart, turns) > 0.0))
        if len(lost):
            raise SolverError(
                f"{describe('face', lost)} of the {name} lie so far out on a long, thin limb that "
                "a flat torus shrinks them to nothing: cut the limb short or remesh it coarser",
                lost,
            )
        return cls(surface, conformal.forms, turns)

    def changed(self, gauge: Gauge) -> FlatSurface:
        """The same surface in coordinates changed by a gauge."""
        matrix = gauge.matrix
        forms = np.ascontiguousarray(matrix @ self.forms, np.int32)
        turns = self.turns @ matrix.T + gauge.shift
        return FlatSurface(self.surface, forms, np.ascontiguousarray(turns))

    def at(self, turns: NDArray[np.float64]) -> FlatSurface:
        """The same surface, its vertices moved to (n, 2) ``turns`` without being wrapped."""
        return FlatSurface(self.surface, self.forms, np.ascontiguousarray(turns))

    def split(
        self, finer: TriMesh, edges: NDArray[np.int32], where: NDArray[np.float64]
    ) -> FlatSurface:
        """The surface some of whose edges were split, of each face one at most.

        Parameters
        ----------
        finer : TriMesh
            Its first n vertices are those of the surface, then one on each of ``edges``.
        edges : ndarray of int32, shape (a, 2)
        where : ndarray, shape (a, 2)
            The new vertices, in turns, as seen from the first end of their edges.
        """
        n = self.surface.n_vertices
        low, high = finer.edges.T
        # A new vertex lies where the first end of its edge sees it, so that is where others see it.
        first = edges[np.maximum(high - n, 0), 0] if len(edges) else high
        last = np.where(high < n, high, first)
        forms = np.zeros((2, len(low)), np.int32)
        apart = low != last
        forms[:, apart] = self._whole(low[apart], last[apart]).T
        return FlatSurface(finer, forms, np.concatenate([self.turns, where]))

    def ways(self, ends: NDArray[np.int32]) -> NDArray[np.float64]:
        """(..., 2) ways in turns along edges, given by their first and last vertex (..., 2)."""
        first, last = ends[..., 0], ends[..., 1]
        return np.asarray(self.turns[last] - self.turns[first] + self._whole(first, last))

    def corners(self, faces: NDArray[np.integer]) -> NDArray[np.float64]:
        """(k, 3, 2) corners of some faces in turns, as seen from the first of each."""
        shift = np.stack([self.chart.shift_u, self.chart.shift_v], axis=-1)[faces]
        return np.asarray(self.turns[self.surface.F[faces]] + shift)

    def _whole(self, first: NDArray[np.int32], last: NDArray[np.int32]) -> NDArray[np.int32]:
        """(..., 2) whole turns along edges, values of the forms."""
        n, edges = self.surface.n_vertices, self.surface.edges.astype(np.int64)
        key = np.minimum(first, last).astype(np.int64) * n + np.maximum(first, last)
        along = self.forms.T[np.searchsorted(edges[:, 0] * n + edges[:, 1], key)]
        return np.where((first < last)[..., None], along, -along)

    @cached_property
    def chart(self) -> _core.area.SurfaceChart:
        """Whole turns between the corners of each face (core object)."""
        return _core.area.SurfaceChart(self.surface.topology, self.forms)

    @cached_property
    def locator(self) -> _core.registration.ChartLocator:
        return _core.registration.ChartLocator(self.chart, self.turns)

    def locate(self, y: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Face and barycentric coordinates of points of the flat torus, (n, 2) in turns.

        Raises
        ------
        SolverError
            If a point lies in no face: the chart is folded there.
        """
        faces, weights = self.locator.locate(np.ascontiguousarray(y))
        lost = np.flatnonzero(faces < 0)
        if len(lost):
            raise SolverError(f"{len(lost)} points lie in no face: the flat chart is folded", lost)
        return faces, weights

    def points(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) points of the surface at (n, 2) points of the flat torus."""
        faces, weights = self.locate(y)
        corners = self.surface.V[self.surface.F[faces]]
        return np.ascontiguousarray(np.einsum("ij,ijk->ik", weights, corners))

    def slopes(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 6) derivatives of `points`, averaged over the faces at each vertex so that they are
        continuous; row-major 3x2 matrices."""
        faces, weights = self.locate(y)
        return np.ascontiguousarray(
            np.einsum("ij,ijk->ik", weights, self._vertex_slopes[self.surface.F[faces]])
        )

    @cached_property
    def face_slopes(self) -> NDArray[np.float64]:
        """(m, 6) derivatives of `points` in each face; row-major 3x2 matrices."""
        F, V = self.surface.F, self.surface.V
        flat = self.corners(np.arange(len(F)))
        flat_edges = np.stack([flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]], axis=-1)
        edges = np.stack([V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]], axis=-1)
        return np.ascontiguousarray((edges @ np.linalg.inv(flat_edges)).reshape(-1, 6))

    @cached_property
    def _vertex_slopes(self) -> NDArray[np.float64]:
        F, V = self.surface.F, self.surface.V
        slopes = self.face_slopes
        area = self.surface.face_areas
        ring = np.bincount(F.ravel(), np.repeat(area, 3), minlength=len(V))
        sums = [
            np.bincount(F.ravel(), np.repeat(area * column, 3), minlength=len(V))
            for column in slopes.T
        ]
        return np.stack(sums, axis=1) / ring[:, None]


def _least_distorted(
    surface: TriMesh,
    chart: _core.area.SurfaceChart,
    lattice: NDArray[np.float64],
    turns: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Projected Newton steps on ``flat_value``; the start is returned if it is folded."""
    periods = np.ascontiguousarray(lattice.T / math.sqrt(abs(np.linalg.det(lattice))))
    rest = _core.volume.rest_triangles(surface.V, surface.F, 1.0 / surface.area)
    weights = surface.face_areas / surface.area
    return descended(
        lambda y: _core.registration.flat_value(chart, y, periods, rest, weights),
        lambda y: _core.registration.flat_model(chart, y, periods, rest, weights),
        turns,
        steps=_FLAT_STEPS,
        tol=_FLAT_TOL,
    )


def descended(
    value: Callable[[NDArray[np.float64]], float],
    model: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], sp.csr_matrix]],
    turns: NDArray[np.float64],
    *,
    steps: int,
    tol: float,
) -> NDArray[np.float64]:
    """Newton steps, halved until an energy falls, until one lowers it by no more than a share.

    Parameters
    ----------
    value : callable
        The energy, infinite where a face is folded; a start without one is returned.
    model : callable
        Gradient (2 n,) and Hessian, positive semi-definite.
    turns : ndarray, shape (n, 2)
    steps : int
        Most of them.
    tol : float
        The share.
    """
    energy, solver = value(turns), DampedSolver()
    for _ in range(steps if math.isfinite(energy) else 0):
        step, alpha = solver.step(*model(turns)).reshape(-1, 2), 1.0
        while alpha > _SHORTEST:
            moved = turns + alpha * step
            lower = value(moved)
            if lower < energy:
                break
            alpha *= 0.5
        else:
            break
        small = energy - lower <= tol * energy
        turns, energy = moved, lower
        if small:
            break
    return turns


class DampedSolver:
    """Newton steps for Hessians that are positive semi-definite only; by a factorization, analyzed
    once as long as the pattern stays, or by conjugate gradients to a relative residual of ``tol``.
    """

    def __init__(self, tol: float = 0.0) -> None:
        self._tol = tol
        self._indices = np.empty(0, np.int32)
        self._solver: _core.linalg.SpdSolver | None = None

    def step(self, gradient: NDArray[np.float64], hessian: sp.csr_matrix) -> NDArray[np.float64]:
        """(n,) for a gradient (n,); where nothing is free it is empty."""
        if not len(gradient):
            return np.empty(0)
        diagonal = hessian.diagonal()
        matrix = (hessian + sp.diags(1e-6 * diagonal + 1e-12 * diagonal.mean())).tocsr()
        matrix.sort_indices()
        if self._solver is not None and np.array_equal(matrix.indices, self._indices):
            self._solver.refactor(matrix.data)
        else:
            self._indices = matrix.indices
            kind = "jacobi" if self._tol else "direct"
            self._solver = _core.linalg.SpdSolver(matrix, kind)
        right, start = -gradient[:, None], np.zeros((len(gradient), 1))
        step, _ = self._solver.solve(right, start, tol=self._tol or 1e-10, must_converge=False)
        return np.asarray(step[:, 0])


@dataclass(frozen=True)
class Gauge:
    """How the flat torus of the source is laid on that of the target.

    ``(u, v) -> (sign u, sign v + twist u) + shift``: whatever keeps orientation and meridian.

    Attributes
    ----------
    sign : int
        1, or -1 if both directions are reversed.
    twist : int
        Dehn twists: meridians added to the longitude.
    shift : tuple of float
        In turns.
    residual : float
        Root mean square misfit the gauge was chosen by, as a share of the target's diagonal.
    rule : str
        ``"landmarks"``, ``"rigid fit"`` or ``"smooth fit"``: of a smooth deformation in space.
    """

    sign: int
    twist: int
    shift: tuple[float, float]
    residual: float
    rule: str

    @property
    def matrix(self) -> NDArray[np.int32]:
        """The change of coordinates, (2, 2), determinant 1."""
        return np.array([[self.sign, 0], [self.twist, self.sign]], np.int32)


def choose_gauge(
    source: FlatSurface,
    target: FlatSurface,
    belong: tuple[NDArray[np.integer], NDArray[np.float64]] | None,
    rule: str = "landmarks",
) -> Gauge:
    """Gauge with the least misfit.

    With vertex ids (k,) of the source and points (k, 3) near the target where they ``belong``, the
    misfit is how far from there they come to lie. Without, it is what remains between vertices and
    their images after the best similarity (rotation without reflection, translation, scale): two
    bones of one kind fit well in the right gauge only.
    """
    if belong is not None:
        ids, goals = belong
    else:
        step = max(1, source.surface.n_vertices // _SAMPLE)
        ids, goals = np.arange(0, source.surface.n_vertices, step, dtype=np.int32), None
        rule = "rigid fit"
    size = float(np.linalg.norm(np.ptp(target.surface.V, axis=0)))
    grid = np.stack(np.meshgrid(*[np.arange(_GRID) / _GRID] * 2, indexing="ij"), -1).reshape(-1, 2)

    def misfits(sign: int, twist: int, shifts: NDArray[np.float64]) -> NDArray[np.float64]:
        matrix = np.array([[sign, 0], [twist, sign]])
        y = (source.turns[ids] @ matrix.T)[None] + shifts[:, None]
        images = target.points(y.reshape(-1, 2)).reshape(len(shifts), len(ids), 3)
        if goals is not None:
            return np.asarray(np.sqrt(((images - goals) ** 2).sum(axis=2).mean(axis=1)))
        return _similarity_misfits(source.surface.V[ids], images)

    best = (np.inf, 1, 0, np.zeros(2))
    for sign in (1, -1):
        for twist in (-1, 0, 1):
            values = misfits(sign, twist, grid)
            i = int(np.argmin(values))
            if values[i] < best[0]:
                best = (float(values[i]), sign, twist, grid[i])
    value, sign, twist, shift = best
    width = 1.0 / _GRID
    offsets = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), -1).reshape(-1, 2)
    while width > 1e-3:
        width *= 0.5
        values = misfits(sign, twist, shift + width * offsets)
        i = int(np.argmin(values))
        value, shift = float(values[i]), shift + width * offsets[i]
    return Gauge(sign, twist, (float(shift[0]), float(shift[1])), value / size, rule)


def _similarity_misfits(
    points: NDArray[np.float64], images: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Misfit of points (k, 3) and each of the images (c, k, 3) after the best similarity."""
    p = points - points.mean(axis=0)
    q = images - images.mean(axis=1, keepdims=True)
    agreement = kabsch(np.einsum("ki,ckj->cij", p, q))[1].sum(axis=1)
    scale = agreement / (p**2).sum()
    left = (q**2).sum(axis=(1, 2)) - scale * agreement
    return np.asarray(np.sqrt(np.maximum(left, 0.0) / len(points)))
