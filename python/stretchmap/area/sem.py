"""Stretch energy minimisation, Algorithm 4.1, in the equal-area chart."""

from __future__ import annotations

import logging
import math
import time

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress, report
from ..errors import SolverError
from ..maps.history import IterationRecord
from .coarse import Level

_log = logging.getLogger("stretchmap")

_REST = 1e-4  # share of the energy; a step that lowers it by no more was the last


def minimize_stretch(
    level: Level, max_iter: int, progress: Progress | None
) -> tuple[NDArray[np.float64], list[IterationRecord]]:
    """Steps of (4.5) in the chart until the energy is at its bound or stops falling."""
    start = time.perf_counter()
    sem = _core.area.SurfaceSem(level.chart, level.surface.face_areas, level.aspect, level.turns)
    history: list[IterationRecord] = []
    taken = None
    for iteration in range(max_iter + 1):
        if iteration:
            try:
                taken = sem.step()
            except SolverError as error:  # areas beyond rounding; others go on from here
                _log.info("stretch energy steps end after %d: %s", iteration - 1, error)
                break
        measured = sem.measures()
        history.append(
            IterationRecord(
                stage="sem",
                iteration=iteration,
                energy=measured.energy,
                step=math.nan if taken is None else taken.step,
                residual=math.nan if taken is None else taken.residual,
                flips=measured.flips,
                ring_std=measured.ring_std,
                element_std=measured.face_std,
                seconds=time.perf_counter() - start,
            )
        )
        report(progress, "area", iteration, max_iter, energy=measured.energy, flips=measured.flips)
        if at_rest(history):
            break
    return sem.turns, history


def at_rest(history: list[IterationRecord]) -> bool:
    """Whether the last step did not lower the energy any more."""
    before, last = history[-2:] if len(history) > 1 else (None, history[-1])
    return before is not None and before.energy - last.energy <= _REST * last.energy
