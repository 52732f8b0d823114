"""One boundary laid on another: the starts, which matching to believe, and edges halved for it."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.budget import Budget, Spent
from ..base.progress import Progress, report
from ..errors import DegenerateError, LandmarkError, SolverError
from ..maps.history import IterationRecord
from ..mesh.meshes import TetMesh
from ..mesh.split_edges import SplitSolid
from .affine import affine_landmark_map
from .embed import (
    EmbeddedBoundary,
    crossing_faces,
    embed_boundary,
    halve_edges_once,
    split_long_edges,
    unfold_boundary,
)
from .flat_torus import FlatSurface, Gauge, choose_gauge
from .landmarks import Landmarks
from .match import Match, match_surfaces
from .result import LandmarkMap
from .smooth_start import SmoothStart

__all__ = ["BoundaryWays", "Laid"]

_log = logging.getLogger("stretchmap")

# Energy of a matching from which on it is doubted before it is tried: up to 0.17 between vertebrae,
# and up to 0.4 as a rule good enough.
_DOUBTFUL = 0.4
_HOPELESS = 5.0  # energy from which on it is not worth beginning from
# Distortion of faces by a smooth deformation: up to 0.4 between solids and deformed copies, 1.7 and
# more between solids that have little in common.
_UNLIKE = 1.0
_VERY_MANY = 1000  # pairs of faces that cross: refining these only takes time
# Shares of the time without which nothing else is tried, nothing matched from a deformation that
# leads nowhere near, and a deformation not gone on with.
_TIME, _TO_MATCH, _TO_FILL = 0.3, 0.5, 0.15


@dataclass(frozen=True, eq=False)
class Laid:
    """A boundary laid on another.

    Attributes
    ----------
    embedded : EmbeddedBoundary
    gauge : Gauge
    energy : float
        Distortion of the surfaces, that of the source's alone where nothing was matched.
    """

    embedded: EmbeddedBoundary
    gauge: Gauge
    energy: float

    @property
    def crosses(self) -> bool:
        """Whether faces do."""
        return len(self.embedded.crossings) > 0

    @property
    def rank(self) -> tuple[int, float]:
        """The better, the less: pairs of faces that cross, then the energy."""
        return len(self.embedded.crossings), self.energy

    @property
    def serves(self) -> bool:
        """Nothing speaks against it."""
        return self.rank < (0, _DOUBTFUL)


class BoundaryWays:
    """The boundary of one solid laid on another's, in one way after the other.

    First the flat tori are laid on each other whole, and matched; then the closest points count to
    where a smooth deformation in space takes the source; and where these cross, the matching begins
    from there.

    Parameters
    ----------
    source, target : TetMesh
    marks : Landmarks
        Of volume vertices.
    landmark_map, max_iter, tol, progress
        As in `register`.

    Attributes
    ----------
    history : tuple of IterationRecord
        Of all matchings so far.
    """

    def __init__(
        self,
        source: TetMesh,
        target: TetMesh,
        marks: Landmarks,
        landmark_map: LandmarkMap,
        *,
        max_iter: int,
        tol: float,
        progress: Progress | None,
    ) -> None:
        self._source, self._target = source, target
        self._landmark_map, self._max_iter, self._tol = landmark_map, max_iter, tol
        self._progress = progress
        self._flat, second = (
            FlatSurface.of(solid.surface, name)
            for solid, name in ((source, "source"), (target, "target"))
        )
        self._pairs = np.stack(
            [source.boundary_index[marks.source], target.boundary_index[marks.target]], axis=1
        )
        self._second = split_long_edges(SplitSolid.of(target), second)[1]
        self._goals = self._second.surface.V[self._pairs[:, 1]]
        self._smooth_left = landmark_map == "smooth"
        self._guess: NDArray[np.float64] | None = None
        self.history: tuple[IterationRecord, ...] = ()

    def lay(self, budget: Budget) -> list[Laid]:
        """The first way, and the others as well if faces cross then, or the surfaces are distorted
        much, or landmarks cannot be reached; the best one first.

        Raises
        ------
        LandmarkError, SolverError
            As `register`.
        """
        try:
            found = [self._whole()]
        except LandmarkError:
            found = [way for way in self.others(budget) if not way.crosses]
            if not found:
                raise
        else:
            if not found[0].serves:
                found += self.others(budget)
        return sorted(found, key=lambda way: way.rank)

    def others(self, budget: Budget) -> list[Laid]:
        """What the ways by space lead to, once and if there is time; may be empty."""
        found: list[Laid] = []
        if not self._smooth_left or budget.left <= _TIME * budget.seconds:
            return found
        self._smooth_left = False
        _log.info("the boundary once more, from a smooth deformation")

        def note(stage: str, done: int, total: int, **values: float) -> None:
            if budget.left <= _TO_FILL * budget.seconds:
                raise Spent
            report(self._progress, stage, done, total, **values)

        try:
            start = SmoothStart.of(
                self._source, self._target, self._flat, self._second, self._pairs,
                self._guess, note,
            )  # fmt: skip
        except Spent:
            return found
        except (DegenerateError, SolverError) as error:
            _log.info("%s", error)
            return found
        embedded, energy = start.laid(self._goals)
        if energy < _UNLIKE:
            found.append(Laid(embedded, start.gauge, energy))
        least = _TIME if energy < _UNLIKE else _TO_MATCH
        if len(embedded.crossings) and budget.left > least * budget.seconds:
            try:
                found.append(self._matched(start.gauge, *start.turns()))
            except (LandmarkError, SolverError) as error:
                _log.info("%s", error)
        return sorted(found, key=lambda way: way.rank)

    def _whole(self) -> Laid:
        """The flat torus of the source laid on that of the target by a gauge."""
        pairs = self._pairs
        belong = (pairs[:, 0], self._goals) if len(pairs) >= 3 else None
        gauge = choose_gauge(self._flat, self._second, belong)
        start = split_long_edges(SplitSolid.of(self._source), self._flat.changed(gauge))
        laid = self._matched(gauge, *start)
        if laid.energy < _HOPELESS:
            self._guess = laid.embedded.points[: self._source.surface.n_vertices]
        return laid

    def _matched(self, gauge: Gauge, split: SplitSolid, first: FlatSurface) -> Laid:
        """The boundary after matching, from where it lies now."""
        pairs, second = self._pairs, self._second
        try:
            match = self._match(first)
        except LandmarkError as error:
            _log.info("%s: once more with edges of the boundary halved", error)
            split, first = halve_edges_once(split, first)
            match = self._match(first)
        self.history += match.history
        image, points = first.at(match.y), match.points
        if self._landmark_map == "affine":
            split, image = _bent(split, image, second, pairs)
            points = second.points(image.turns)
        points[pairs[:, 0]] = self._goals
        crossings = crossing_faces(points, split.solid.surface)
        embedded = EmbeddedBoundary(split, points, crossings)
        if len(crossings) < _VERY_MANY:
            embedded = embed_boundary(split, second, image, points, pairs[:, 0])
        return Laid(embedded, gauge, match.history[-1].energy)

    def _match(self, first: FlatSurface) -> Match:
        held = self._pairs if self._landmark_map == "smooth" else self._pairs[:0]
        return match_surfaces(
            first, self._second, first.turns, held,
            max_iter=self._max_iter, tol=self._tol, progress=self._progress,
        )  # fmt: skip


def _bent(
    split: SplitSolid, image: FlatSurface, second: FlatSurface, pairs: NDArray[np.int32]
) -> tuple[SplitSolid, FlatSurface]:
    """The paper's piecewise-affine map after the matching."""
    starts, ends = image.turns[pairs[:, 0]], second.turns[pairs[:, 1]]
    split, image, folded = unfold_boundary(
        split, image, lambda at: affine_landmark_map(starts, ends, at)
    )
    if len(folded):
        raise SolverError(
            f"the source mesh is too coarse for the affine map: {len(folded)} faces turn over, "
            "and refining them does not help; use landmark_map='smooth'",
            folded,
        )
    return split, image
