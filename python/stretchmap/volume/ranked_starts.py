"""Starts of the certified route in the order in which they are tried, chosen by measurement."""

from __future__ import annotations

import itertools
import logging
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .. import _core
from ..base.budget import Budget
from ..base.progress import Progress
from ..errors import OrientationError
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh
from .boundary_starts import boundary_starts
from .options import VolumeOptions
from .problem import VolumeProblem
from .start import started

__all__ = ["Start", "ranked_starts"]

_log = logging.getLogger("stretchmap")

# Share of tets the harmonic map turns over from which on it tells more about a start than the order
# in which they are made: of a thin shell it is a fifth from one, and a thousandth from another.
_MANY, _FEW = 0.05, 0.01
_CLEARLY = 0.1  # share of what the first turns over that is few, too
_COMPARED = 4  # unless one before turns few over
_COMPARING = 0.3  # share of the time left that may go into them
# Share of the time left that untangling may take from each in turn; half of it if the boundary is
# folded, more if it has been compared with others, as there hardly is a better one then.
_PATIENCE = (0.4, 0.6, 0.6, 0.6, 1.0)
_PATIENCE_WITH_BEST = 0.8


@dataclass(frozen=True, eq=False)
class Start:
    """A map of the boundary or of all, and the problem that begins from it."""

    map: MapResult
    problem: VolumeProblem
    patience: float = 1.0  # share of the time left that untangling may take
    seconds: float = 0.0  # that the harmonic map took
    others: float = 0.0  # seconds that those took it was compared with
    hasty: bool = False  # whether it makes room for the next where tets stay stuck
    resumed: bool = False  # whether it is one that did

    @property
    def ratio(self) -> float:
        """R / r of the torus."""
        torus = self.map.torus
        assert torus is not None
        return torus.ratio

    @property
    def inverted(self) -> float:
        """Share of the tets that the harmonic map turns over."""
        volumes = _core.mesh.tet_volumes(self.problem.x, self.problem.solid.T)
        return float(np.mean(~(volumes > 0.0)))


def ranked_starts(
    solid: TetMesh,
    options: VolumeOptions,
    budget: Budget,
    *,
    glide: bool,
    progress: Progress | None,
) -> Iterator[Start]:
    """Those of `boundary_starts`; if the first turns many tets over, the best of a few comes first.

    A boundary that does not glide is kept in order: what counts there is how exact its areas are.

    Raises
    ------
    OrientationError
        No boundary encloses anything.
    """

    def begun() -> Iterator[Start]:
        failed, any_begun = None, False
        for found in boundary_starts(solid, options, glide=glide, budget=budget, progress=progress):
            clock = time.perf_counter()
            try:
                problem = VolumeProblem.of(
                    solid, found.image, torus=found.torus, refine=options.refine
                )
            except OrientationError as error:  # few faces can enclose nothing on one torus alone
                _log.info("one start less: %s", error)
                failed = failed or error
                continue
            problem = started(problem, solver=options.solver)
            patience = 1.0 if found.certificate.certified else 0.5
            any_begun = True
            yield Start(found, problem, patience, time.perf_counter() - clock, hasty=True)
        if failed is not None and not any_begun:
            raise failed

    starts = _best_first(begun(), budget) if glide else begun()
    for start, share in zip(
        starts, itertools.chain(_PATIENCE, itertools.repeat(1.0)), strict=False
    ):
        share = _PATIENCE_WITH_BEST if start.others else share
        yield replace(start, patience=start.patience * share)


def _best_first(starts: Iterator[Start], budget: Budget) -> Iterator[Start]:
    """As they come, but for the first few; those are two, and no more than time allows, if each
    takes as long as the one before. How long the first took tells nothing: it includes the search
    for a torus. Those that the best beats by far come after others that might have been compared.
    """
    few = [next(starts)]
    if few[0].inverted > _MANY:
        made, clock = 0.0, time.perf_counter()
        allowed, others = budget.share(_COMPARING), itertools.islice(starts, _COMPARED - 1)
        while made < (left := allowed.left) and (other := next(others, None)) is not None:
            few.append(other)
            if other.inverted <= max(_FEW, _CLEARLY * few[0].inverted):
                break
            made = left - allowed.left
        if len(few) > 1:
            few.sort(key=lambda start: start.inverted)
            # What gets stuck on one torus mostly does so on the same from another start.
            few[1:] = sorted(few[1:], key=lambda start: start.ratio == few[0].ratio)
            few[0] = replace(few[0], others=time.perf_counter() - clock)
    least = few[0].inverted
    beaten = [start for start in few[1:] if start.inverted > max(_MANY, least / _CLEARLY)]
    yield from few[: len(few) - len(beaten)]
    if beaten:
        yield from itertools.islice(starts, _COMPARED - len(few))
    yield from beaten
    yield from starts
