"""From a flat chart to angles on the torus: areas in the chart, phase, then level by level."""

from __future__ import annotations

import dataclasses
import logging
import time
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.budget import Budget
from ..base.progress import Progress
from ..maps.history import IterationRecord
from .balance import FAIR, JAMMED, STEPS, balance_areas
from .coarse import Folded, Level
from .finish import FEW_UNFOLD_STEPS, Pace, Steps, finish_areas, unfolded
from .flat import start_angles
from .search import Ratio, search_phase
from .sem import at_rest, minimize_stretch
from .work import Work

_log = logging.getLogger("stretchmap")

_LEAST_STEPS = 20  # areas get, however little work is left
EASING = 25  # steps towards shapes from where areas are equal

Finish = Literal["ring", "face", "none"]
_Turns = tuple[NDArray[np.float64], list[IterationRecord]]


@dataclass(frozen=True)
class Route:
    """What `area_map` was asked for; `shape` weighs shapes against areas in the chart.

    A ratio of None is that of the conformal map where nothing speaks against it.
    """

    phase: float | None
    ratio: Ratio | float | None
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
    converged: bool = False
    reason: str = ""
    seconds: dict[str, float] = field(default_factory=dict)

    def add(self, records: list[IterationRecord], finest: bool) -> None:
        """The records of one more level."""
        self.history += records if finest else [_of_coarse(record) for record in records]


class EqualAreas:
    """Turns of a level with nearly equal areas; they do not depend on phase and ratio, so each kind
    is made once.

    Parameters
    ----------
    level : Level
    progress : Progress or None
    clock : Budget, optional
        Steps end when its time is spent.
    """

    def __init__(
        self, level: Level, progress: Progress | None, clock: Budget | None = None
    ) -> None:
        self.level = level
        self._progress = progress
        self._clock = clock
        self._stretched: dict[int, _Turns] = {}
        self._balanced: dict[float, _Turns] = {}

    def stretched(self, sem_iter: int) -> _Turns:
        """By so many steps (4.5); with records."""
        if sem_iter not in self._stretched:
            self._stretched[sem_iter] = minimize_stretch(self.level, sem_iter, self._progress)
        return self._stretched[sem_iter]

    def balanced(self, shape: float) -> _Turns:
        """By Newton steps, with that weight of shape; with records."""
        if shape not in self._balanced:
            self._balanced[shape] = self._balance(self.level, shape)
        return self._balanced[shape]

    def shaped(self, shape: float, most: int = STEPS) -> None:
        """Make those with that weight of shape, if nearly equal areas have been made before.

        From there it is half the way to the same minimum, where a conformal map is far from both.
        """
        if 0.0 in self._balanced and shape not in self._balanced:
            level = dataclasses.replace(self.level, turns=self._balanced[0.0][0])
            self._balanced[shape] = self._balance(level, shape, most)

    def eased(self, shape: float, turns: NDArray[np.float64]) -> _Turns:
        """Others moved on by Newton steps with that weight of shape; with records."""
        level = dataclasses.replace(self.level, turns=turns)
        found = self._balance(level, shape, EASING)
        # As good a chart as any with that weight, and there already.
        self._balanced.setdefault(shape, found)
        return found

    def _balance(self, level: Level, shape: float, most: int = STEPS) -> _Turns:
        return balance_areas(level, shape, self._progress, most, self._clock)


def follow(
    route: Route,
    stack: list[Level],
    progress: Progress | None,
    equal: EqualAreas | None,
    work: Work,
) -> Made:
    """Angles of the first level: by way of the last, or without if they fold on the way up.

    ``equal`` is that of the last level, if there is one already. What stays folded is not finished.
    """
    try:
        return _climb(
            route, stack, equal or EqualAreas(stack[-1], progress, work.clock), progress, work
        )
    except Folded:
        _log.info("a coarser surface's map folds faces of this one: mapped without it")
        finest = dataclasses.replace(stack[0], coarse=None)
        return _climb(route, [finest], EqualAreas(finest, progress, work.clock), progress, work)


def _climb(
    route: Route,
    stack: list[Level],
    equal: EqualAreas,
    progress: Progress | None,
    work: Work,
) -> Made:
    clock = time.perf_counter()
    turns, found, records = best_turns(route, equal)
    phase, ratio, _ = found
    middle = time.perf_counter()
    made = Made(start_angles(stack[-1].chart, turns, phase, ratio), phase, ratio, [])
    made.add(records, len(stack) == 1)
    made.seconds = {"sem": middle - clock, "phase": time.perf_counter() - middle}
    if route.finish == "none":
        made.converged, made.reason = _unfinished(records)
        return made
    clock = time.perf_counter()
    # What the chart's solves used is in pieces, and the factors to come are large.
    _core.base.give_free_memory_back()
    pace = Pace()
    for level in reversed(stack):
        finest = level is stack[0]
        steps = route.steps if finest else route.steps.rough()
        if level.coarse is not None:
            made.angles = level.prolonged(made.angles, ratio)
            pace = pace.finer()
        most, keep = FEW_UNFOLD_STEPS if finest else None, route.shape > 0.0
        newton, unfolding = unfolded(
            level, made.angles, ratio, progress, keep=keep, most=most, work=work if finest else None
        )
        made.add(unfolding, finest)
        if finest:
            if not newton.least_facing() > 0.0:
                made.angles, made.converged, made.reason = newton.angles, False, "faces stay folded"
                break
            affordable = min(work.steps(least=_LEAST_STEPS), work.most)
            steps = dataclasses.replace(steps, max_iter=min(steps.max_iter, affordable))
            work.begin(newton, work.n_faces)
        records, made.converged, made.reason = finish_areas(
            newton, finest and route.finish == "ring", steps, progress, pace, work.late
        )
        made.add(records, finest)
        made.angles = newton.angles
        if finest:
            work.spend(len(records))
    made.seconds["finish"] = time.perf_counter() - clock
    return made


def best_turns(
    route: Route, equal: EqualAreas
) -> tuple[NDArray[np.float64], tuple[float, float, float], list[IterationRecord]]:
    """Turns with nearly equal areas; phase, ratio and energy of their image; records."""
    level, phase, ratio = equal.level, route.phase, route.ratio or "conformal"
    turns, history = equal.stretched(route.sem_iter)
    found = search_phase(level.surface, turns, level.aspect, phase, ratio)
    if route.shape or (route.sem_iter and history[-1].energy > 1.0 + JAMMED):
        balanced, records = equal.balanced(route.shape)
        other = search_phase(level.surface, balanced, level.aspect, phase, ratio)
        # Where only few places are jammed, areas come at the price of all shapes.
        if route.shape or other[-1] < found[-1]:
            return balanced, other, history + records
    return turns, found, history


def _unfinished(records: list[IterationRecord]) -> tuple[bool, str]:
    """Whether the chart is what its steps lead to, and in words."""
    last = records[-1]
    if last.stage == "balance":
        fair = last.element_std < FAIR
        return fair, f"areas in the chart are {'nearly' if fair else 'not nearly'} equal"
    if at_rest(records):
        return True, "stretch energy at rest"
    return False, f"stretch energy not at rest after step {last.iteration}, see sem_iter"


def _of_coarse(record: IterationRecord) -> IterationRecord:
    return dataclasses.replace(record, stage="coarse")
