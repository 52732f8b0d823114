"""The boundary map of a registration: landmarks first, then the least distortion of the surface."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.progress import Progress, report
from ..base.torus import wrapped
from ..errors import LandmarkError, SolverError
from ..maps.history import IterationRecord
from .flat_torus import FlatSurface
from .surface_problem import SurfaceProblem

__all__ = ["Match", "match_surfaces"]

_SHORTEST = 1e-3  # steps shorter than this make no progress
_RISE = 1.0  # energy that may be spent on one step towards the landmarks; 0 for an isometry
_FAR = 0.25  # a shorter step towards the landmarks calls for a relaxation before the next
_STUCK = 12  # steps too short to get anywhere, with a relaxation after each
_SHORT = 0.02  # a step shorter than this asks for another kind of step
# Surfaces have edges, where the energy has kinks and a few faces block the step of all others:
# after the two kinds of Newton step, vertices are moved one by one.
_KINDS = ("chord", "tangent", "one by one")
_KIND_TOL = 5.0  # times tol: a step that gains no more asks for another kind, which may gain much
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
        Another kind of step is tried when one lowers the energy by no more than five times this
        share; the iteration stops when a round of all kinds lowers it by no more than ten times it.
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
                y, points, energy = _moved_one_by_one(problem, y, points, energy)
                record(math.nan)
            else:
                step = problem.newton_step(y, points, kind == "tangent")
                taken = _search(problem, y, step, energy)
                if taken is not None:
                    alpha, y, points, energy = taken
                    record(alpha)
            if alpha < _SHORT or before - energy <= _KIND_TOL * tol * before:
                stalled += 1
                if stalled % len(_KINDS) == 0:
                    if at_start - energy <= _ROUND_TOL * tol * at_start:
                        break
                    at_start = energy
    return Match(y, points, tuple(history))


def _search(
    problem: SurfaceProblem, y: NDArray[np.float64], step: NDArray[np.float64], energy: float
) -> tuple[float, NDArray[np.float64], NDArray[np.float64], float] | None:
    """Longest of 1, 1/2, ... of the step that lowers the energy; where few faces would fold, of one
    that is shortened at these alone, if that is lower."""
    best, alpha = None, 1.0
    while alpha >= _SHORTEST and best is None:
        moved = y + alpha * step
        points, value = problem.place(moved)
        if value < energy:
            best, energy = (alpha, moved, points, value), value
        alpha *= 0.5
    alpha, least = 1.0, _SHORT if best is None else best[0]
    while least < alpha:
        moved = y + problem.unfolded(y, alpha * step)
        points, value = problem.place(moved)
        if value < energy:
            return alpha, moved, points, value
        alpha *= 0.5
    return best


def _moved_one_by_one(
    problem: SurfaceProblem, y: NDArray[np.float64], points: NDArray[np.float64], energy: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Where vertices move to by themselves, unless the target's half rises by more than is won."""
    moved, there = problem.one_by_one(y, points)
    value = problem.place(moved)[1]
    return (moved, there, value) if value < energy else (y, points, energy)


def _relaxed(
    problem: SurfaceProblem, y: NDArray[np.float64], points: NDArray[np.float64], energy: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """One step of every kind, the landmarks staying where they are."""
    y, points, energy = _moved_one_by_one(problem, y, points, energy)
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
                break
            alpha *= 0.5
        least, more = max(alpha, _SHORT), 1.0
        while alpha < _FAR and more > least:
            # Few faces may be in the way of all: the others go ahead, and these have room then.
            parted = y + problem.unfolded(y, more * step)
            points_parted, value_parted = problem.place(parted)
            if value_parted < energy + _RISE:
                alpha, moved, points_there, value = more, parted, points_parted, value_parted
                break
            more *= 0.5
        if alpha >= _SHORTEST:
            y, points, energy = moved, points_there, value
        history.append(
            IterationRecord(
                stage="match", iteration=len(history), energy=energy, step=alpha, flips=0
            )
        )
        remaining = np.abs(wrapped(goals - y[ids])).sum()
        stuck = stuck + 1 if remaining > (1.0 - _SHORT) * np.abs(left).sum() else 0
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
