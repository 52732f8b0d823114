"""The best map within the work there is: of a finer surface, of the one given, or with shapes."""

from __future__ import annotations

import dataclasses
import logging
import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.progress import Progress
from ..base.torus import TWO_PI, Torus
from ..conformal.torus import conformal_torus
from ..errors import SolverError
from .coarse import Level
from .finer import ROUND_STEPS, STEPS_LEFT, Finer, goal, mapped_finer
from .finish import cut_short, finish_areas
from .result import AreaMap, mapped, moved, n_folded
from .route import EASING, EqualAreas, Made, Route, best_turns, follow
from .search import Ratio, search_phase
from .work import Work

_log = logging.getLogger("stretchmap")

# Weights of shape in the chart where equal areas leave faces folded: few edges round a branch span
# so much of the torus then that what lies between two rounds of them is cut off.
SHAPES = (1.0, 10.0, 100.0, 1e3)
# The same where the surface is to become finer. Areas are less equal in such a chart, so edges are
# halved for good only once they are nearly right: until then up to that sag is left.
_EASED = (0.01, 0.1, 1.0)
_COARSELY = 3.0
_AT_ONCE = 0.6  # share of all faces that there may be, that this may take
# Share of the work left for the surface as it is, until no face of a finer one is folded.
_RESERVED = 0.25
_RIGHT = 2.0  # times the tolerance
_HARDLY_MORE = 1.3  # times the faces there are
# Below it the hole of the torus all but closes: a small error of the ratio costs areas, which tell
# of it. What is tried first, so many times in all, and a step's most.
_SENSITIVE, _FATTER, _RATIOS, _FARTHEST = 1.1, 0.9, 5, 0.3


