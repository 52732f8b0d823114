"""Turning every inverted tet: foldover-free mapping by continuation, everywhere or in patches.

The regularized energy of ``element_energy.hpp`` is lowered by Newton steps while its epsilon
follows the worst determinant down (Garanzha et al., ACM TOG 40(4), 2021, section 3.2). Determinants
are taken relative to the volume a tet may expect (`SolidModel.local_volumes`): where the boundary
image squeezes a limb into a millionth of its area, its tets are not inverted for being small.

A few steps for the whole solid leave a handful of inverted tets at most. These are then worked on
in patches, each a problem of its own with all other vertices held, at no cost to speak of.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .. import _core
from ..base.budget import Budget
from .model import FIXED, GLIDING, History, SolidModel

__all__ = [
    "MOST_STUCK",
    "Untangled",
    "far_tets",
    "folded_faces",
    "stuck_tets",
    "untangle_patches",
    "untangle_whole",
]

# Epsilon: determinants are 1 where all is well, a larger one tells nothing apart. But where some
# are inverted to many times that, one of 1 makes steps short; in patches, where nothing else turns
# over for it, it is as wide as they ask for. Down to the narrow one more tets turn over than had
# been inverted, which shows nothing.
_WIDEST, _WIDEST_SOFT, _NARROW = 1.0, 5.0, 0.1
# Share of its determinant that the epsilon of an inverted tet is at least. With one epsilon for all
# those inverted farthest have nearly all of the energy, and single ones hold up every step; with a
# share of 1 the others' shapes outweigh them, and they stay where they are. Single ones do with any
# share: it is for where very many are inverted, or so many first steps are no longer than `_SHORT`
# in the mean.
_SOFT, _FIRST = 0.2, 4
_LEAST = 1e-9
_SETTLED = 0.1  # share of the energy; a step that lowers it by more is not done with its epsilon
# What the regularized worst determinant is to come down to, of what it is: as published, and where
# whole steps follow with ease, in patches as long as epsilon is not narrow and after some settled
# ones. Faces that glide are not hurried: single ones stay folded then.
_SLOW, _SWIFT, _DRAGS = 0.9, 0.7, 2
_BETTER = 1.05
# Inverted elements, of those there were, that are progress in haste: patches are quicker than a
# step for each. Where no other start follows, that leaves more than patches cure.
_FEWER = 0.93
_AWAY = 6  # steps where nothing was inverted to begin with
_ENOUGH = 6  # steps without progress once nothing is inverted, on the way to the floor
# Inverted elements that are better worked on in patches: among slivers a hundredth of them hold up
# all others for as long as there is time.
_FEW, _FEW_SHARE = 30, 0.01
_FEW_PATIENCE = 4
# Inverted tets: with a larger share of all, patches do not help, and another start may. With fewer,
# so many steps without progress in haste are enough: patches cure in the time of ten what thirty
# more do not. Not before epsilon is narrow, though: down to there more turn over, and patches made
# of those are given up. Then steps on the way count as well: who has not got further by there is
# served better by patches.
MOST_STUCK, _HASTY_PATIENCE = 0.05, 10
_PATCH_STEPS, _PATCH_PATIENCE = 150, 40
# Times the volume a tet may expect: what is that large has most of the energy.
_FAR = 100.0
# Steps in a row, none longer than that and none with fewer inverted elements than there had been:
# a few of them are so far off that all others wait for them.
_JAMMED, _SHORT = 8, 0.125


@dataclass(frozen=True, eq=False)
class Untangled:
    """Where untangling ended.

    Attributes
    ----------
    x : ndarray, shape (n, 3)
    left : int
        Inverted tets and, where the boundary glides, folded faces.
    worst : float
        Least determinant, relative to the volume the tet may expect.
    """

    x: NDArray[np.float64]
    left: int
    worst: float


@dataclass
class Patience:
    """Counts the steps since the last one that got further.

    Fewer inverted elements are progress (less than a share of what they were), then a better worst
    one; and energy that still falls is no standstill.
    """

    fewest: float = math.inf
    highest: float = -math.inf
    since: int = 0

    def note(self, left: int, worst: float, settled: bool, share: float = 1.0) -> None:
        fewer = left < share * self.fewest
        if fewer or (left == 0 and (left < self.fewest or worst > _BETTER * self.highest)):
            self.fewest, self.highest, self.since = left, worst, 0
        elif settled:
            self.since += 1


def _continue(
    newton: _core.volume.SolidNewton,
    x: NDArray[np.float64],
    *,
    face: float,
    floor: float,
    steps: int,
    enough: Callable[[int, int, float], bool],
    hasty: bool = False,
    soft: float = 0.0,
    widest: float = _WIDEST,
    linear: _core.volume.NewtonOptions,
    budget: Budget,
    note: Callable[[int, NDArray[np.float64], _core.volume.NewtonReport, float], None]
    | None = None,
) -> Untangled:
    """Follow the worst determinant down with epsilon, no wider than ``widest`` to begin with;
    ``enough(left, since, epsilon)`` ends it."""
    state = newton.value(x, _core.volume.EnergyWeights(1.0, 1.0, 1.0, face))
    left, worst = state.flips + state.folds, min(state.min_det, state.min_facing)
    # A better worst tet is not worth turning others over for long, nor many steps.
    clean, from_afar = left == 0, widest > _WIDEST
    steps = min(steps, _AWAY) if clean else steps
    epsilon = floor if clean else min(max(0.2 * abs(worst), 10.0 * floor), widest)
    patience = Patience(left, worst)
    best, short = Untangled(x, left, worst), 0
    for iteration in range(1, steps + 1):
        if (left == 0 and worst >= floor) or ((clean or left == 0) and patience.since >= _ENOUGH):
            break
        if (left and enough(left, patience.since, epsilon)) or budget.spent:
            break
        if hasty and short == _JAMMED:
            break
        weights = _core.volume.EnergyWeights(1.0, 1.0, epsilon, face, soft)
        x, step = newton.step(x, weights, linear)
        before, after = step.before.energy, step.after
        if note is not None:
            note(iteration, x, step, epsilon)
        left, worst = after.flips + after.folds, min(after.min_det, after.min_facing)
        settled = before - after.energy <= _SETTLED * (before + 2.0)
        wide = from_afar and epsilon > _NARROW
        patience = Patience() if wide and not (soft and best.left <= _FEW) else patience
        patience.note(left, worst, settled, _FEWER if hasty else 1.0)
        short = short + 1 if step.alpha <= _SHORT and left >= best.left else 0
        if (left, -worst) <= (best.left, -best.worst):
            best = Untangled(x, int(left), worst)
        if settled:
            drags = left <= _FEW and patience.since >= _DRAGS
            swift = (soft or wide or drags) and step.alpha >= 1.0 and not face
            epsilon = max(_next_epsilon(epsilon, worst, _SWIFT if swift else _SLOW), _LEAST)
    return best


def _next_epsilon(epsilon: float, worst: float, pace: float) -> float:
    """Regularization for the next step, from the worst determinant (Garanzha et al., 2021)."""
    chi = 0.5 * (worst + math.sqrt(epsilon * epsilon + worst * worst))
    goal = pace * chi
    return 2.0 * math.sqrt(max(goal * (goal - worst), 1e-24))


def untangle_whole(
    model: SolidModel,
    x: NDArray[np.float64],
    history: History,
    *,
    glide: bool,
    thorough: bool = False,
    hasty: bool = False,
    soft: bool = False,
) -> Untangled:
    """Untangle all tets at once, until none or so few are inverted that patches serve better.

    Parameters
    ----------
    model : SolidModel
    x : ndarray, shape (n, 3)
    history : History
        Gets a record per step, of the stage ``"untangle"``.
    glide : bool
        Whether the boundary may glide; then folded boundary faces are unfolded, too.
    thorough : bool
        Leave none to the patches.
    hasty : bool
        Leave them all to the patches where steps stay short or cure single ones.
    soft : bool
        Where very many tets are inverted or the first steps are short, keep what is inverted far
        from holding up all else: long steps that leave few inverted, but those farther than they
        were. With a boundary that does not glide.
    """
    o = model.options
    newton = model.newton(x, glide=glide, weights=model.roomy_weights)
    newton.set_targets(model.roomy_volumes)
    # Gliding is a matter of the whole boundary.
    few = 0 if glide or thorough else max(_FEW, int(_FEW_SHARE * len(model.T)))

    def patience(left: int, epsilon: float) -> int:
        if left <= few and not glide:
            return _FEW_PATIENCE
        soon = hasty and epsilon <= _NARROW and left <= MOST_STUCK * len(model.T)
        return min(_HASTY_PATIENCE, o.patience) if soon else o.patience

    lengths: list[float] = []

    def note(
        iteration: int, at: NDArray[np.float64], step: _core.volume.NewtonReport, epsilon: float
    ) -> None:
        lengths.append(step.alpha)
        history.add(
            "untangle", iteration, at, energy=step.after.energy, step=step.alpha,
            residual=epsilon, total=o.untangle_iter,
        )  # fmt: skip

    def held_up() -> bool:
        first = lengths[:_FIRST]
        return len(first) == _FIRST and sum(first) <= _FIRST * _SHORT

    def follow(share: float, widest: float, *, tried: bool = False) -> Untangled:
        def enough(left: int, since: int, epsilon: float) -> bool:
            return since >= patience(left, epsilon) or (tried and held_up())

        return _continue(
            newton,
            x,
            face=o.face_weight if glide else 0.0,
            floor=o.floor,
            steps=o.untangle_iter,
            enough=enough,
            hasty=hasty,
            soft=share,
            widest=widest,
            linear=_core.volume.NewtonOptions(tol=min(o.cg_tol, 1e-2), max_cg=o.max_cg),
            budget=history.budget,
            note=note,
        )

    if not soft:
        return follow(0.0, _WIDEST)
    inverted = newton.value(x, _core.volume.EnergyWeights(1.0, 1.0, 1.0, 0.0)).flips
    if inverted > MOST_STUCK * len(model.T):
        return follow(_SOFT, _WIDEST_SOFT)
    done = follow(0.0, _WIDEST, tried=True)
    if not done.left or not held_up():
        return done
    return min(follow(_SOFT, _WIDEST_SOFT), done, key=lambda each: each.left)


def stuck_tets(model: SolidModel, x: NDArray[np.float64], *, glide: bool) -> NDArray[np.intp]:
    """Tets that are inverted, by exact signs, or lie at a folded boundary face."""
    stuck = np.zeros(len(model.T), bool)
    stuck[_core.certificate.not_positive_tets(x, model.T)] = True
    if glide:
        folded = folded_faces(model, x)
        touched = np.ones(len(model.V), bool)
        touched[model.boundary] = False
        inside = touched.copy()
        touched[model.faces[folded]] = True
        # Of a tet without a boundary face, at least two vertices lie inside.
        stuck |= (inside[model.T].sum(axis=1) == 1) & touched[model.T].all(axis=1)
    return np.flatnonzero(stuck)


def far_tets(model: SolidModel, x: NDArray[np.float64]) -> NDArray[np.intp]:
    """Tets whose image, inverted or not, is very many times the volume they may expect."""
    expected = _core.mesh.tet_volumes(model.V, model.T) * model.roomy_volumes
    return np.flatnonzero(np.abs(_core.mesh.tet_volumes(x, model.T)) > _FAR * expected)


def folded_faces(model: SolidModel, x: NDArray[np.float64]) -> NDArray[np.intp]:
    """Boundary faces that do not look outward everywhere, and of which a vertex may glide.

    On a torus those that reach far round its axis, too: what unfolds them has better volumes.
    """
    if model.torus is None:
        rows = model.gliding_faces
        return rows[~(model.gliding(model.faces[rows]).facing(x) > 0.0)]
    folded = _core.certificate.torus_graph(x, model.faces, model.torus.R, strict=True).bad
    return np.intersect1d(folded, model.gliding_faces)


@dataclass(frozen=True, eq=False)
class Patch:
    """Some tets as a problem of their own, all vertices at their rim held.

    Attributes
    ----------
    tets : ndarray of intp, shape (p,)
    vertices : ndarray of intp, shape (q,)
    motion : ndarray of uint8, shape (q,)
    """

    tets: NDArray[np.intp]
    vertices: NDArray[np.intp]
    motion: NDArray[np.uint8]


def patches_round(
    model: SolidModel, tets: NDArray[np.intp], rings: int, *, glide: bool
) -> list[Patch]:
    """Patches that reach ``rings`` further than some tets; those that overlap are united.

    They do not reach past vertices that do not move: nothing is handed on there, and where most
    vertices lie on the boundary, single ones have hundreds of tets.
    """
    T, motion = model.T, model.motion(glide=glide)
    near = np.zeros(len(model.V), bool)
    near[T[tets]] = True
    for _ in range(rings):
        near[T[(near & (motion != FIXED))[T].any(axis=1)]] = True
    free = near & (motion != FIXED)
    rows = np.flatnonzero(free[T].any(axis=1))
    corners = T[rows]
    inside = free[corners]
    # Tets and the free vertices they share: parts of this graph are patches.
    owner = np.broadcast_to(np.arange(len(rows))[:, None], corners.shape)[inside]
    shared, place = np.unique(corners[inside], return_inverse=True)
    n = len(rows) + len(shared)
    links = coo_matrix((np.ones(len(owner), np.int8), (owner, len(rows) + place)), (n, n))
    label = connected_components(links, directed=False)[1][: len(rows)]
    found = []
    for part in np.unique(label):
        members = rows[label == part]
        vertices = np.unique(T[members])
        found.append(Patch(members, vertices, np.where(free[vertices], motion[vertices], FIXED)))
    return found


def untangle_patches(
    model: SolidModel,
    x: NDArray[np.float64],
    stuck: NDArray[np.intp],
    *,
    rings: int,
    glide: bool,
    budget: Budget,
) -> NDArray[np.float64]:
    """Untangle the surroundings of some tets, all other vertices held.

    Parameters
    ----------
    model : SolidModel
    x : ndarray, shape (n, 3)
    stuck : ndarray of intp
        Tets.
    rings : int
        Rings of vertices round them that may move.
    glide : bool
    budget : Budget

    Returns
    -------
    ndarray, shape (n, 3)
        With fewer inverted tets, if anything changed.
    """
    o = model.options
    x = x.copy()
    for patch in patches_round(model, stuck, rings, glide=glide):
        number = np.full(len(model.V), -1, np.int32)
        number[patch.vertices] = np.arange(len(patch.vertices))
        boundary = None
        if glide:
            moving = np.zeros(len(model.V), bool)
            moving[patch.vertices] = patch.motion == GLIDING
            faces = model.faces[moving[model.faces].any(axis=1)]
            if len(faces):
                boundary = model.gliding(faces, number)
        weights = model.roomy_weights[patch.tets]
        start = np.ascontiguousarray(x[patch.vertices])
        newton = _core.volume.SolidNewton(
            start,
            tets=np.ascontiguousarray(number[model.T[patch.tets]]),
            rest=model.rest(patch.tets),
            weights=weights / weights.sum(),
            motion=patch.motion.astype(np.uint8),
            boundary=boundary,
        )
        newton.set_targets(model.roomy_volumes[patch.tets])
        done = _continue(
            newton,
            start,
            face=o.face_weight if boundary is not None else 0.0,
            floor=o.floor,
            steps=_PATCH_STEPS,
            enough=lambda left, since, epsilon: since >= _PATCH_PATIENCE,
            widest=math.inf,
            linear=_core.volume.NewtonOptions(tol=1e-2, max_cg=o.max_cg),
            budget=budget,
        )
        x[patch.vertices] = done.x
    return x
