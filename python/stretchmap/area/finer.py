"""Surfaces too coarse for their place on the torus: edges halved until flat faces can lie there.

Few edges round a branch or round a small hole have to span the torus, and a flat face is no thinner
than its edges sag, where its third corner is, below the arcs over them: its area cannot be right,
and where it is much too coarse it looks inward.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress
from ..base.torus import TWO_PI, Torus
from ..maps.history import IterationRecord
from ..mesh.halved_faces import SurfaceRefinement, halve_edges
from ..mesh.surfaces import TriMesh
from .coarse import Level
from .finish import (
    Pace,
    Steps,
    approach_areas,
    cut_short,
    finish_areas,
    many_folded,
    unfold_faces,
    worth_rings,
)
from .flat import start_angles
from .patches import turn_in_patches
from .route import Made
from .work import MOST_FACES, RINGS, Work

_log = logging.getLogger("stretchmap")

# Most sag of an edge, over the heights its faces are to have above it; the first of them for which
# there may be enough faces.
_SAGS = 1.0, 1.4, 2.0, 2.8
_FAR, _MANY = 2.0, 0.005  # more than this share of the edges with more sag than that: too coarse
# Faces there may be: so many times those of the input, and so many more; still more where work is
# left for so many steps, to begin with and after each approach.
_GROWTH, _SPARE, STEPS_LEFT = 2.5, 12_000, (60, 50, 40, 30)
_BENT = 0.5  # least share of its area that a face may keep when the flat chart is bent
_PASSES = 14
_TWINS = 2  # rounds in which the other long edges of needles follow: more cost more than they give
_MORE = 3  # times as many faces that look inward as before: halving edges does not help
_APPROACH = 30, 10, 10  # most steps towards areas, edges that sag too much halved after each
# Face SD from which on others lead no nearer where these do not, and where nothing does.
_HOPELESS, _LOST = 0.3, 0.5
_OFF = 4.0  # times the tolerance: faces off by more get more vertices where areas are not good
_LITTLE = 0.1  # sag that is not what makes a face's area wrong
_ROUNDS = 3
_FINER = 1.5  # times as many faces there may be after a round
_LEAST_STEPS = 10  # from where areas are nearly right, however little work is left
ROUND_STEPS = 20  # of each round; fewer are not worth it
_UNFOLDING = (0.6, (10, 60))  # a share of the work, and steps, until no face is folded
_LAST_RESERVE = 0.6  # of what was reserved, until the last few faces are turned
_HEAVY = 4.0**6  # weight of the area term a round begins with
_GOOD = 2.0  # times the tolerance
_LEAST_GOOD = 0.01
_LONG, _FEW, _SLIVERS = 10.0, 0.01, 3.0  # slivers: a share of faces longer than that; their factor
_CLOSE = 1.5  # times the face SD wanted: further steps lead there sooner than more faces do
# What steps and rounds leave of the error at most, where more of them follow at once; so many
# rounds in a row that leave more end them.
_GAIN, _IDLE = 0.9, 2


def goal(surface: TriMesh, tol: float) -> float:
    """Face SD that halving edges should lead to: three times as much where there are slivers."""
    return max(_GOOD * tol, _LEAST_GOOD) * (_SLIVERS if has_slivers(surface) else 1.0)


def has_slivers(surface: TriMesh) -> bool:
    """Whether more than a few faces are long and thin."""
    return float((_slender(surface) > _LONG).mean()) > _FEW


def _slender(surface: TriMesh) -> NDArray[np.float64]:
    """(m,) longest edge of each face over the height above it."""
    corners = surface.V[surface.F]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    slender: NDArray[np.float64]
    slender = sides.max(axis=1) ** 2 / np.maximum(2.0 * surface.face_areas, np.finfo(float).tiny)
    return slender


@dataclass(frozen=True)
class Finer:
    """Angles of a surface with edges halved, and how it came about.

    Attributes
    ----------
    level : Level
    angles : ndarray, shape (n, 2)
    ratio : float
    added : SurfaceRefinement
    affordable : int
        Faces with which work is left for what follows.
    needles : bool
        Whether the surface has more than a few.
    near : bool
        Whether its areas are being led to what they are to be.
    """

    level: Level
    angles: NDArray[np.float64]
    ratio: float
    added: SurfaceRefinement
    affordable: int = 0
    needles: bool = False
    near: bool = False

    @classmethod
    def of(cls, level: Level, angles: NDArray[np.float64], ratio: float) -> Finer:
        """A surface as it is."""
        given = SurfaceRefinement.of(level.surface)
        return cls(level, angles, ratio, given, needles=has_slivers(level.surface))

    @classmethod
    def wrapped(cls, level: Level, turns: NDArray[np.float64], phase: float, ratio: float) -> Finer:
        """A surface wrapped round the torus from a flat chart."""
        turns = np.column_stack([turns[:, 0], turns[:, 1] + phase])
        return cls.of(level, TWO_PI * turns, ratio)._bent()

    def _bent(self) -> Finer:
        """With s, the second coordinate of the flat chart so far, bent into the angle v.

        Large faces can turn over or lose their areas. Edges of theirs are halved in the flat chart,
        which nothing folds, so that only short edges are bent; where that takes too many faces, s
        is bent less.
        """
        flat = self
        for _ in range(_PASSES):
            u, s = flat.angles.T
            v = _core.area.angle_from_equal_area(s, 1.0 / flat.ratio)
            bent = np.column_stack([u, v])
            chart, faces = flat.level.chart, flat.level.surface.F
            density = 1.0 + np.cos(v)[faces].mean(axis=1) / flat.ratio
            areas = density * _core.area.turn_areas(chart, bent / TWO_PI)
            over = ~(areas > _BENT * _core.area.turn_areas(chart, flat.angles / TWO_PI))
            if not over.any():
                return replace(flat, angles=bent)
            i, j = flat.level.surface.edges.T
            span = np.abs(s[j] - s[i] + TWO_PI * flat.level.forms[1])
            marked = flat.largest_in(np.flatnonzero(over), span)
            if flat.too_many(int(marked.sum())):
                break
            flat = flat.halved(marked)
        angles = start_angles(flat.level.chart, flat.angles / TWO_PI, 0.0, flat.ratio)
        return replace(flat, angles=angles)

    @property
    def image(self) -> NDArray[np.float64]:
        """Of the vertices, on a torus with a tube of radius 1."""
        return Torus(self.ratio, 1.0).xi(*self.angles.T)

    def lengths(self) -> NDArray[np.float64]:
        """(e,) of the edges along the torus, where their ends may be close to each other."""
        i, j = self.level.surface.edges.T
        du, dv = (self.angles[j] - self.angles[i] + TWO_PI * self.level.forms.T).T
        middle = self.angles[i, 1] + 0.5 * dv
        return np.asarray(np.hypot((self.ratio + np.cos(middle)) * du, dv))

    def sags(self) -> NDArray[np.float64]:
        """(e,) how far each edge sags where a face's third corner is, over the height of that.

        Of its two faces that where it is more. At the ends it does not sag: both long edges of a
        needle can lie deep below the torus and the needle be as thin as it is to be.
        """
        level = self.level
        found: NDArray[np.float64] = _core.area.edge_sags(
            level.surface.topology, level.chart, level.surface.face_areas, self.angles, self.ratio
        )
        return found

    def halved(self, marked: NDArray[np.bool_]) -> Finer:
        """With those edges halved, in the chart, too: no face turns over there."""
        level, surface = self.level, self.level.surface
        done = halve_edges(surface, marked, self.lengths())
        chart = _core.area.HalvedChart(level.chart, self.angles, done.corners)
        angles = chart.angles
        forms = _core.area.chart_forms(done.surface.topology, chart.shift_u, chart.shift_v)
        finer = Level.of(done.surface, angles / TWO_PI, forms, level.aspect)
        return replace(self, level=finer, angles=angles, added=self.added.after(done))

    def halved_with_twins(self, marked: NDArray[np.bool_]) -> Finer:
        """With those edges halved, and the other long edges of their needles where they then sag.

        The midpoint of one long edge lies on the torus, that of the other, which sagged as much, as
        deep below it as before: a face as high as the edges sag is what is left between them.
        """
        finer = self.halved(marked)
        if not (self.needles and self.near):
            return finer
        ends, before = self._keys(len(self.angles)), self.sags()
        for _ in range(_TWINS):
            # Those still whole, here and there: more are halved than were marked.
            _, here, there = np.intersect1d(
                ends, finer._keys(len(self.angles)), return_indices=True
            )
            deeper = here[finer.sags()[there] > np.maximum(before[here], _FAR)]
            if not len(deeper):
                break
            marked = marked.copy()
            marked[deeper] = True
            finer = self.halved(marked)
        return finer

    def _keys(self, n: int) -> NDArray[np.int64]:
        """(e,) a number for each edge between two of the first ``n`` vertices, n² for others."""
        i, j = np.sort(self.level.surface.edges, axis=1).T.astype(np.int64)
        return np.where(j < n, i * n + j, n * n)

    def fitted(self, sag: float, share: float = 1.0) -> Finer | None:
        """With edges halved until none sags too much; None if that takes too many faces.

        More than that share of those there may be.

        And until no face looks inward, if that does not: what lies in a chart without folds needs
        but edges short enough.
        """
        finer = self
        for _ in range(_PASSES):
            sags = finer.sags()
            marked = sags > sag
            if not marked.any():
                break
            # Halves of an edge sag a quarter as much over faces of the same height.
            pieces = np.ceil(np.sqrt(sags[marked] / sag))
            if finer.too_many(int(pieces.sum()) - len(pieces), share):
                return None
            finer = finer.halved_with_twins(marked)
        return finer.outward()

    def fitted_as_affordable(self) -> Finer:
        """With edges halved until none sags more than there may be faces for."""
        for sag in _SAGS:
            if (finer := self.fitted(sag)) is not None:
                return finer
        return self.outward()

    def outward(self) -> Finer:
        """With the edges halved that sag most in faces that look inward, while there are any.

        As it was where they become more: they are nearly folded in the chart, too.
        """
        finer, fewest = self, 0
        for _ in range(_PASSES):
            inward = _core.certificate.torus_graph(
                finer.image, finer.level.chart.faces, finer.ratio
            ).bad
            fewest = min(fewest, len(inward)) if fewest else len(inward)
            if len(inward) > _MORE * fewest:
                return self
            marked = finer.largest_in(inward, finer.sags())
            if not marked.any() or finer.too_many(int(marked.sum())):
                break
            finer = finer.halved_with_twins(marked)
        return finer

    def largest_in(
        self, faces: NDArray[np.integer[Any]], of_edges: NDArray[np.float64], least: float = 0.0
    ) -> NDArray[np.bool_]:
        """(e,) whether an edge has the largest number of a face's edges, and more than ``least``.

        Of each of the faces.
        """
        edge = self.level.surface.topology.edge.reshape(-1, 3)[faces]
        largest = edge[np.arange(len(edge)), of_edges[edge].argmax(axis=1)]
        marked = np.zeros(len(of_edges), bool)
        marked[largest[of_edges[largest] > least]] = True
        return marked

    def approached(
        self, progress: Progress | None, work: Work
    ) -> tuple[Finer, Pace, list[IterationRecord]]:
        """With areas nearly right, edges that sag too much meanwhile halved, too; pace, records."""
        finer, pace, history = replace(self, near=True), Pace(), []
        same = Pace()
        for most, after in zip(_APPROACH, STEPS_LEFT[1:], strict=True):
            newton, n_faces = finer.newton(), finer.level.surface.n_faces
            before = newton.measures().face_std
            work.begin(newton, n_faces)
            affordable = work.steps(n_faces) - _LEAST_STEPS
            if affordable <= 0:
                break
            most = min(most, affordable)
            records, same = approach_areas(newton, most, progress, work.late, same)
            pace = max(pace, same, key=lambda each: each.weight)
            work.spend_on_approach(len(records), n_faces)
            history += records
            finer = replace(finer, angles=newton.angles, affordable=work.most_faces(after))
            error = newton.measures().face_std
            if error > _LOST:
                break
            finer = finer.fitted_as_affordable()
            work.spend_on_fitting(finer.level.surface.n_faces)
            if error > max(_HOPELESS, before):
                break
            if finer.level.surface.n_faces > n_faces:
                same = Pace()
        return finer, pace, history

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
        off = np.flatnonzero(np.abs(self.ratios() - 1.0) > _OFF * tol)
        marked = self.largest_in(off, self.sags(), _LITTLE)
        return (
            self.halved_with_twins(marked).outward()
            if marked.any() and not self.too_many(int(marked.sum()))
            else None
        )

    def too_coarse(self) -> bool:
        """Whether so many edges sag so much that the surface needs more before anything else."""
        return bool((self.sags() > _FAR).mean() > _MANY)

    @property
    def share(self) -> float:
        """Faces of the input over those there are."""
        return 1.0 - self.added.n_added_faces / len(self.added.parent_face)

    def too_many(self, more: int, share: float = 1.0) -> bool:
        """Whether so many vertices more make more faces than may be, or than that share of them."""
        n_faces = len(self.added.parent_face)
        given = n_faces * self.share
        most = max(min(_GROWTH * given + _SPARE, MOST_FACES), self.affordable)
        return n_faces + 2 * more > share * most


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

    Where a finer surface had not the steps it takes, not before they lead no further: all areas
    near a new vertex are off again. Without an edge halved yet, ``finer`` is what steps have led to
    already. None if faces stay folded.
    """
    clock = time.perf_counter()
    error, best = np.inf, None if finer.added.n_split else (made, finer)
    history, idle, at_once = list(made.history), 0, finer.added.n_split > 0

    def begun(finer: Finer) -> tuple[Finer, Pace] | None:
        """From where steps go on, if some can be afforded and lead to no folded face."""
        if work.steps(finer.level.surface.n_faces) < ROUND_STEPS:
            return None
        finer, pace, records = finer.approached(progress, work)
        history.extend(records)
        if records and records[-1].element_std > _LOST:
            return None
        newton, n_faces, reserved = finer.newton(), finer.level.surface.n_faces, work.reserved
        if not turned_outward(newton, n_faces, pace):
            if many_folded(newton.measures().flips, n_faces):
                return None
            # Edges of the last few are halved, and most of what is reserved is well spent.
            finer = replace(finer, angles=newton.angles).outward()
            newton, n_faces = finer.newton(), finer.level.surface.n_faces
            work.reserved *= _LAST_RESERVE
            if not turned_outward(newton, n_faces, pace):
                work.reserved = reserved
                return None
        work.reserved = 0.0
        return replace(finer, angles=newton.angles), pace

    def turned_outward(newton: _core.area.SurfaceNewton, n_faces: int, pace: Pace) -> bool:
        """Whether every face looks outward, some steps later if need be."""
        if newton.least_facing() > 0.0:
            return True
        history.extend(turn_in_patches(newton, progress, pace, work))
        if newton.least_facing() > 0.0:
            return True
        affordable = work.steps(n_faces)
        most = min(int(np.clip(_UNFOLDING[0] * affordable, *_UNFOLDING[1])), affordable)
        work.begin(newton, n_faces)
        unfolding = unfold_faces(newton, most, progress, pace, work.late)
        work.spend(len(unfolding), n_faces)
        history.extend(unfolding)
        return newton.least_facing() > 0.0

    last = falling = False
    reason, pace, round_ = made.reason, Pace(_HEAVY), 0
    while round_ <= _ROUNDS:
        if not falling:
            first = round_ == 0 and at_once
            # What the steps on a surface have made good wants no more vertices.
            good = wanted * (_CLOSE if cut_short(reason) else 1.0)
            enough = not first and float(finer.ratios().std()) <= good
            halved = finer if first else None if enough else finer.where_off(steps.tol)
            start = None if halved is None else begun(halved)
            round_ += 1
            if start is not None:
                finer, pace = start
            elif cut_short(reason) and not last and work.steps(finer.level.surface.n_faces):
                last = True
            else:
                break
        newton = finer.newton()
        n_faces = finer.level.surface.n_faces
        affordable = work.steps(n_faces)
        with_rings = rings and affordable >= _LEAST_STEPS + RINGS
        most = affordable - RINGS if with_rings else work.steps(n_faces, least=_LEAST_STEPS)
        most = min(most if last else min(most, ROUND_STEPS), steps.max_iter)
        work.begin(newton, n_faces)
        asked = replace(steps, max_iter=most)
        if finer.added.n_split:  # shapes count from there on, where steps end now
            asked = replace(asked, tol=_GOOD * steps.tol, shape_budget=np.inf)
        records, converged, reason = finish_areas(
            newton,
            with_rings,
            asked,
            progress,
            pace,
            work.late,
        )
        work.spend(len(records), n_faces)
        history += records
        most_faces = work.most_faces(STEPS_LEFT[-1], last=True)
        finer = replace(finer, angles=newton.angles, affordable=most_faces)
        measured = newton.measures()
        if with_rings and worth_rings(measured, asked.tol):
            work.spend_on_rings(n_faces)
        _log.info("%d edges halved: face SD %.2e", finer.added.n_split, measured.face_std)
        few = work.steps(int(_FINER * n_faces)) < sum(_APPROACH) + _ROUNDS * ROUND_STEPS
        gained = measured.face_std <= _GAIN * records[0].element_std
        falling = few and gained and cut_short(reason) and not last
        before, now = error, measured.face_std if measured.flips == 0 else np.inf
        if now < error:
            what = Made(newton.angles, made.phase, made.ratio, [], converged, reason)
            error, best = now, (what, finer)
        idle = 0 if now <= _GAIN * before else idle + (not falling)
        if (error <= wanted and not cut_short(reason)) or idle == _IDLE:
            break
    if best is None:
        return None
    found, finer = best
    seconds = {**made.seconds, "finer": time.perf_counter() - clock}
    return replace(found, history=history, seconds=seconds), finer
