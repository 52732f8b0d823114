"""Surfaces too coarse for their place on the torus: edges halved until flat faces can lie there.

Few edges round a branch or round a small hole have to span the torus, and a flat face is no thinner
than the sag below the arc over its longest edge: its area cannot be right, and where it is much too
coarse it looks inward.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress
from ..base.torus import TWO_PI, Torus
from ..mesh.halved_faces import SurfaceRefinement, halve_edges
from ..mesh.surfaces import TriMesh
from .balance import balance_areas
from .coarse import Level, forms_of
from .finish import Pace, Steps, cut_short, finish_areas, unfold_faces, worth_rings
from .flat import start_angles
from .route import Made
from .sem import minimize_stretch
from .work import Work

_log = logging.getLogger("stretchmap")

_SAG = 1.0  # most sag of an edge, over the heights its faces are to have above it
_FAR, _MANY = 2.0, 0.005  # more than this share of the edges with more sag than that: too coarse
_SLIVER = 3.0  # times the median: longer faces are given the height they would have at that
_GROWTH, _SPARE = 2.5, 12_000  # most faces: so many times those of the input, and so many more
_PASSES = 14
_RESHAPING = 12  # Newton steps in the chart once edges are halved
_OFF = 4.0  # times the tolerance: faces off by more get more vertices where areas are not good
_LITTLE = 0.1  # sag that is not what makes a face's area wrong
_ROUNDS = 3
_STEPS = 30  # of each round; fewer are not worth it
_UNFOLDING = (1 / 4, (5, 25))  # a share of the work, and steps, until no face is folded
_FEW_UNFOLDING = 10  # such steps that mostly suffice
_HEAVY = 4.0**6  # weight of the area term a round begins with
_GOOD = 2.0  # times the tolerance
_LEAST_GOOD = 0.01
_LONG, _FEW, _SLIVERS = 10.0, 0.01, 3.0  # slivers: a share of faces longer than that; their factor
_GAIN, _IDLE = 0.9, 2  # rounds in a row that leave more of the error end them


def goal(surface: TriMesh, tol: float) -> float:
    """Face SD that halving edges should lead to: three times as much where there are slivers."""
    slivers = float((_slender(surface) > _LONG).mean()) > _FEW
    return max(_GOOD * tol, _LEAST_GOOD) * (_SLIVERS if slivers else 1.0)


def _slender(surface: TriMesh) -> NDArray[np.float64]:
    """(m,) longest edge of each face over the height above it."""
    corners = surface.V[surface.F]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    slender: NDArray[np.float64]
    slender = sides.max(axis=1) ** 2 / np.maximum(2.0 * surface.face_areas, np.finfo(float).tiny)
    return slender


@dataclass(frozen=True)
class Finer:
    """Angles of a surface with edges halved, and how it came about."""

    level: Level
    angles: NDArray[np.float64]
    ratio: float
    added: SurfaceRefinement

    @classmethod
    def of(cls, level: Level, angles: NDArray[np.float64], ratio: float) -> Finer:
        """A surface as it is."""
        return cls(level, angles, ratio, SurfaceRefinement.of(level.surface))

    @property
    def image(self) -> NDArray[np.float64]:
        """Of the vertices, on a torus with a tube of radius 1."""
        return Torus(self.ratio, 1.0).xi(*self.angles.T)

    def sags(self) -> NDArray[np.float64]:
        """(e,) sag of each edge over the least height its faces are to have above it."""
        surface, torus = self.level.surface, Torus(self.ratio, 1.0)
        edge = surface.topology.edge.reshape(-1, 3)
        i, j = surface.edges.T
        ends = self.image[surface.edges]
        change = self.angles[j] - self.angles[i] + TWO_PI * self.level.forms.T
        over = torus.xi(*(self.angles[i] + 0.5 * change).T)
        sag = np.linalg.norm(over - ends.mean(axis=1), axis=1)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        areas = surface.face_areas
        slender = _slender(surface)
        wanted = areas * np.maximum(slender / (_SLIVER * np.median(slender)), 1.0)
        wanted *= torus.area / areas.sum()
        found = np.zeros(len(surface.edges))
        np.maximum.at(found, edge, (sag * length)[edge] / (2.0 * wanted)[:, None])
        return found

    def halved(self, marked: NDArray[np.bool_]) -> Finer:
        """With those edges halved, in the chart, too: no face turns over there."""
        level, surface = self.level, self.level.surface
        done = halve_edges(surface, marked, self.image)
        shifts = np.stack([level.chart.shift_u, level.chart.shift_v], axis=-1)
        corners = self.angles[surface.F] + TWO_PI * shifts
        corners = np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=1))], axis=1)
        corners = corners[done.parent[:, None], done.corners]
        angles = np.empty((done.surface.n_vertices, 2))
        angles[done.surface.F] = corners  # any branch does
        angles[: len(self.angles)] = self.angles
        shifts = np.rint((corners - angles[done.surface.F]) / TWO_PI).astype(np.int32)
        forms = forms_of(done.surface, shifts[..., 0], shifts[..., 1])
        finer = Level.of(done.surface, angles / TWO_PI, forms, level.aspect)
        return Finer(finer, angles, self.ratio, self.added.after(done))

    def fitted(self) -> Finer | None:
        """With edges halved until none sags too much; None if that takes too many faces."""
        finer = self
        for _ in range(_PASSES):
            marked = finer.sags() > _SAG
            if not marked.any():
                break
            if finer.too_many(marked):
                return None
            finer = finer.halved(marked)
        return finer

    def evened(self, sem_iter: int, progress: Progress | None) -> Finer:
        """With areas made equal in the chart, which coarse faces had not allowed."""
        level = self._in_chart()
        if level is None:
            return self
        return self._with(level, minimize_stretch(level, sem_iter, progress)[0])

    def reshaped(self, progress: Progress | None, work: Work) -> Finer:
        """With Newton steps in the chart, which give faces back shapes that areas had cost them."""
        level = self._in_chart()
        if level is None:
            return self
        turns, records = balance_areas(level, 0.0, progress, most=_RESHAPING)
        work.spend_in_chart(len(records), level.surface.n_faces)
        return self._with(level, turns)

    def _in_chart(self) -> Level | None:
        """The level over the flat chart of equal areas; None where faces are folded there."""
        u, v = self.angles.T
        turns = np.column_stack([u, v + np.sin(v) / self.ratio]) / TWO_PI
        if not (_core.area.turn_areas(self.level.chart, turns) > 0.0).all():
            return None
        return Level.of(self.level.surface, turns, self.level.forms, self.level.aspect)

    def _with(self, level: Level, turns: NDArray[np.float64]) -> Finer:
        angles = start_angles(level.chart, turns, 0.0, self.ratio)
        return Finer(level, angles, self.ratio, self.added)

    def newton(self) -> _core.area.SurfaceNewton:
        """Steps from here on."""
        return self.level.newton(self.angles, self.ratio)

    def ratios(self) -> NDArray[np.float64]:
        """(m,) area ratios of the faces, 1 on average."""
        a, b, c = np.moveaxis(self.image[self.level.surface.F], 1, 0)
        ratios = np.linalg.norm(np.cross(b - a, c - a), axis=1) / self.level.surface.face_areas
        found: NDArray[np.float64] = ratios / ratios.mean()
        return found

    def where_off(self, tol: float) -> Finer | None:
        """With the edges halved that sag most in faces whose areas are off; None without any."""
        surface = self.level.surface
        edge = surface.topology.edge.reshape(-1, 3)
        own = edge[np.abs(self.ratios() - 1.0) > _OFF * tol]
        sags = self.sags()
        worst = own[np.arange(len(own)), sags[own].argmax(axis=1)]
        marked = np.zeros(len(sags), bool)
        marked[worst[sags[worst] > _LITTLE]] = True
        return self.halved(marked) if marked.any() and not self.too_many(marked) else None

    @property
    def share(self) -> float:
        """Faces of the input over those there are."""
        return 1.0 - self.added.n_added_faces / len(self.added.parent_face)

    def too_many(self, marked: NDArray[np.bool_]) -> bool:
        """Whether halving these edges, too, would take more faces than may be."""
        n_faces = len(self.added.parent_face)
        return n_faces + 2 * int(marked.sum()) > _GROWTH * n_faces * self.share + _SPARE


def too_coarse(level: Level, angles: NDArray[np.float64], ratio: float) -> bool:
    """Whether so many edges sag so much that the surface needs more before anything else."""
    return bool((Finer.of(level, angles, ratio).sags() > _FAR).mean() > _MANY)


def mapped_finer(
    finer: Finer,
    made: Made,
    steps: Steps,
    wanted: float,
    rings: bool,
    progress: Progress | None,
    work: Work,
) -> tuple[Made, Finer] | None:
    """Newton steps, then more edges halved where areas are off; the best of all, records added.

    Without an edge halved yet, ``finer`` is what steps have led to already. None if faces stay
    folded.
    """
    clock = time.perf_counter()
    error, best = np.inf, None if finer.added.n_split else (made, finer)
    history, idle = list(made.history), 0
    most_unfolding = int(np.clip(_UNFOLDING[0] * work.left, *_UNFOLDING[1]))

    def begun(finer: Finer) -> _core.area.SurfaceNewton | None:
        """Steps from there on, if they can be afforded and lead to no folded face."""
        newton, n_faces = finer.newton(), finer.level.surface.n_faces
        folded = not newton.least_facing() > 0.0
        if work.steps(n_faces) - folded * _FEW_UNFOLDING < _STEPS:
            return None
        unfolding = unfold_faces(newton, most_unfolding, progress)
        work.spend(len(unfolding), n_faces)
        history.extend(unfolding)
        return newton if newton.least_facing() > 0.0 else None

    last, reason, pace = False, made.reason, Pace(_HEAVY)
    for round_ in range(_ROUNDS + 1):
        at_once = round_ == 0 and finer.added.n_split > 0
        # What the steps on a surface have made good so far wants no more vertices.
        enough = round_ == 0 and float(finer.ratios().std()) <= wanted
        halved = finer if at_once else None if enough else finer.where_off(steps.tol)
        newton = None if halved is None else begun(halved)
        if newton is not None:
            assert halved is not None
            finer, last, pace = halved, at_once, Pace() if at_once else Pace(_HEAVY)
        elif not last and cut_short(reason):
            newton, last = finer.newton(), True
        else:
            break
        n_faces = finer.level.surface.n_faces
        most = min(work.steps(n_faces) if last else _STEPS, steps.max_iter)
        records, converged, reason = finish_areas(
            newton, rings, Steps(most, steps.tol, steps.shape_budget), progress, pace
        )
        work.spend(len(records), n_faces)
        history += records
        finer = Finer(finer.level, newton.angles, finer.ratio, finer.added)
        measured = newton.measures()
        if rings and worth_rings(measured, steps.tol):
            work.spend_on_rings(n_faces)
        _log.info("%d edges halved: face SD %.2e", finer.added.n_split, measured.face_std)
        before, now = error, measured.face_std if measured.flips == 0 else np.inf
        if now < error:
            what = Made(newton.angles, made.phase, made.ratio, [], converged, reason)
            error, best = now, (what, finer)
        idle = 0 if now <= _GAIN * before else idle + 1
        if error <= wanted or idle == _IDLE:
            break
    if best is None:
        return None
    found, finer = best
    seconds = {**made.seconds, "finer": time.perf_counter() - clock}
    return replace(found, history=history, seconds=seconds), finer
