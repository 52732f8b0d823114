"""The boundary map of a registration: landmarks first, then the least distortion of the surface."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from .. import _core
from ..base.progress import Progress, report
from ..errors import LandmarkError, SolverError
from ..maps.history import IterationRecord
from .flat_torus import FlatSurface, damped_solve, wrapped

_NO_SLOPES = np.zeros((0, 6))
_SHORTEST = 1e-3  # steps shorter than this make no progress
_RISE = 1.0  # energy that may be spent on one step towards the landmarks; 0 for an isometry
_FAR = 0.25  # a shorter step towards the landmarks calls for a relaxation before the next
_STUCK = 12  # steps too short to get anywhere, with a relaxation after each
_SHORT = 0.02  # a step shorter than this asks for another kind of step
# Surfaces have edges, where the energy has kinks and a few faces block the step of all others:
# after the two kinds of Newton step, vertices are moved one by one.
_KINDS = ("chord", "tangent", "one by one")
_SWEEPS = 2
_REACH = 0.25  # of the mean edge at a vertex: first try of its own step
_ROUND_TOL = 10.0  # times tol: least decrease of a round of all kinds


@dataclass(frozen=True)
class Match:
    """What `match_surfaces` leaves behind.

    Attributes
    ----------
    y : ndarray, shape (n, 2)
        Image of each source vertex in the target's flat torus, in turns.
    points : ndarray, shape (n, 3)
        The same on the target surface.
    history : tuple of IterationRecord
        Stage ``"match"``.
    """

    y: NDArray[np.float64]
    points: NDArray[np.float64]
    history: tuple[IterationRecord, ...]


def affine_landmark_map(
    source: NDArray[np.float64], target: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Piecewise-affine map h of section 7.1 on a periodic Delaunay triangulation of the landmarks.

    Parameters
    ----------
    source, target : ndarray, shape (k, 2)
        Landmarks in turns; each target is taken the short way from its source.
    y : ndarray, shape (n, 2)
        Points to be mapped.

    Returns
    -------
    ndarray, shape (n, 2)

    Raises
    ------
    LandmarkError
        If a triangle turns over; ``ids`` are the two landmarks at fault.
    """
    move = target - source
    move = move - np.round(move)
    if not len(source):
        return y
    whole = np.floor(source)
    tiles = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)], float)
    nodes = ((source - whole)[None] + tiles[:, None]).reshape(-1, 2)
    moves = np.tile(move, (9, 1))
    triangulation = Delaunay(nodes)
    corners = triangulation.simplices
    before, after = _double_areas(nodes[corners]), _double_areas((nodes + moves)[corners])
    # Every triangle has a copy with a corner in the middle tile; those at the rim are no triangles
    # of the periodic triangulation.
    k = len(source)
    middle = ((corners >= 4 * k) & (corners < 5 * k)).any(axis=1)
    folded = np.flatnonzero(middle & ~(after * before > 0.0))
    if len(folded):
        pair = _worst_pair(nodes, moves, corners[folded]) % len(source)
        raise LandmarkError(
            f"landmarks {pair[0]} and {pair[1]} contradict each other: the map between them turns "
            "over; correct or drop one of them, or use landmark_map='smooth'",
            pair,
        )
    base = np.floor(y)
    found = triangulation.find_simplex(y - base)
    matrix = triangulation.transform[found]
    first = np.einsum("nij,nj->ni", matrix[:, :2], y - base - matrix[:, 2])
    weights = np.column_stack([first, 1.0 - first.sum(axis=1)])
    return np.asarray(y + np.einsum("ni,nij->nj", weights, moves[corners[found]]))


def _double_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _worst_pair(
    nodes: NDArray[np.float64], moves: NDArray[np.float64], triangles: NDArray[np.int32]
) -> NDArray[np.intp]:
    """The two corners whose difference in displacement is largest for their distance."""
    pairs = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    gap = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    strain = np.linalg.norm(moves[pairs[:, 0]] - moves[pairs[:, 1]], axis=1) / gap
    return np.asarray(pairs[int(np.argmax(strain))], np.intp)


