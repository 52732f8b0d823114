"""Area-preserving map of a genus-one surface onto a torus of revolution, Algorithm 4.1."""

from __future__ import annotations

import dataclasses
import logging
import math
import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from ..base.budget import Budget
from ..base.options import callback, flag, instance, one_of, real, whole
from ..base.progress import Progress
from ..base.threads import takes_threads
from ..base.torus import TWO_PI, Torus
from ..certificate.checks import certify
from ..conformal.map import ConformalMap, conformal_map
from ..errors import CertificationError, OptionError, SolverError
from ..homology.basis import HomologyBasis
from ..maps.history import IterationRecord
from ..mesh.given import as_surface, require_same_mesh
from ..mesh.halved_faces import SurfaceRefinement
from .coarse import Level, levels
from .finer import ROUND_STEPS, Finer, goal, mapped_finer
from .finish import Steps, cut_short, finish_areas, unfolded
from .flat import unfolded_turns
from .result import AreaMap
from .route import EASING, EqualAreas, Finish, Made, Route, best_turns, follow
from .search import Ratio, search_phase
from .work import Work

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

__all__ = ["SHAPES", "Finish", "area_map", "charted", "equal_areas", "finished", "turned"]

_log = logging.getLogger("stretchmap")

_MOST_TURNS = 1e3  # a phase may have
# Weights of shape in the chart where equal areas leave faces folded: few edges round a branch span
# so much of the torus then that what lies between two rounds of them is cut off.
SHAPES = (1.0, 10.0, 100.0, 1e3)
# The same where the surface is to become finer. Areas are less equal in such a chart, so edges are
# halved for good only once they are nearly right: until then up to that sag is left.
_EASED = (0.01, 0.1, 1.0)
_COARSELY = 3.0
_RESERVED = (
    0.25  # share of the work, for the surface as it is, until no face of a finer one is folded
)
_AT_ONCE = 0.6  # share of all faces that there may be, that this may take


