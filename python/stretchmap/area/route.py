"""From a flat chart to angles on the torus: areas in the chart, phase, then level by level."""

from __future__ import annotations

import dataclasses
import logging
import time
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..base.progress import Progress
from ..maps.history import IterationRecord
from .balance import JAMMED, balance_areas
from .coarse import Folded, Level
from .finish import Pace, Steps, finish_areas, unfold_faces
from .flat import start_angles
from .search import Ratio, search_phase
from .sem import minimize_stretch

_log = logging.getLogger("stretchmap")

Finish = Literal["ring", "face", "none"]


@dataclass(frozen=True)
class Route:
    """What `area_map` was asked for; `shape` weighs shapes against areas in the chart."""

    phase: float | None
    ratio: Ratio | float
    sem_iter: int
    finish: Finish
    steps: Steps
    shape: float = 0.0


@dataclass
class Made:
    """Angles of the finest surface, and how they came about."""

    angles: NDArray[np.float64]
    phase: float
    ratio: float
    history: list[IterationRecord]
    converged: bool = True
    reason: str = "stretch energy at rest"
    seconds: dict[str, float] = field(default_factory=dict)

    def add(self, records: list[IterationRecord], finest: bool) -> None:
        """The records of one more level."""
        self.history += records if finest else [_of_coarse(record) for record in records]


def follow(route: Route, stack: list[Level], progress: Progress | None) -> Made:
    """Angles of the first level: by way of the last, or without if they fold on the way up."""
    try:
        return _climb(route, stack, progress)
    except Folded:
        _log.info("a coarser surface's map folds faces of this one: mapped without it")
        return _climb(route, [dataclasses.replace(stack[0], coarse=None)], progress)


def _climb(route: Route, stack: list[Level], progress: Progress | None) -> Made:
    clock = time.perf_counter()
    turns, found, records = _equal_areas(route, stack[-1], progress)
    phase, ratio, _ = found
    middle = time.perf_counter()
    made = Made(start_angles(stack[-1].chart, turns, phase, ratio), phase, ratio, [])
    made.add(records, len(stack) == 1)
    made.seconds = {"sem": middle - clock, "phase": time.perf_counter() - middle}
    if route.finish == "none":
        return made
    clock = time.perf_counter()
    pace = Pace()
    for level in reversed(stack):
        finest = level is stack[0]
        steps = route.steps if finest else route.steps.rough()
        if level.coarse is not None:
            made.angles = level.prolonged(made.angles, ratio)
            pace = pace.finer()
        newton = level.newton(made.angles, ratio)
        made.add(unfold_faces(newton, progress), finest)
        records, made.converged, made.reason = finish_areas(
            newton, finest and route.finish == "ring", steps, progress, pace
        )
        made.add(records, finest)
        made.angles = newton.angles
    made.seconds["finish"] = time.perf_counter() - clock
    return made


def _equal_areas(
    route: Route, level: Level, progress: Progress | None
) -> tuple[NDArray[np.float64], tuple[float, float, float], list[IterationRecord]]:
    """Turns with nearly equal areas; phase, ratio and energy of their image; records."""
    surface, phase, ratio = level.surface, route.phase, route.ratio
    turns, history = minimize_stretch(level, route.sem_iter, progress)
    found = search_phase(surface, turns, level.aspect, phase, ratio)
    if route.shape or (route.sem_iter and history[-1].energy > 1.0 + JAMMED):
        balanced, records = balance_areas(level, route.shape, progress)
        other = search_phase(surface, balanced, level.aspect, phase, ratio)
        # Where only few places are jammed, areas come at the price of all shapes.
        if route.shape or other[-1] < found[-1]:
            return balanced, other, history + records
    return turns, found, history


def _of_coarse(record: IterationRecord) -> IterationRecord:
    return dataclasses.replace(record, stage="coarse")