@dataclass(frozen=True)
class Finest:
    """A surface to be mapped, and what there is for it.

    Attributes
    ----------
    route : Route
    stack : list of Level
        The surface and its coarser ones.
    equal : EqualAreas
        Charts of the surface itself.
    torus : Torus or None
        Left out, it has the surface's area.
    work : Work
    progress : Progress or None
    """

    route: Route
    stack: list[Level]
    equal: EqualAreas
    torus: Torus | None
    work: Work
    progress: Progress | None

    def found(self, *, refine: bool) -> AreaMap:
        """The map of a surface as fine as there is work for, certified or not.

        If the ratio is left open: with the best for a fat torus, and, too, where areas stay off.
        """
        aspect = self.equal.level.aspect
        if self.route.ratio is None and conformal_torus(aspect).ratio < _SENSITIVE:
            return self._searched()._on_one_torus(refine=refine)
        found, steps = self._on_one_torus(refine=refine), self.route.steps
        right = found.certificate.certified
        right &= found.distortion.element_std <= _RIGHT * steps.tol
        alone = steps.balance == 1.0 and steps.max_iter >= ROUND_STEPS  # all that counts
        if right or not alone or self.route.ratio is not None or self.work.steps() < ROUND_STEPS:
            return found
        _log.info("areas stay off: once more with the best R / r")
        other = self._searched()._on_one_torus(refine=refine)

        def rank(each: AreaMap) -> tuple[bool, float]:
            return not each.certificate.certified, each.distortion.element_std

        return min(found, other, key=rank)

    def _searched(self) -> Finest:
        """The same with the best ratio."""
        return dataclasses.replace(self, route=dataclasses.replace(self.route, ratio="search"))

    def _on_one_torus(self, *, refine: bool) -> AreaMap:
        """The map with one ratio.

        A surface that is mapped by way of coarser ones has no chart of its own to begin with.
        """
        level, finer, coarse = self.equal.level, None, False
        if refine and len(self.stack) == 1:
            self.work.reserved = _RESERVED
            coarse, finer = self._finer_at_once()
            self.work.reserved = 0.0
            if finer is not None and finer.certificate.certified:
                return finer
        found = self._along(alone=not coarse)
        if self.route.ratio == "search" and found.ratio < _SENSITIVE:
            found = self._by_ratio(found)
        unfinished = not self._good(found) or cut_short(found.stop_reason)
        if finer is None and refine and unfinished and not n_folded(found):
            level = Level.of(level.surface, found.angles / TWO_PI, level.forms, level.aspect)
            start = Finer.of(level, found.angles, found.ratio)
            made = Made(
                found.angles, found.phase, found.ratio, list(found.history),
                found.converged, found.stop_reason, dict(found.seconds),
            )  # fmt: skip
            finer = self._finer(start, made)
        if finer is None or not finer.certificate.certified:
            return found
        if not found.certificate.certified:
            return finer
        return min(found, finer, key=lambda each: each.distortion.element_std)

    def _by_ratio(self, found: AreaMap) -> AreaMap:
        """With the ratio moved to where areas are right, if it does them good.

        Near a ratio of one the error is a multiple of that of ``log(R / r - 1)``: a step shows
        which way to go, and how far.
        """
        step, best = math.log(_FATTER), found
        for _ in range(_RATIOS):
            if best.converged or n_folded(best) or self.work.steps() < ROUND_STEPS:
                break
            route = dataclasses.replace(self.route, ratio=1.0 + (best.ratio - 1.0) * math.exp(step))
            other = dataclasses.replace(self, route=route)._along(alone=True)
            if n_folded(other):
                break
            before, after = (each.distortion.element_std for each in (best, other))
            if after < before:
                step, best = step * after / (before - after), other
            else:
                step *= -before / (before + after)
            step = float(np.clip(step, -_FARTHEST, _FARTHEST))
        return best

    @property
    def _wanted(self) -> float:
        """Face SD from which on edges need not be halved."""
        return goal(self.equal.level.surface, self.route.steps.tol)

    def _good(self, found: AreaMap) -> bool:
        return found.certificate.certified and found.distortion.element_std <= self._wanted

    def _finer_at_once(self) -> tuple[bool, AreaMap | None]:
        """Whether the surface is too coarse for its place in the chart; if so, a finer one's map.

        From a chart eased towards shapes: in one where areas alone count, faces can be needles by
        the thousand. Where that takes too many faces or leaves some folded, from charts eased
        further.
        """
        clock, work = time.perf_counter(), self.work
        level = self.equal.level
        turns, (phase, ratio, _), records = best_turns(self.route, self.equal)
        work.spend_in_chart(sum(record.stage == "balance" for record in records))
        if not Finer.wrapped(level, turns, phase, ratio).too_coarse():
            return False, None
        for shape in _EASED:
            if work.steps() < ROUND_STEPS:
                break
            turns, more = self.equal.eased(shape, turns)
            records = records + more
            work.spend_in_chart(len(more))
            fitted = self._fitted_best(turns)
            if fitted is not None:
                finer, phase = fitted
                seconds = {"sem": time.perf_counter() - clock}
                made = Made(finer.angles, phase, finer.ratio, records, seconds=seconds)
                found = self._finer(finer, made)
                if found is not None:
                    return True, found
        return True, None

    def _fitted_best(self, turns: NDArray[np.float64]) -> tuple[Finer, float] | None:
        """With the ratio asked for; if it is left open, that which needs fewer faces."""
        given = self.route.ratio
        fitted = self._fitted(turns, given or "conformal")
        if given is not None:
            return fitted
        if fitted is not None:
            n_faces = fitted[0].level.surface.n_faces
            if n_faces <= _HARDLY_MORE * self.equal.level.surface.n_faces:
                return fitted  # a search takes as long as it can save
        other = self._fitted(turns, "search")
        if fitted is None or other is None:
            return fitted or other
        return min(fitted, other, key=lambda each: each[0].level.surface.n_faces)

    def _fitted(
        self, turns: NDArray[np.float64], ratio: Ratio | float
    ) -> tuple[Finer, float] | None:
        """Edges halved that sag too much with that ratio, and the phase; None if too many do."""
        level, work = self.equal.level, self.work
        phase, ratio, _ = search_phase(level.surface, turns, level.aspect, self.route.phase, ratio)
        wrapped = Finer.wrapped(level, turns, phase, ratio)
        wrapped = dataclasses.replace(wrapped, affordable=work.most_faces(STEPS_LEFT[0]))
        finer = wrapped.fitted(_COARSELY, _AT_ONCE)
        work.spend_on_fitting((finer.level.surface if finer else level.surface).n_faces)
        return None if finer is None else (finer, phase)

    def _finer(self, start: Finer, made: Made) -> AreaMap | None:
        """The map of a surface with edges halved, None if faces stay folded."""
        steps, rings = self.route.steps, self.route.finish == "ring"
        found = mapped_finer(start, made, steps, self._wanted, rings, self.progress, self.work)
        if found is None:
            return None
        made, finer = found
        added = finer.added if finer.added.n_split else None
        return mapped(finer.level.surface, finer.level.forms, made, self.torus, added)

    def _along(self, *, alone: bool) -> AreaMap:
        """The map of the surface as it is, by rising weights of shape while faces are folded.

        Unless areas ``alone`` are worth a try, with some weight of shape at once.
        """
        level, work, found = self.equal.level, self.work, None
        folded = "faces folded where areas alone counted" if alone else "too coarse for equal areas"
        lost: SolverError | None = None
        for shape in (0.0, *SHAPES) if alone else SHAPES:
            if found is not None:
                if found.certificate.certified or not n_folded(found) or work.clock.spent:
                    return found
                _log.info("%s: with weight %g of shape", found.certificate.reason, shape)
            try:
                made = self._made(shape)
            except SolverError as error:  # sizes of faces are lost in rounding
                if alone and found is None:
                    raise
                _log.info("%s", error)
                lost = error
                continue
            if shape > 0.0:
                made.reason = f"{folded}; {made.reason}"
            other = mapped(level.surface, level.forms, made, self.torus)
            better = found is None or n_folded(other) < n_folded(found)
            if found is None or better or other.certificate.certified:
                found = other
        if found is None:
            assert lost is not None
            raise lost
        if found.certificate.certified or not n_folded(found):
            return found
        clock = time.perf_counter()
        newton, steps = level.newton(found.angles, found.ratio), self.route.steps
        limited = dataclasses.replace(steps, max_iter=min(steps.max_iter, work.steps()))
        records, _, reason = finish_areas(newton, False, limited, self.progress, late=work.late)
        found = moved(found, newton.angles, records, clock)
        return dataclasses.replace(found, converged=False, stop_reason=reason)

    def _made(self, shape: float) -> Made:
        """Angles of the surface as it is, from a chart with that weight of shape."""
        along = dataclasses.replace(self.route, shape=shape)
        if shape > 0.0:
            self.equal.shaped(shape, EASING)
            return follow(along, [self.equal.level], self.progress, self.equal, self.work)
        equal = self.equal if len(self.stack) == 1 else None
        return follow(along, self.stack, self.progress, equal, self.work)
