"""Equal areas in the flat chart where the fixed point of Algorithm 4.1 jams.

A conformal map of a body with a small handle gives most of the chart to the handle: area ratios
over nine orders. A step of (4.5) then ends at the first face about to fold, and so do all that
follow. Newton steps towards areas a bounded factor away get there (chart_newton.hpp).
"""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.budget import Budget
from ..base.progress import Progress, report
from ..maps.history import IterationRecord
from .coarse import Level

# Excess of E_S over its bound, the variance of the ratios, up to which (4.5) has done its work.
JAMMED = 1e-2
STEPS = 250
_SHAPE = 0.1  # weight of the shape term, that of the area term being one
_GROWTH, _MOST_WEIGHT = 4.0, 64.0  # of the area term against it
_REACH, _MOST_REACH = 4.0, 1e6  # factors of area asked for in one step
_LONG, _FULL = 0.5, 0.9  # steps that let the weight, the reach grow
_NEARLY = 0.95  # share of the area within reach from which on the weight grows
FAIR = 0.1  # face SD the polyhedral steps can start from
_SETTLED = 0.02  # share of the energy; a step that lowers it by less was the last
# So many steps in a row that end above the lowest energy so far, less that share, are the last as
# well: weights follow the areas, and both can go round in circles.
_CIRCLING = 4
_TAKEN_BACK = 6  # times the reach, where the weight of shape stays: it goes up and down from there


def balance_areas(
    level: Level,
    shape: float,
    progress: Progress | None,
    most: int = STEPS,
    clock: Budget | None = None,
) -> tuple[NDArray[np.float64], list[IterationRecord]]:
    """Turns (n, 2) with nearly equal area ratios, from the level's; records.

    Unless `shape` is zero, the weight of the shape term stays at it, and areas are left as far from
    equal as that makes them. At most ``most`` steps, and none once a clock's time is spent.
    """
    start = time.perf_counter()
    newton = _core.area.ChartNewton(level.chart, level.reference, level.aspect, level.turns)
    history: list[IterationRecord] = []
    lightest = shape or _SHAPE / _MOST_WEIGHT
    shape, reach = shape or _SHAPE, _REACH
    lowest, since, taken_back, grows = math.inf, 0, 0, False
    keeping = shape == lightest
    for iteration in range(1, most + 1):
        if clock is not None and clock.spent:
            break
        taken = newton.step(1.0, shape, reach)
        measured = newton.measures()
        history.append(
            IterationRecord(
                stage="balance",
                iteration=iteration,
                energy=taken.after,
                step=taken.step,
                residual=taken.decrement,
                flips=measured.flips,
                ring_std=measured.ring_std,
                element_std=measured.face_std,
                seconds=time.perf_counter() - start,
            )
        )
        report(progress, "area", iteration, most, face_std=measured.face_std)
        done = taken.before - taken.after < _SETTLED * taken.before
        if taken.step == 0.0:
            break
        if taken.within > 1.0 - 1e-9:
            since = 0 if taken.after < (1.0 - _SETTLED) * lowest else since + 1
            lowest = min(lowest, taken.after)
            if done or since == _CIRCLING or measured.face_std < FAIR:
                break
        if taken.step > _LONG and taken.within > _NEARLY and shape > lightest:
            shape, lowest, since = max(shape / _GROWTH, lightest), math.inf, 0
        if taken.step >= _FULL:
            reach, grows = min(2.0 * reach, _MOST_REACH), True
        else:
            reach, taken_back, grows = max(_REACH, 0.5 * reach), taken_back + grows, False
        if keeping and taken_back == _TAKEN_BACK:
            break
    return newton.turns, history
