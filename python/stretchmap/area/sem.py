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
        if iteration and history[-2].energy - measured.energy <= 1e-4 * measured.energy:
            break
    return sem.turns, history
