"""Maps of the boundary that the certified route starts from, one after the other."""

from __future__ import annotations

import dataclasses
import itertools
import logging
import math
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property

import numpy as np

from .. import _core
from ..area.finest import SHAPES
from ..area.finish import Steps
from ..area.map import charted, equal_areas, finished, turned
from ..area.result import AreaMap
from ..area.route import Route
from ..area.search import Ratio
from ..base.budget import Budget, Spent
from ..base.progress import Progress, report
from ..conformal.map import conformal_map
from ..errors import SolverError
from ..mesh.meshes import TetMesh, TriMesh
from .anisotropy import unstretching
from .opposite_sides import opposite_sides
from .options import VolumeOptions

__all__ = ["boundary_starts"]

_log = logging.getLogger("stretchmap")

_STEPS, _TOL = 100, 0.05
_SEM_STEPS = 10
_GENTLE = SHAPES[2]  # areas are far off
_LIGHTER = SHAPES[1]  # all the same better than to lose what is far out on a limb
# Times the ratio of the fattest, each with both weights of shape: coarse triangles fold on one, and
# both sides of a thin wall get stuck in each other on another.
_LESS_FAT = (1.0, 1.6, 2.5)
_LONGEST = 0.7  # share of the time left that making another one may take
_LOST = 1e-16  # of its area a face has no more
# Share of the faces that do not look outward from which on turning them was not seen to succeed
# where areas are equal (from 0.0317 on it failed, up to 0.0268 it did not).
_TOO_MANY = 0.03


def boundary_starts(
    solid: TetMesh,
    options: VolumeOptions,
    *,
    glide: bool,
    budget: Budget | None = None,
    progress: Progress | None,
) -> Iterator[AreaMap]:
    """Each is for the case that those before it lead nowhere, and made only then.

    A gliding boundary loses exact areas again; a held one is only as good as they are. Their last
    per cent costs triangles their shape, which the interior has to pay for.

    Parameters
    ----------
    solid : TetMesh
    options : VolumeOptions
        ``ratio`` and ``phase`` count.
    glide : bool
        Whether the boundary will move. Then a stretch common to all tets is undone first, and the
        maps say so: they do not preserve the areas of the surface as it is.
    budget : Budget, optional
        The first may take all of it, none of the others most of what is left.
    progress : Progress or None

    Yields
    ------
    AreaMap
        Of ``solid.surface``, certified or not.

    Raises
    ------
    SolverError
        None could be made.
    """
    unstretch = unstretching(solid.V, solid.T) if glide else None
    surface = solid.surface
    if unstretch is not None:
        surface = TriMesh(surface.V @ unstretch, surface.F)
    maps = _BoundaryMaps(surface, options, progress)
    makers = (
        itertools.chain([lambda: maps.mirrored(solid)], maps.gliding()) if glide else maps.held()
    )
    for found in _all_there_are(maps, makers, budget):
        if unstretch is not None:
            reason = f"{found.stop_reason}, a stretch of the surface undone"
            found = dataclasses.replace(
                found, mesh=solid.surface, converged=False, stop_reason=reason
            )
        yield found


def _all_there_are(
    maps: _BoundaryMaps, makers: Iterable[Callable[[], AreaMap | None]], budget: Budget | None
) -> Iterator[AreaMap]:
    """What they make in time, or else the first as it is; an error only if none makes anything."""
    failed, any_made = None, False
    maps.limit = budget
    for make in makers:
        try:
            found = make()
        except (SolverError, Spent) as error:
            _log.info("one start less: %s", error or "it takes too long")
            failed = failed or (error if isinstance(error, SolverError) else None)
            continue
        if found is not None:
            any_made = True
            yield found
            if budget is not None:
                maps.limit = budget.share(_LONGEST)
    if failed is not None and not any_made:
        raise failed
    if not any_made:
        yield maps.first


