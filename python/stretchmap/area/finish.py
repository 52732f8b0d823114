"""The polyhedral image: folds undone, then areas by Newton steps, then rings made exact."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress, report
from ..errors import DegenerateError
from ..maps.history import IterationRecord
from .coarse import Level
from .work import Work

# Weights of the finishing energy against which the area term grows.
_SHAPE = 0.1
_CHART = 1.0
_FACING = 1.0
_PUSH = 10.0  # weight of facing where areas are nearly right and are to stay so
_GROWTH, _MOST_WEIGHT = 4.0, 4.0**9  # more of it leaves nothing of the barriers
_LIGHT = 4.0**3  # more of it from afar lets faces that are too coarse stand up from the torus
_NEAR = 0.1  # face SD up to which steps may let faces look inward
# After so many steps towards areas they go on while so many more lower the least face SD to less
# than that share of it, until it is low enough for edges to be halved.
_SURE, _LOOK, _FALLS, _FAR = 10, 5, 0.9, 0.25
_FULL_STEP = 0.5  # a step at least this long lets the area term grow
# Barriers much lighter than the error let steps run up against them; so heavy they are at least, in
# units of its square, less by a factor where long steps gain less than that share of the energy;
# but never more than that, or they alone would count from afar.
_CENTERED, _FADING, _WALLS = 10.0, 0.7, 0.2
_LONG_STEP, _LITTLE = 0.9, 0.1
_AT_REST, _MOST_DONE = "energy at rest", "most steps done"
_STALLED = 3  # steps in a row without any length end the iteration
_ROUGH = 8.0  # times the tolerance
_BEST_STEPS = 2  # of the projection of the rings, where fewer do not serve
_GOOD = 0.5  # times the tolerance: areas so good are to stay so
_AHEAD = 3  # times the weight of the area term has grown at once on a finer surface
_REST, _SLOW = 8, 0.01  # so many steps that lower the energy by less than this share end it, too
_RATIO_GOAL = 10.0  # largest |ratio - 1| allowed, in units of tol
_MARGIN = 0.8  # face SD, in units of tol, where the Newton steps end: the rings need some room
_FAIR = 2.0  # face SD, in units of tol, up to which the shape budget counts and rings are tried
_WORSE = 1.2  # times the least face SD so far: steps that end with more are undone
_RING_WEIGHT = 1e4  # most weight of the area term in the projection of the rings

# Where others follow that keep shapes more, steps beyond the first are better spent there.
UNFOLD_STEPS, FEW_UNFOLD_STEPS = 100, 40
_KEEPING_STEPS = 80
_JAMMED, _SHORT = 10, 1e-3  # steps in a row, shorter than that, unfold nothing any more
# In so many steps the fewest faces folded so far are to become fewer by that factor: what is mostly
# folded or folds ever more faces is not unfolded by any number of steps.
_WINDOW, _FEWER = 10, 0.7
# In half as many where areas are nearly right, many are folded and the energy hardly falls.
_MANY, _MANY_OF, _FALLING = 30, 5e-4, 0.1
_EPSILON = 0.2  # of the worst face
_LEAST_EPSILON, _MOST_EPSILON = 1e-2, 1.0


def unfolded(
    level: Level,
    angles: NDArray[np.float64],
    ratio: float,
    progress: Progress | None,
    *,
    keep: bool = False,
    most: int | None = None,
    work: Work | None = None,
) -> tuple[_core.area.SurfaceNewton, list[IterationRecord]]:
    """What goes on from there, every face looking outward if steps lead there; records.

    Faces too coarse for their place turn inward when the flat chart is wrapped round the torus.
    Either all are to get equal areas meanwhile; or, if that leaves some folded or with ``keep``, to
    keep what area and shape they have there, which takes few steps and folds no others. Steps are
    taken from ``work``, and none for which it has no time.
    """

    def unfold(newton: _core.area.SurfaceNewton, most: int) -> list[IterationRecord]:
        if work is None:
            return unfold_faces(newton, most, progress)
        work.begin(newton, level.surface.n_faces)
        found = unfold_faces(
            newton, work.steps(level.surface.n_faces, least=most, most=most), progress
        )
        work.spend(len(found), level.surface.n_faces)
        return found

    newton = level.newton(angles, ratio)
    if newton.least_facing() > 0.0:
        return newton, []
    tried = [] if keep else unfold(newton, UNFOLD_STEPS if most is None else most)
    if newton.least_facing() > 0.0:
        return newton, tried
    try:
        keeping = level.keeping(angles, ratio)
    except DegenerateError:  # a face whose area is lost in rounding cannot keep it
        return newton, tried
    history = unfold(keeping, _KEEPING_STEPS)
    if keeping.least_facing() > 0.0 or keep:
        newton = level.newton(keeping.angles, ratio)
    # They compare areas with those to be kept.
    return newton, tried + [replace(r, ring_std=math.nan, element_std=math.nan) for r in history]


def unfold_faces(
    newton: _core.area.SurfaceNewton,
    steps: int,
    progress: Progress | None,
    pace: Pace | None = None,
    late: Callable[[], bool] | None = None,
) -> list[IterationRecord]:
    """Newton steps on the regularized energy until every face looks outward.

    With a pace, areas are nearly right and the area term is as heavy as it says. At most ``steps``,
    and no more where the number of those that do not hardly falls, or once `late` says so.
    """
    start = time.perf_counter()
    history: list[IterationRecord] = []
    weight, push = (1.0, _FACING) if pace is None else (pace.weight, _PUSH)
    short, n_faces = 0, 2 * len(newton.angles) if pace else 0
    fewest: list[int] = []
    for iteration in range(steps):
        facing = newton.least_facing()
        if facing > 0.0 or (late is not None and late()):
            break
        epsilon = min(max(-_EPSILON * facing, _LEAST_EPSILON), _MOST_EPSILON)
        taken = newton.step(_weights(weight, weight * push, _SHAPE, epsilon))
        history.append(_record("untangle", iteration + 1, taken, newton.measures(), start))
        report(progress, "area", iteration, steps, flips=history[-1].flips)
        short = short + 1 if taken.step < _SHORT else 0
        fewest.append(min([*fewest[-1:], history[-1].flips]))
        hasty = pace is not None and many_folded(fewest[-1], n_faces)
        hasty = hasty and taken.before - taken.after < _FALLING * abs(taken.before)
        window = _WINDOW // 2 if hasty else _WINDOW
        slow = len(fewest) > window and fewest[-1] > _FEWER * fewest[-1 - window]
        if taken.step == 0.0 or short == _JAMMED or slow:
            break
    return history


def many_folded(folded: int, n_faces: int) -> bool:
    """Whether so many of so many faces are not the last few."""
    return folded > max(_MANY, _MANY_OF * n_faces)


@dataclass
class Pace:
    """Where the Newton steps of one surface ended, and those of a finer one begin."""

    weight: float = 1.0  # of the area term
    prolonged: bool = False  # from a coarser surface

    def finer(self) -> Pace:
        """Areas are right on the whole, so the area term may be heavy at once."""
        return Pace(min(self.weight * _GROWTH**_AHEAD, _MOST_WEIGHT), prolonged=True)


@dataclass(frozen=True)
class Steps:
    """Options of the Newton steps, as `area_map` takes them."""

    max_iter: int
    tol: float
    shape_budget: float
    balance: float = 1.0

    def rough(self) -> Steps:
        """For a coarse surface: the last per cent is paid with shears from face to face."""
        return replace(self, tol=_ROUGH * self.tol)


def approach_areas(
    newton: _core.area.SurfaceNewton,
    most: int,
    progress: Progress | None,
    late: Callable[[], bool] | None = None,
    pace: Pace | None = None,
) -> tuple[list[IterationRecord], Pace]:
    """Newton steps until areas are nearly right, whichever way faces look meanwhile; their pace.

    From afar the barrier against faces that look inward leaves but short steps. What steps follow
    on others of the same surface goes on at their pace.
    """
    start = time.perf_counter()
    history: list[IterationRecord] = []
    pace = Pace() if pace is None else replace(pace)
    shape, at_rest, error = _shape_weight(newton), _rest(), newton.measures().face_std
    lowest = [error]
    while len(history) < most and error > _NEAR:
        if late is not None and late():
            break
        if len(history) >= _SURE and (
            error <= _FAR
            or (len(history) % _LOOK == 0 and lowest[-1] > _FALLS * lowest[-1 - _LOOK])
        ):
            break
        taken = newton.step(_weights(pace.weight, 0.0, shape))
        if taken.step >= _FULL_STEP:
            pace.weight = min(pace.weight * _GROWTH, _LIGHT)
        measured = newton.measures()
        error = measured.face_std
        history.append(_record("approach", len(history) + 1, taken, measured, start))
        report(progress, "area", len(history), most, face_std=error)
        lowest.append(min(lowest[-1], error))
        if at_rest(taken):
            break
    return history, pace


def finish_areas(
    newton: _core.area.SurfaceNewton,
    rings: bool,
    steps: Steps,
    progress: Progress | None,
    pace: Pace | None = None,
    late: Callable[[], bool] | None = None,
) -> tuple[list[IterationRecord], bool, str]:
    """Newton steps on the polyhedral areas: records, converged, reason; `pace` is moved on.

    Faces that look outward stay so; if some do not, that barrier is left out. None follows once
    `late` says so. Where slivers let the energy fall and the areas get worse, the best are kept.
    """
    start = time.perf_counter()
    history: list[IterationRecord] = []
    pace = Pace() if pace is None else pace
    tol = steps.tol
    worst = _MARGIN * tol if pace.prolonged else tol
    weight, least, heaviest = pace.weight, math.inf, _MOST_WEIGHT**steps.balance
    barrier = _FACING if newton.least_facing() > 0.0 else 0.0
    shape = _shape_weight(newton) if steps.balance == 1.0 else _SHAPE
    center = _Center(_CENTERED if steps.balance == 1.0 else 0.0)
    taken, error = None, math.inf
    at_rest, best = _rest(), _Best()
    reason = _MOST_DONE
    for iteration in range(steps.max_iter + 1):
        if iteration:
            if late is not None and late():
                break
            walls = center.least(error)
            taken = newton.step(_weights(weight, barrier, shape, walls=walls))
            center.move_on(taken)
            if taken.step >= _FULL_STEP:
                weight = min(weight * _GROWTH, heaviest)
        measured = newton.measures()
        error, pace.weight = measured.face_std, weight
        least = min(least, measured.angle_mean)
        best.see(newton, measured)
        history.append(_record("newton", iteration, taken, measured, start))
        report(progress, "area", iteration, steps.max_iter, face_std=measured.face_std)
        if steps.balance == 1.0 and measured.face_std <= _MARGIN * tol and _within(measured, worst):
            break
        if ended := _ended(measured, tol, taken, at_rest, steps.shape_budget * least):
            if ended == _AT_REST and weight < heaviest:
                weight, at_rest = min(weight * _GROWTH, heaviest), _rest()
                continue
            reason = ended
            break
    if steps.balance < 1.0:
        return history, reason == _AT_REST and history[-1].flips == 0, reason
    if best.restored(newton, measured):
        measured = newton.measures()
        history.append(_record("newton", len(history), None, measured, start))
    last = _weights(min(weight, _RING_WEIGHT), barrier, shape)
    # Steps that are best for the faces, too, cost as much as three Newton steps each.
    fewest = 0 if pace.prolonged else _BEST_STEPS if _within(measured, _GOOD * tol) else 1
    rings = rings and worth_rings(measured, tol)
    if rings and newton.project_rings(last, tol, _RATIO_GOAL * tol, fewest, _BEST_STEPS):
        history.append(_record("newton", len(history), None, newton.measures(), start))
    return history, *_verdict(newton.measures(), tol, reason)


def worth_rings(measured: _core.area.SurfaceMeasures, tol: float) -> bool:
    """Whether rings may become exact: where faces are off by more, they would get worse."""
    return measured.face_std <= _FAIR * tol


def cut_short(reason: str) -> bool:
    """Whether more steps would have followed."""
    return _MOST_DONE in reason


def _verdict(measured: _core.area.SurfaceMeasures, tol: float, reason: str) -> tuple[bool, str]:
    """Whether the areas are good enough, and why the steps ended."""
    if measured.flips == 0 and _within(measured, tol):
        return True, "areas within tol"
    return False, f"{reason}{_shortfall(measured)}, tol {tol:.2e}"


def _rest() -> Callable[[_core.area.NewtonStep], bool]:
    """Whether the last steps, told one by one, were all too short or too small to go on."""
    stalled = slow = 0

    def at_rest(taken: _core.area.NewtonStep) -> bool:
        nonlocal stalled, slow
        stalled = stalled + 1 if taken.step == 0.0 else 0
        slow = slow + 1 if taken.before - taken.after < _SLOW * abs(taken.before) else 0
        return stalled == _STALLED or slow == _REST

    return at_rest


class _Best:
    """The best areas of some steps, those with the fewest faces that do not look outward."""

    def __init__(self) -> None:
        self._key: tuple[float, float] = math.inf, math.inf
        self._angles: NDArray[np.float64] | None = None

    def see(self, newton: _core.area.SurfaceNewton, measured: _core.area.SurfaceMeasures) -> None:
        """One more step, which may be better than all before."""
        if (key := (measured.flips, measured.face_std)) < self._key:
            self._key, self._angles = key, newton.angles

    def restored(
        self, newton: _core.area.SurfaceNewton, measured: _core.area.SurfaceMeasures
    ) -> bool:
        """Whether the last step was so much worse that the best is taken back."""
        flips, face_std = self._key
        as_good = flips == measured.flips and measured.face_std <= _WORSE * face_std
        if as_good or self._angles is None:
            return False
        newton.angles = self._angles
        return True


@dataclass
class _Center:
    """How heavy barriers are at least, over the square of the face SD."""

    share: float

    def least(self, face_std: float) -> float:
        """Weight over that of the areas."""
        return min(self.share * face_std**2, _WALLS)

    def move_on(self, taken: _core.area.NewtonStep) -> None:
        """Nearer to the walls where long steps gain little, back where they are short."""
        if taken.step < _FULL_STEP:
            self.share = min(self.share / _FADING, _CENTERED)
        elif taken.step > _LONG_STEP and taken.before - taken.after < _LITTLE * abs(taken.before):
            self.share *= _FADING


def _weights(
    area: float, facing: float, shape: float, epsilon: float = 0.0, walls: float = 0.0
) -> _core.area.SurfaceWeights:
    """The weight of the areas is one, that of the rest falls as theirs is to grow.

    That of barriers not below ``walls``.
    """
    shape, chart = shape / area, max(_CHART / area, walls)
    facing *= max(1.0 / area, walls)
    return _core.area.SurfaceWeights(shape=shape, chart=chart, facing=facing, epsilon=epsilon)


def _shape_weight(newton: _core.area.SurfaceNewton) -> float:
    """With which shapes cost no more than they do where the mean angle distortion is 2.

    On long limbs and round small handles shapes are lost whatever is done; in full they would
    outweigh the areas for most of the steps.
    """
    return _SHAPE / max(newton.measures().angle_mean - 1.0, 1.0)


def _ended(
    measured: _core.area.SurfaceMeasures,
    tol: float,
    taken: _core.area.NewtonStep | None,
    at_rest: Callable[[_core.area.NewtonStep], bool],
    most_angle: float,
) -> str:
    """Why no further step is to be taken, empty while one is."""
    if taken is not None and at_rest(taken):
        return "no step lowers the energy" if taken.step == 0.0 else _AT_REST
    if measured.face_std <= _FAIR * tol and measured.angle_mean > most_angle:
        return "shape budget spent"
    return ""


def _shortfall(measured: _core.area.SurfaceMeasures) -> str:
    folds = f", {measured.flips} faces do not look outward" if measured.flips else ""
    return f"{folds}, face SD {measured.face_std:.2e}, worst {measured.face_error:.2e}"


def _within(measured: _core.area.SurfaceMeasures, tol: float) -> bool:
    return measured.face_std <= tol and measured.face_error <= _RATIO_GOAL * tol


def _record(
    stage: str,
    iteration: int,
    taken: _core.area.NewtonStep | None,
    measured: _core.area.SurfaceMeasures,
    start: float,
) -> IterationRecord:
    return IterationRecord(
        stage=stage,
        iteration=iteration,
        energy=math.nan if taken is None else taken.after,
        step=math.nan if taken is None else taken.step,
        residual=math.nan if taken is None else taken.decrement,
        flips=measured.flips,
        ring_std=measured.ring_std,
        element_std=measured.face_std,
        seconds=time.perf_counter() - start,
    )