@takes_threads
def area_map(
    surface: TriMesh,
    *,
    basis: HomologyBasis | None = None,
    conformal: ConformalMap | None = None,
    torus: Torus | None = None,
    phase: float | None = None,
    ratio: Ratio | float = "conformal",
    finish: Finish = "ring",
    max_iter: int = 100,
    tol: float = 5e-3,
    shape_budget: float = 1.2,
    balance: float = 1.0,
    sem_iter: int = 10,
    refine: bool = True,
    time_limit: float = 1e-3,
    keep_best: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> AreaMap:
    """Map a genus-one surface onto a torus of revolution so that areas are preserved.

    Stretch energy minimisation (Algorithm 4.1) in the equal-area chart of the torus; the phase
    around the tube by a search; then Newton steps on the areas of the polyhedral image, vertices
    gliding on the torus, no face ever turned over.

    Parameters
    ----------
    surface : TriMesh
        Closed surface of genus one.
    basis : HomologyBasis, optional
        From `homology_basis`; computed if left out.
    conformal : ConformalMap, optional
        From `conformal_map`; computed if left out.
    torus : Torus, optional
        Torus to map onto, with its size and ratio of radii. Left out, it has the surface's area.
    phase : float, optional
        Turns to add to the equal-area coordinate around the tube; searched if left out.
    ratio : "conformal", "search" or float
        ``R / r``: that of the conformal map, the best found by a search, or given (above 1). Not
        together with ``torus``.
    finish : "ring", "face" or "none"
        ``"face"``: Newton steps on the face areas of the polyhedral image. ``"ring"``: then, where
        their SD is at most twice ``tol``, a projection that makes the area of every vertex ring
        exact, kept if the faces stay within ``tol`` or do not get worse. ``"none"``: the chart's
        map as it is, a start for others, returned whether it is certified or not.
    max_iter : int
        Most Newton steps.
    tol : float
        Goal for the standard deviation of the face ratios; none is to be off by more than 10 times
        that.
    shape_budget : float
        Once the face SD is below twice ``tol``, the Newton steps end where the mean angle
        distortion exceeds the least seen by this factor: on regular triangulations the last per
        cent of area is paid for with needles.
    balance : float
        From 0, the Newton steps keep shapes as well as areas, to 1, areas alone: the power to which
        the largest weight of the area term is raised. Below 1 they end where the energy is at rest,
        no matter what ``tol`` is, and rings are left as they come. Not with ``finish="none"``.
    sem_iter : int
        Most steps of stretch energy minimisation.
    refine : bool
        Halve edges that span so much of the torus that no flat face beside them can have its area,
        where the face SD would exceed twice ``tol`` and 0.01; ``mesh`` of the result is then finer
        than ``surface``. Not with ``finish="none"`` or a ``balance`` below 1.
    time_limit : float
        Processor seconds per face, of all threads, that may be spent: where they are used up, the
        steps end. Small surfaces get some seconds.
    keep_best : bool
        Return the map even if it is not certified.
    threads : int, optional
        Threads to use, see `threads`; the result does not depend on it.
    progress : Progress, optional
        Called once per step.

    Returns
    -------
    AreaMap
        ``converged`` is False, and a warning logged, if ``tol`` was not reached.

    Raises
    ------
    OptionError
        An option out of range.
    CertificationError
        Faces of the polyhedral image stay folded, or the surface crosses itself; ``ids`` are faces.
    SolverError
        No start without flipped faces was found; ``ids`` are the faces.
    GenusError, KindError, MeshError
        As `conformal_map`; ``conformal`` or ``basis`` is of another surface.

    Notes
    -----
    The finishing solve minimises, over the angles of all vertices,
    ``sum w [(rho - 1/rho)^2 / 4 + (shape Q + chart (sigma + 1/sigma - 2)) / weight]``: w as the
    root of a face's area, rho its area ratio in space, Q = (s1/s2 + s2/s1)/2 - 1 its angle
    distortion, sigma its area ratio in the chart, infinite before a face turns over. The weight
    grows from step to step; that of shapes is less the more of them is lost at the start. Faces
    that look outward by less than half their area are held by a barrier.

    A surface of more than 40,000 faces is first mapped with fewer, by removing vertices; a step of
    stretch energy minimisation and a few Newton steps follow on the surface itself.

    A flat face is no thinner than its edges sag, where its third corner is, below the arcs over
    them. Where many sag by more than twice the height their faces are to have, all that sag too
    much are halved in the chart before anything else, which is eased a little towards shapes for
    it, further where that takes too many faces. Newton steps that let faces look inward lead to
    nearly right areas, edges that sag too much by then are halved, too, as are those of faces left
    looking inward; then the steps above follow. Where areas stay off, the edges that sag most in
    faces that are off are halved, three times at most. All steps together cost no more than some
    two hundred on the surface itself, more on one of less than 4,000 faces, and no more than
    ``time_limit``.

    Where faces of the polyhedral image stay folded, the map is made once more with shapes counting
    in the chart, and more until none is; ``stop_reason`` then says so.

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.area_map(sm.samples.bumpy_torus(1000).surface)
    >>> result.converged, result.distortion.flips, result.distortion.element_std < 5e-3
    (True, 0, True)
    """
    surface = as_surface(surface)
    _check_options(torus, phase, ratio, finish)
    _check_numbers(max_iter, tol, shape_budget, sem_iter)
    balance = real("balance", balance, 0.0, 1.0)
    if finish == "none" and balance < 1.0:
        raise OptionError("balance acts in the finishing steps: take finish='ring' or 'face'")
    keep_best, refine = flag("keep_best", keep_best), flag("refine", refine)
    callback("progress", progress)
    budget = Budget.of(real("time_limit", time_limit, above=0.0), surface.n_faces)
    clock = time.perf_counter()
    conformal = _start(surface, basis, conformal, progress)
    seconds = {"conformal": time.perf_counter() - clock}
    wanted = ratio if torus is None else torus.ratio
    steps = Steps(max_iter, tol, shape_budget if balance == 1.0 else math.inf, balance)
    route = Route(phase, wanted, sem_iter, finish, steps)
    found = _found(route, surface, conformal, progress, torus, refine and balance == 1.0, budget)
    if not found.converged:
        _log.warning("area map: %s", found.stop_reason)
    if finish != "none" and not (found.certificate.certified or keep_best):
        raise CertificationError(
            f"the area map is not certified: {found.certificate.reason}; keep_best=True returns it "
            "all the same",
            next(iter(found.certificate.ids.values()), ()),
        )
    return dataclasses.replace(found, seconds={**seconds, **found.seconds})


def _found(
    route: Route,
    surface: TriMesh,
    conformal: ConformalMap,
    progress: Progress | None,
    torus: Torus | None,
    refine: bool,
    budget: Budget,
) -> AreaMap:
    """The map a route leads to, on a finer surface where it takes one, certified or not."""
    equal = equal_areas(surface, conformal, progress, budget)
    if route.finish == "none":
        return charted(route, equal, conformal, progress, torus)
    stack = levels(equal.level)
    refine = refine and len(stack) == 1
    work = Work.of(surface, budget, refine=refine)
    found = _finest(route, stack, equal, conformal, progress, torus, refine, work)
    if not (work.hurried and cut_short(found.stop_reason)):
        return found
    return dataclasses.replace(
        found, stop_reason=f"the time limit was reached; {found.stop_reason}"
    )


def _finest(
    route: Route,
    stack: list[Level],
    equal: EqualAreas,
    conformal: ConformalMap,
    progress: Progress | None,
    torus: Torus | None,
    refine: bool,
    work: Work,
) -> AreaMap:
    """The same, of a surface as fine as there is work for."""
    surface, finer, coarse = equal.level.surface, None, False
    wanted = goal(surface, route.steps.tol)
    if refine:
        work.reserved = _RESERVED
        coarse, finer = _finer_at_once(route, equal, wanted, progress, torus, work)
        work.reserved = 0.0
        if finer is not None and finer.certificate.certified:
            return finer
    found = _along(route, stack, equal, conformal, progress, torus, work, alone=not coarse)
    unfinished = not _good(found, wanted) or cut_short(found.stop_reason)
    if finer is None and refine and unfinished and not _folded(found):
        level = Level.of(surface, found.angles / TWO_PI, conformal.forms, conformal.aspect)
        start = Finer.of(level, found.angles, found.ratio)
        made = Made(
            found.angles, found.phase, found.ratio, list(found.history),
            found.converged, found.stop_reason, dict(found.seconds),
        )  # fmt: skip
        finer = _finer(route, start, made, wanted, progress, torus, work)
    if finer is None or not finer.certificate.certified:
        return found
    if not found.certificate.certified:
        return finer
    return min(found, finer, key=lambda each: each.distortion.element_std)


def _finer_at_once(
    route: Route,
    equal: EqualAreas,
    wanted: float,
    progress: Progress | None,
    torus: Torus | None,
    work: Work,
) -> tuple[bool, AreaMap | None]:
    """Whether this surface is too coarse for its place in the chart; if so, the map of a finer one.

    From a chart eased towards shapes: in one where areas alone count, faces can be needles by the
    thousand. Where that takes too many faces or leaves some folded, from charts eased further.
    """
    clock = time.perf_counter()
    level = equal.level
    turns, (phase, ratio, _), records = best_turns(route, equal)
    work.spend_in_chart(sum(record.stage == "balance" for record in records))
    if not Finer.wrapped(level, turns, phase, ratio).too_coarse():
        return False, None
    for shape in _EASED:
        if work.steps() < ROUND_STEPS:
            return True, None
        turns, more = equal.eased(shape, turns)
        records = records + more
        work.spend_in_chart(len(more))
        given = (route.phase, route.ratio)
        phase, ratio, _ = search_phase(level.surface, turns, level.aspect, *given)
        finer = Finer.wrapped(level, turns, phase, ratio).fitted(_COARSELY, _AT_ONCE)
        work.spend_on_fitting((finer.level.surface if finer else level.surface).n_faces)
        if finer is not None:
            seconds = {"sem": time.perf_counter() - clock}
            made = Made(finer.angles, phase, ratio, records, seconds=seconds)
            found = _finer(route, finer, made, wanted, progress, torus, work)
            if found is not None:
                return True, found
    return True, None


def _finer(
    route: Route,
    start: Finer,
    made: Made,
    wanted: float,
    progress: Progress | None,
    torus: Torus | None,
    work: Work,
) -> AreaMap | None:
    rings = route.finish == "ring"
    found = mapped_finer(start, made, route.steps, wanted, rings, progress, work)
    if found is None:
        return None
    made, finer = found
    added = finer.added if finer.added.n_split else None
    return _result(finer.level.surface, finer.level.forms, made, torus, added)


def _good(found: AreaMap, face_std: float) -> bool:
    return found.certificate.certified and found.distortion.element_std <= face_std


def _along(
    route: Route,
    stack: list[Level],
    equal: EqualAreas,
    conformal: ConformalMap,
    progress: Progress | None,
    torus: Torus | None,
    work: Work,
    *,
    alone: bool,
) -> AreaMap:
    """The map a route leads to, certified or not; by rising weights of shape while it is folded.

    Unless areas ``alone`` are worth a try, with some weight of shape at once.
    """
    finest = equal.level
    surface, forms = finest.surface, conformal.forms
    found = None
    for shape in (0.0, *SHAPES) if alone else SHAPES:
        along, way = dataclasses.replace(route, shape=shape), stack
        if shape > 0.0:
            if found is not None:
                if found.certificate.certified or not _folded(found) or work.clock.spent:
                    return found
                _log.info("%s: with weight %g of shape", found.certificate.reason, shape)
            equal.shaped(shape, EASING)
            way = [finest]
        try:
            made = follow(along, way, progress, equal if len(way) == 1 else None, work)
        except SolverError as error:  # sizes of faces are lost in rounding; what there is, stands
            if found is None:
                raise
            _log.info("%s", error)
            continue
        if shape > 0.0:
            made.reason = f"faces folded where areas alone counted; {made.reason}"
        other = _result(surface, forms, made, torus)
        if found is None or other.certificate.certified or _folded(other) < _folded(found):
            found = other
    assert found is not None
    if found.certificate.certified or not _folded(found):
        return found
    clock = time.perf_counter()
    newton = finest.newton(found.angles, found.ratio)
    limited = dataclasses.replace(route.steps, max_iter=min(route.steps.max_iter, work.steps()))
    records, _, reason = finish_areas(newton, False, limited, progress, late=work.late)
    found = _moved(found, newton.angles, records, clock)
    return dataclasses.replace(found, converged=False, stop_reason=reason)


def equal_areas(
    surface: TriMesh,
    conformal: ConformalMap,
    progress: Progress | None,
    clock: Budget | None = None,
) -> EqualAreas:
    """The flat chart of a surface, areas yet to be made equal."""
    turns = unfolded_turns(surface, conformal)
    level = Level.of(surface, turns, conformal.forms, conformal.aspect)
    return EqualAreas(level, progress, clock)


def charted(
    route: Route,
    equal: EqualAreas,
    conformal: ConformalMap,
    progress: Progress | None,
    torus: Torus | None = None,
) -> AreaMap:
    """The unfinished map of a route, as it is in the chart, certified or not."""
    surface = equal.level.surface
    unbounded = Work.of(surface, Budget(math.inf), refine=False)
    made = follow(route, [equal.level], progress, equal, unbounded)
    return _result(surface, conformal.forms, made, torus)


def _folded(found: AreaMap) -> int:
    """Faces that look inward or cross each other, at most a thousand or two of each."""
    ids = found.certificate.ids
    return sum(len(ids.get(check, ())) for check in ("boundary_oriented", "boundary_embedded"))


def _result(
    surface: TriMesh,
    forms: NDArray[np.int32],
    made: Made,
    torus: Torus | None,
    refinement: SurfaceRefinement | None = None,
) -> AreaMap:
    clock = time.perf_counter()
    torus = torus or Torus.from_ratio(made.ratio, area=surface.area)
    image = torus.xi(made.angles[:, 0], made.angles[:, 1])
    certificate = certify(surface, image, torus)
    return AreaMap(
        mesh=surface,
        angles=read_only(made.angles),
        image=read_only(image),
        torus=torus,
        phase=made.phase,
        ratio=made.ratio,
        forms=forms,
        refinement=refinement,
        certificate=certificate,
        history=tuple(made.history),
        converged=made.converged,
        stop_reason=made.reason,
        seconds={**made.seconds, "certificate": time.perf_counter() - clock},
    )


def _start(
    surface: TriMesh,
    basis: HomologyBasis | None,
    conformal: ConformalMap | None,
    progress: Progress | None,
) -> ConformalMap:
    """The conformal map, computed if it is not given."""
    if basis is not None:
        instance("basis", basis, HomologyBasis, "see homology_basis")
    if conformal is None:
        return conformal_map(surface, basis=basis, progress=progress)
    instance("conformal", conformal, ConformalMap, "see conformal_map")
    require_same_mesh(
        surface,
        conformal.mesh,
        "the conformal map is of another surface",
        "pass conformal_map(surface), or leave it out",
    )
    return conformal


def finished(
    start: AreaMap, *, max_iter: int, tol: float, progress: Progress | None = None
) -> AreaMap:
    """An unfinished map with its folded faces turned, and up to ``max_iter`` steps on the areas."""
    clock = time.perf_counter()
    level = _level_of(start)
    newton, unfolding = unfolded(level, start.angles, start.ratio, progress)
    steps = Steps(max_iter, tol, math.inf)
    records, converged, reason = finish_areas(newton, False, steps, progress)
    found = _moved(start, newton.angles, unfolding + records, clock)
    return dataclasses.replace(found, converged=converged, stop_reason=reason)


def turned(start: AreaMap, progress: Progress | None = None) -> AreaMap:
    """An unfinished map with its folded faces turned, all others as they are as far as can be."""
    clock = time.perf_counter()
    newton, records = unfolded(_level_of(start), start.angles, start.ratio, progress, keep=True)
    if not records:
        return start
    return _moved(start, newton.angles, records, clock)


def _level_of(found: AreaMap) -> Level:
    return Level.of(found.mesh, found.angles / TWO_PI, found.forms, found.ratio)


def _moved(
    start: AreaMap, angles: NDArray[np.float64], records: list[IterationRecord], clock: float
) -> AreaMap:
    image = start.torus.xi(angles[:, 0], angles[:, 1])
    return dataclasses.replace(
        start,
        angles=read_only(angles),
        image=read_only(image),
        certificate=certify(start.mesh, image, start.torus),
        history=start.history + tuple(records),
        seconds={**start.seconds, "finish": time.perf_counter() - clock},
    )


def _check_options(
    torus: Torus | None, phase: float | None, ratio: str | float, finish: str
) -> None:
    if phase is not None:
        real("phase", phase, -_MOST_TURNS, _MOST_TURNS)
    if isinstance(ratio, str):
        one_of("ratio", ratio, ("conformal", "search"))
    else:
        real("ratio", ratio, above=1.0)
    if torus is not None:
        instance("torus", torus, Torus, "Torus(R, r)")
        if ratio != "conformal":
            raise OptionError("give the torus or the ratio of its radii, not both")
    one_of("finish", finish, ("ring", "face", "none"))


def _check_numbers(max_iter: int, tol: float, shape_budget: float, sem_iter: int) -> None:
    real("tol", tol, above=0.0)
    real("shape_budget", shape_budget, 1.0)
    whole("max_iter", max_iter, 0)
    whole("sem_iter", sem_iter, 0)