class _BoundaryMaps:
    def __init__(self, surface: TriMesh, options: VolumeOptions, progress: Progress | None) -> None:
        self.surface, self.phase, self._given = surface, options.phase, progress
        self.limit: Budget | None = None  # for the next ones
        self.conformal = conformal_map(surface, progress=progress)
        self.equal = equal_areas(surface, self.conformal, self.progress)
        self.ratio: Ratio | float = options.ratio or "search"
        self.first = self._chart(self.ratio)
        self.got_stuck = self.stays_folded = False

    def progress(self, stage: str, done: int, total: int, **values: float) -> None:
        """Pass it on, unless there is no time left for what reports it."""
        if self.limit is not None and self.limit.spent:
            raise Spent
        report(self._given, stage, done, total, **values)

    def gliding(self) -> Iterator[Callable[[], AreaMap | None]]:
        """What makes them one after the other, for a boundary that will move."""
        yield self.unfolded
        if self.ratio == "search":
            # Kept shapes are cheaper to make, and to compare with what was unfolded; where that
            # got stuck, equal areas lead further if they serve.
            if self.got_stuck:
                yield self.fatter
            # Both sides of a thin wall can get stuck in each other on one torus, not on the next.
            yield self.gentle_on_fatter
            yield self.gentle_on_fatter
            yield self.gentle_on_fatter
            if not self.got_stuck:
                yield self.fatter
        yield lambda: self.gentle([(self.ratio, _GENTLE)])
        yield self.folded
        yield lambda: self.after(_STEPS)

    def held(self) -> Iterator[Callable[[], AreaMap | None]]:
        """The same for one that will not."""
        yield lambda: self.after(_STEPS)
        yield lambda: self.after(0)
        yield self.gentle_finished

    def mirrored(self, solid: TetMesh) -> AreaMap | None:
        """Of a thin wall, the one that keeps its sides opposite each other."""
        if self.phase is not None:
            return None
        found = opposite_sides(solid, self.conformal, self.first.ratio)
        outward = found and self._turned(found)
        return None if outward is None or self._not_outward(outward) else outward

    @property
    def fatter_ratio(self) -> float:
        """Halfway, on the scale of log(R / r), to where the hole of the torus closes.

        The torus whose areas fit best can be too thin for what is inside; this one has cured that
        wherever it was met.
        """
        return math.sqrt(self.first.ratio)

    def after(self, steps: int) -> AreaMap:
        """The first, its faces turned outward, and so many steps on their areas."""
        return finished(self.first, max_iter=steps, tol=_TOL, progress=self.progress)

    def unfolded(self) -> AreaMap | None:
        # Faces that look inward cost the interior more steps than unfolding them beforehand; but
        # where that gets stuck, it leaves needles that no gliding opens again.
        found = self._turned(self.first)
        self.got_stuck = found is not None and self._not_outward(found) > 0
        self.stays_folded = found is None or self.got_stuck
        return None if self.got_stuck else found

    def folded(self) -> AreaMap | None:
        return None if self.first.certificate.certified else self.first

    def fatter(self) -> AreaMap | None:
        return self._unfolded(self.fatter_ratio)

    @cached_property
    def gentler(self) -> Iterator[tuple[float, float]]:
        """Tori, with weights of shape, that are tried in turn.

        Where many faces are folded, the lighter weight takes long and mostly leaves them so; where
        none is, it keeps areas better on the same torus.
        """
        tori = [self.fatter_ratio * more for more in _LESS_FAT]
        gentle, lighter = ([(ratio, shape) for ratio in tori] for shape in (_GENTLE, _LIGHTER))
        if self.stays_folded:
            return iter(gentle + lighter)
        return iter(gentle[:2] + lighter[:2] + gentle[2:] + lighter[2:])

    def gentle_on_fatter(self) -> AreaMap | None:
        """Another one each time, on less and less fat tori."""
        return self.gentle(self.gentler)

    def gentle(self, kept: Iterable[tuple[Ratio | float, float]]) -> AreaMap | None:
        """With shapes kept, on the first of some tori where every face looks outward."""
        # A long branch with few edges round it is folded wherever it has its area, and of a thin
        # shell both sides end up far from each other.
        proven = None
        for ratio, shape in kept:
            found = self._chart(ratio, shape)
            if np.abs(found.distortion.ratios).min() < _LOST:
                return self._unfolded(ratio, _LIGHTER)
            outward = turned(found, self.progress) if self._not_outward(found) else found
            if not self._not_outward(outward):
                return outward
            proven = proven or (outward if outward.certificate.certified else None)
        return proven

    def gentle_finished(self) -> AreaMap | None:
        found = self.gentle([(self.ratio, _GENTLE)])
        return found and finished(found, max_iter=_STEPS, tol=_TOL, progress=self.progress)

    def _unfolded(self, ratio: float | Ratio, shape: float = 0.0) -> AreaMap | None:
        return self._turned(self._chart(ratio, shape))

    def _turned(self, found: AreaMap) -> AreaMap | None:
        """With its folded faces turned outward, as far as that goes; None if they are too many."""
        folded = self._not_outward(found)
        if folded > _TOO_MANY * len(self.surface.F):
            return None
        return turned(found, self.progress) if folded else found

    def _not_outward(self, found: AreaMap) -> int:
        """Faces that do not look outward everywhere, or reach far round the axis."""
        F, R = self.surface.F, found.torus.R
        return len(_core.certificate.torus_graph(found.image, F, R, strict=True).bad)

    def _chart(self, ratio: Ratio | float, shape: float = 0.0) -> AreaMap:
        if shape:
            self.equal.shaped(shape)
        steps = Steps(0, _TOL, math.inf)
        route = Route(self.phase, ratio, _SEM_STEPS, "none", steps, shape)
        return charted(route, self.equal, self.conformal, self.progress)
