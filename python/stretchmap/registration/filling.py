"""The inside of a registration: from the boundary laid on the target or, where that serves badly,
by way of the solid torus."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.budget import Budget
from ..base.progress import Progress, report
from ..mesh.meshes import TetMesh
from ..volume.engine import solve
from ..volume.options import FillOptions
from ..volume.problem import Outcome, VolumeProblem
from .boundary import BoundaryWays, Laid
from .composed import composed
from .embed import EmbeddedBoundary
from .flat_torus import Gauge

__all__ = ["Filled", "fill_boundary", "fill_either_way"]

_log = logging.getLogger("stretchmap")

# Shares of the time for the first way, and of what is left then for the two maps of the other one.
_FIRST, _MAPS = 0.4, 0.7
_FAR_OFF = 0.5  # SD of the volume ratios from which on the first way does not get the rest
_WORTH = 0.1  # share of the time; with less left nothing is gone on with


@dataclass(frozen=True, eq=False)
class Filled:
    """A boundary, and what became of it and the inside.

    Attributes
    ----------
    boundary : EmbeddedBoundary
    gauge : Gauge
    outcome : Outcome
    """

    boundary: EmbeddedBoundary
    gauge: Gauge
    outcome: Outcome

    def rank(self, volume: float) -> tuple[int, float]:
        """Inverted tets or, without any, the mean of abs(ratio - 1) for a target of that volume."""
        problem = self.outcome.problem
        T = problem.solid.T
        inverted = len(_core.certificate.not_positive_tets(problem.x, T))
        if inverted:
            return inverted, 0.0
        shares = _core.mesh.tet_volumes(problem.solid.V, T) / problem.solid.volume
        images = _core.mesh.tet_volumes(problem.x, T) * (problem.length**3 / volume)
        return inverted, float(np.abs(images / shares - 1.0).mean())


class _Trial(Budget):
    """A part of the time, and all of it once no tet is inverted and volumes are not far off."""

    def __init__(self, whole: Budget, progress: Progress | None) -> None:
        super().__init__(_FIRST * whole.left)
        self._whole, self._progress, self.goes_well = whole, progress, False

    def note(self, stage: str, done: int, total: int, **values: float) -> None:
        """Progress of what is tried."""
        self.goes_well = not values["flips"] and values["element_std"] < _FAR_OFF
        report(self._progress, stage, done, total, **values)

    @property
    def left(self) -> float:
        """Seconds."""
        return self._whole.left if self.goes_well else super().left


def fill_boundary(
    boundary: EmbeddedBoundary,
    gauge: Gauge,
    target: TetMesh,
    options: FillOptions,
    *,
    pinned: NDArray[np.int32],
    glide: bool,
    budget: Budget,
    progress: Progress | None,
) -> Filled:
    """With the boundary as it is or, if it may ``glide``, gliding from there but for ``pinned``."""
    problem = VolumeProblem.of(
        boundary.split.solid,
        boundary.points,
        ground=target.surface,
        pinned=pinned,
        refine=options.refine,
    )
    outcome = solve(problem, options, glide=glide, budget=budget, progress=progress)
    return Filled(boundary, gauge, outcome)


def fill_either_way(
    source: TetMesh,
    target: TetMesh,
    waiting: list[Laid],
    ways: BoundaryWays,
    options: FillOptions,
    budget: Budget,
    progress: Progress | None,
) -> Filled | None:
    """`fill_boundary` without landmarks, gliding; what a part of the time does not do is tried with
    the boundary laid in other ways, then from the volume maps of both solids, and the best map
    counts.

    None if the boundary crosses itself and there is no such map.

    Parameters
    ----------
    source, target : TetMesh
    waiting : list of Laid
        The source's boundary on the target's, what is to be tried first first.
    ways : BoundaryWays
    options : FillOptions
    budget : Budget
    progress : Progress or None
    """
    best: Filled | None = None
    goes_well = short = False
    for way in _in_turn(waiting, ways, budget):
        if way.crosses:
            continue
        trial = _Trial(budget, progress)
        found = fill_boundary(
            way.embedded, way.gauge, target, options,
            pinned=np.zeros(0, np.int32), glide=True, budget=trial, progress=trial.note,
        )  # fmt: skip
        best = _better(best, found, target)
        goes_well = best.outcome.converged or trial.goes_well
        short = budget.left < _WORTH * budget.seconds
        if goes_well or short:
            break
    if not goes_well and not short:
        _log.info("once more, by way of the solid torus")
        begin = composed(source, target, options, budget.share(_MAPS), progress)
        if begin is not None:
            outcome = solve(begin.problem, options, glide=True, budget=budget, progress=progress)
            best = _better(best, Filled(begin.boundary, begin.gauge, outcome), target)
    if best is None or best.outcome.converged or budget.left < _WORTH * budget.seconds:
        return best
    outcome = solve(
        best.outcome.problem, options, glide=True, budget=budget, resumed=True, progress=progress
    )
    history = best.outcome.history + outcome.history
    more = dataclasses.replace(best, outcome=dataclasses.replace(outcome, history=history))
    return more if more.rank(target.volume) <= best.rank(target.volume) else best


def _in_turn(waiting: list[Laid], ways: BoundaryWays, budget: Budget) -> Iterator[Laid]:
    """What was laid, then what other ways lead to, which is not looked for before."""
    yield from waiting
    yield from ways.others(budget)


def _better(one: Filled | None, other: Filled, target: TetMesh) -> Filled:
    """The one with fewer inverted tets, or volumes kept better; of equals the first."""
    if one is None or other.rank(target.volume) < one.rank(target.volume):
        return other
    return one
