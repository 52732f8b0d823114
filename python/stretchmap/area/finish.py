"""x"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from .. import _core
from ..base.progress import Progress, report
from ..maps.history import IterationRecord

if TYPE_CHECKING:
    pass

# Weights of the finishing energy against which the area term grows.
_SHAPE = 0.1
_CHART = 1.0
_GROWTH = 4.0
_FULL_STEP = 0.5  # a step at least this long lets the area term grow
_STALLED = 3  # steps in a row without any length end the iteration
_RATIO_GOAL = 10.0  # largest |ratio - 1| allowed, in units of tol
_MARGIN = 0.8  # face SD, in units of tol, where the Newton steps end: the rings need some room
_FAIR = 4.0  # from this face SD on, in units of tol, the shape budget counts
_RING_WEIGHT = 1e4  # most weight of the area term in the projection of the rings


def finish_areas(
    newton: _core.area.SurfaceNewton,
    rings: bool,
    max_iter: int,
    tol: float,
    shape_budget: float,
    progress: Progress | None,
) -> tuple[list[IterationRecord], bool, str]:
    """Newton steps on the polyhedral areas: records, converged, reason."""
    start = time.perf_counter()
    history: list[IterationRecord] = []
    weight, stalled, least = 1.0, 0, math.inf
    taken = None
    reason = "most steps done"
    for iteration in range(max_iter + 1):
        if iteration:
            taken = newton.step(1.0, _SHAPE / weight, _CHART / weight)
            stalled = 0 if taken.step > 0.0 else stalled + 1
            weight *= _GROWTH if taken.step >= _FULL_STEP else 1.0
        figures = newton.figures()
        least = min(least, figures.angle_mean)
        history.append(_record(iteration, taken, figures, start))
        report(progress, "area", iteration, max_iter, face_sd=figures.face_sd)
        if figures.face_sd <= _MARGIN * tol and _within(figures, tol):
            break
        if stalled == _STALLED:
            reason = "no step lowers the energy"
            break
        if figures.face_sd <= _FAIR * tol and figures.angle_mean > shape_budget * least:
            reason = "shape budget spent"
            break
    weight = min(weight, _RING_WEIGHT)
    if rings and newton.project_rings(
        1.0, _SHAPE / weight, _CHART / weight, tol, _RATIO_GOAL * tol
    ):
        history.append(_record(len(history), None, newton.figures(), start))
    figures = newton.figures()
    if _within(figures, tol):
        return history, True, "areas within tol"
    return (
        history,
        False,
        (f"{reason}, face SD {figures.face_sd:.2e}, worst {figures.face_error:.2e}, tol {tol:.2e}"),
    )


def _within(figures: _core.area.SurfaceFigures, tol: float) -> bool:
    return figures.face_sd <= tol and figures.face_error <= _RATIO_GOAL * tol


def _record(
    iteration: int,
    taken: _core.area.GlideStep | None,
    figures: _core.area.SurfaceFigures,
    start: float,
) -> IterationRecord:
    return IterationRecord(
        stage="newton",
        iteration=iteration,
        energy=math.nan if taken is None else taken.after,
        step=math.nan if taken is None else taken.step,
        residual=math.nan if taken is None else taken.decrement,
        flips=figures.flips,
        ring_std=figures.ring_sd,
        element_std=figures.face_sd,
        seconds=time.perf_counter() - start,
    )
