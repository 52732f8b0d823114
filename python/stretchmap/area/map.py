"""Area-preserving map of a genus-one surface onto a torus of revolution, Algorithm 4.1."""

from __future__ import annotations

import dataclasses
import logging
import math
import time
from typing import TYPE_CHECKING

from ..base.budget import Budget
from ..base.options import callback, flag, instance, one_of, real, whole
from ..base.progress import Progress
from ..base.threads import takes_threads
from ..base.torus import MOST_ANGLE, MOST_RATIO, TWO_PI, Torus
from ..conformal.map import ConformalMap, conformal_map
from ..errors import CertificationError, OptionError
from ..homology.basis import HomologyBasis
from ..mesh.given import as_surface, require_same_mesh
from .coarse import Level, levels
from .finest import Finest
from .finish import Steps, cut_short, finish_areas, unfolded
from .flat import unfolded_turns
from .result import AreaMap, mapped, moved
from .route import EqualAreas, Finish, Route, follow
from .search import Ratio
from .work import Work

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

__all__ = ["Finish", "area_map", "charted", "equal_areas", "finished", "turned"]

_log = logging.getLogger("stretchmap")


@takes_threads
def area_map(
    surface: TriMesh,
    *,
    basis: HomologyBasis | None = None,
    conformal: ConformalMap | None = None,
    torus: Torus | None = None,
    phase: float | None = None,
    ratio: Ratio | float | None = None,
    finish: Finish = "ring",
    max_iter: int = 100,
    tol: float = 5e-3,
    shape_budget: float = 1.2,
    balance: float = 1.0,
    sem_iter: int = 10,
    refine: bool = True,
    time_limit: float = 2e-2,
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
    ratio : "conformal", "search" or float, optional
        ``R / r``: that of the conformal map, the best found by a search, or given, above 1 and at
        most 1e6, beyond which coordinates are too coarse for the tube. Left out, it is that of the
        conformal map, but the best if that is below 1.1, where many edges have to be halved, if
        fewer are with the best, and where areas stay off, if they do less. Not together with
        ``torus``.
    finish : "ring", "face" or "none"
        ``"face"``: Newton steps on the face areas of the polyhedral image. ``"ring"``: then, where
        their SD is at most twice ``tol``, a projection that makes the area of every vertex ring
        exact, kept if the faces stay within ``tol`` or do not get worse. ``"none"``: the chart's
        map as it is, a start for others, returned whether it is certified or not.
    max_iter : int
        Most Newton steps.
    tol : float
        Goal for the standard deviation of the face ratios; none is to be off by more than 10 times
        that. Twice as much where edges had to be halved: what is left takes most of the steps
        there.
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
        steps end. Small surfaces get some seconds. Few take more than a tenth of it: those that
        need many times their faces, of which there may be as many more as there is time for.
    keep_best : bool
        Return the map even if it is not certified.
    threads : int, optional
        Threads to use, see `threads`; the result depends on it only where time runs short.
    progress : Progress, optional
        Called once per step.

    Returns
    -------
    AreaMap
        ``converged`` is False, and a warning logged, if ``tol`` was not reached; with
        ``finish="none"``, if the stretch energy is not at rest.

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
    looking inward; the last of these are turned in patches with the rest held, before the steps
    above follow. Where areas stay off, the edges that sag most in
    faces that are off are halved, three times at most, on surfaces of more than 40,000 faces, too.
    There become no more than 25 times as many faces with the usual ``time_limit``, in proportion
    with another, and 2.5 times as many and 12,000 at any rate, the last few rounds aside; but never
    more than a million. All
    steps together cost no more than even a slow machine has time for, so that the result does not
    depend on it; without ``refine`` no more than some seven hundred steps, more on a surface of
    less than 4,000 faces.

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
    work = Work.of(surface, budget, refine=refine)
    found = Finest(route, stack, equal, torus, work, progress).found(refine=refine)
    if not (work.out_of_time() and cut_short(found.stop_reason)):
        return found
    return dataclasses.replace(
        found, stop_reason=f"the time limit was reached; {found.stop_reason}"
    )


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
    return mapped(surface, conformal.forms, made, torus)


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
    found = moved(start, newton.angles, unfolding + records, clock)
    return dataclasses.replace(found, converged=converged, stop_reason=reason)


def turned(start: AreaMap, progress: Progress | None = None) -> AreaMap:
    """An unfinished map with its folded faces turned, all others as they are as far as can be."""
    clock = time.perf_counter()
    newton, records = unfolded(_level_of(start), start.angles, start.ratio, progress, keep=True)
    if not records:
        return start
    return moved(start, newton.angles, records, clock)


def _level_of(found: AreaMap) -> Level:
    return Level.of(found.mesh, found.angles / TWO_PI, found.forms, found.ratio)


def _check_options(
    torus: Torus | None, phase: float | None, ratio: str | float | None, finish: str
) -> None:
    if phase is not None:
        real("phase", phase, -MOST_ANGLE, MOST_ANGLE)
    if isinstance(ratio, str):
        one_of("ratio", ratio, ("conformal", "search"))
    elif ratio is not None:
        real("ratio", ratio, above=1.0, high=MOST_RATIO)
    if torus is not None:
        instance("torus", torus, Torus, "Torus(R, r)")
        real("R / r of torus", torus.ratio, high=MOST_RATIO)
        if ratio is not None:
            raise OptionError("give the torus or the ratio of its radii, not both")
    one_of("finish", finish, ("ring", "face", "none"))


def _check_numbers(max_iter: int, tol: float, shape_budget: float, sem_iter: int) -> None:
    real("tol", tol, above=0.0)
    real("shape_budget", shape_budget, 1.0)
    whole("max_iter", max_iter, 0)
    whole("sem_iter", sem_iter, 0)