class SurfaceProblem:
    """Positions y in the target's flat torus, their points in space and the energy there."""

    def __init__(self, source: FlatSurface, target: FlatSurface) -> None:
        surface = source.surface
        self.chart, self.target = source.chart, target
        self.rest = _core.volume.rest_triangles(
            surface.V, surface.F, target.surface.area / surface.area
        )
        self.weights = surface.face_areas / surface.area
        self.held = np.zeros(surface.n_vertices, bool)
        self._edges = surface.edges
        self._reach: NDArray[np.float64] | None = None

    def place(self, y: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        points = self.target.points(y)
        value = _core.registration.match_value(self.chart, y, points, self.rest, self.weights)
        return points, value if math.isfinite(value) else math.inf

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
        free = np.flatnonzero(np.repeat(~self.held, 2))
        step = np.zeros(2 * len(y)) if wish is None else wish.ravel().copy()
        pull = gradient if wish is None else hessian @ step
        step[free] = damped_solve(pull[free], hessian[free][:, free])
        return step.reshape(-1, 2)

    def one_by_one(
        self, y: NDArray[np.float64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Every vertex that is not held moved by itself, if that lowers the energy."""
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


def match_surfaces(
    source: FlatSurface,
    target: FlatSurface,
    y: NDArray[np.float64],
    landmarks: NDArray[np.int32],
    *,
    max_iter: int,
    tol: float,
    progress: Progress | None,
) -> Match:
    """Least distortion of area and shape, landmarks held, no face turning over in the chart.

    Parameters
    ----------
    source, target : FlatSurface
        ``source`` in coordinates changed by the gauge.
    y : ndarray, shape (n, 2)
        Start, free of folds; landmarks need not be where they belong, they are drawn there first.
    landmarks : ndarray of int32, shape (k, 2)
        Surface vertices of source and target.
    max_iter : int
        Most steps.
    tol : float
        Another kind of step is tried when one lowers the energy by no more than this share; the
        iteration stops when a round of all kinds lowers it by no more than ten times as much.
    progress : Progress, optional

    Returns
    -------
    Match

    Raises
    ------
    LandmarkError
        If the landmarks cannot be reached without a fold; ``ids`` are the two at fault.
    SolverError
        If the start is folded.
    """
    clock = time.perf_counter()
    problem = SurfaceProblem(source, target)
    points, energy = problem.place(y)
    if not math.isfinite(energy):
        raise SolverError("the start of the boundary map is folded")
    history: list[IterationRecord] = []

    def record(step: float) -> None:
        history.append(
            IterationRecord(
                stage="match", iteration=len(history), energy=energy, step=step, flips=0,
                seconds=time.perf_counter() - clock,
            )
        )  # fmt: skip
        report(progress, "match", len(history) - 1, max_iter, energy=energy)

    record(math.nan)
    # The free optimum first: it is the best place to draw the landmarks from.
    ids = landmarks[:, 0]
    for holding in (False, True) if len(ids) else (False,):
        if holding:
            problem.held[ids] = True
            goals = target.turns[landmarks[:, 1]]
            y, points, energy = _draw(problem, y, points, energy, ids, goals, history)
        stalled, at_start = 0, energy
        for _ in range(max_iter):
            kind, before = _KINDS[stalled % len(_KINDS)], energy
            alpha = 0.0
            if kind == "one by one":
                y, points = problem.one_by_one(y, points)
                energy = problem.place(y)[1]
                record(math.nan)
            else:
                step = problem.newton_step(y, points, kind == "tangent")
                taken = _search(problem, y, step, energy)
                if taken is not None:
                    alpha, y, points, energy = taken
                    record(alpha)
            if alpha < _SHORT or before - energy <= tol * before:
                stalled += 1
                if stalled % len(_KINDS) == 0:
                    if at_start - energy <= _ROUND_TOL * tol * at_start:
                        break
                    at_start = energy
    return Match(y, points, tuple(history))


def _search(
    problem: SurfaceProblem, y: NDArray[np.float64], step: NDArray[np.float64], energy: float
) -> tuple[float, NDArray[np.float64], NDArray[np.float64], float] | None:
    """Longest of 1, 1/2, ... of the step that lowers the energy."""
    alpha = 1.0
    while alpha >= _SHORTEST:
        moved = y + alpha * step
        points, value = problem.place(moved)
        if value < energy:
            return alpha, moved, points, value
        alpha *= 0.5
    return None


def _relaxed(
    problem: SurfaceProblem, y: NDArray[np.float64], points: NDArray[np.float64], energy: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """One step of every kind, the landmarks staying where they are."""
    y, points = problem.one_by_one(y, points)
    energy = problem.place(y)[1]
    for tangent in (False, True):
        taken = _search(problem, y, problem.newton_step(y, points, tangent), energy)
        if taken is not None:
            _, y, points, energy = taken
    return y, points, energy


def _draw(
    problem: SurfaceProblem,
    y: NDArray[np.float64],
    points: NDArray[np.float64],
    energy: float,
    ids: NDArray[np.int32],
    goals: NDArray[np.float64],
    history: list[IterationRecord],
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Move the landmarks to their goals, the rest following, as far at a time as nothing folds."""
    stuck = 0
    while stuck < _STUCK:
        left = wrapped(goals - y[ids])
        if np.abs(left).max() <= 1e-14:
            return y, points, energy
        wish = np.zeros_like(y)
        wish[ids] = left
        step = problem.newton_step(y, points, False, wish)
        alpha = 1.0
        while alpha >= _SHORTEST:
            moved = y + alpha * step
            if alpha == 1.0:
                moved[ids] = y[ids] + left
            points_there, value = problem.place(moved)
            if value < energy + _RISE:
                y, points, energy = moved, points_there, value
                break
            alpha *= 0.5
        history.append(
            IterationRecord(
                stage="match", iteration=len(history), energy=energy, step=alpha, flips=0
            )
        )
        stuck = stuck + 1 if alpha < _SHORT else 0
        if alpha < _FAR:
            y, points, energy = _relaxed(problem, y, points, energy)
    far = int(np.argmax(np.abs(left).max(axis=1)))
    gap = y[ids] - y[ids[far]]
    distance = np.linalg.norm(gap - np.round(gap), axis=1)
    distance[far] = np.inf
    other = int(np.argmin(distance)) if len(ids) > 1 else far
    raise LandmarkError(
        f"landmark {far} cannot be reached without folding the surface; its nearest neighbour is "
        f"landmark {other}: correct or drop one of the two",
        (far, other),
    )
