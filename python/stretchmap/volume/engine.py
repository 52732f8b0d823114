"""The one way to a certified volume map, whatever holds its boundary.

Start, untangle, minimize with the boundary held, let it glide where it may, and two optional last
stages. What a stage hands on has no inverted tet; a stage that cannot keep that hands back what it
was given.
"""

from __future__ import annotations

import dataclasses
import logging
import time
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.budget import Budget
from ..base.progress import Progress
from ..certificate.checks import certify
from ..mesh.refinement import TETS_PER_EDGE, longest_inner_edges
from .equalize import equalize
from .exact_rings import make_rings_exact
from .ground import glide_on_mesh
from .minimize import Minimized, minimize
from .model import History
from .options import FillOptions, VolumeOptions
from .problem import Outcome, VolumeProblem
from .run import Run
from .start import started
from .untangle import stuck_tets
from .untangle_order import freed, release, untangle

__all__ = ["solve"]

_log = logging.getLogger("stretchmap")

# Mean abs(ratio - 1) from which on more vertices are worth their time, and how often; the tets they
# are for have so many times the mean energy.
_UNEVEN, _FINER_ROUNDS, _POOR = 0.05, 8, 3.0
# More tets get vertices where those do not lead to such a mean, as long as there are no more tets
# than go with it: a coarse solid gets them cheaply.
_MORE, _BADLY = (1.0, 0.3), ((5_000, 0.06), (200_000, 0.08))
_FAR_TOO_UNEVEN = 0.1  # such a mean calls for these at once: the few worst would take many rounds
_FINER = 0.7  # share of the time left that this may take
_GAINED = 0.99  # of how uneven volumes were, at most: else the vertices are taken back


def solve(
    problem: VolumeProblem,
    options: FillOptions,
    *,
    glide: bool = False,
    budget: Budget | None = None,
    patience: float = 1.0,
    hasty: bool = False,
    afar: bool = True,
    resumed: bool = False,
    progress: Progress | None = None,
) -> Outcome:
    """Find a map without inverted tets and with little volume distortion.

    Parameters
    ----------
    problem : VolumeProblem
    options : FillOptions
        `VolumeOptions` if the boundary lies on a torus.
    glide : bool
        Whether the boundary may move on the torus, or the mesh, it lies on.
    budget : Budget, optional
        Default: what the options allow.
    patience : float
        Share of it that untangling may take.
    hasty : bool
        Whether to end where tets stay stuck, as other starts follow.
    afar : bool
        Whether a hasty one goes on where far too many tets for patches are inverted.
    resumed : bool
        Whether the problem is one that ended so.
    progress : Progress, optional
    """
    budget = budget or Budget.of(options.time_limit, problem.n_given_tets)
    clock = time.perf_counter()
    problem = started(problem, solver=options.solver)
    history = History(problem.model(options), budget.share(patience), progress)
    on_mesh = glide and problem.ground is not None
    run = Run(problem, options, history, budget, on_mesh, hasty, afar, resumed)
    run.seconds["start"] = time.perf_counter() - clock
    with run.timed("untangle"):
        left = untangle(run, glide=glide and not on_mesh)
        if left and freed(run):
            left = 0
    run.take(run.problem)  # without what untangling kept
    _core.base.give_free_memory_back()
    if left:
        reason = "the time limit was reached; " if run.history.budget.spent else ""
        stuck = f"{left} tets could not be untangled"
        return dataclasses.replace(_outcome(run, False, reason + stuck), stuck=stuck)
    if not len(run.problem.held):  # else the boundary may stay folded, and another start be better
        history.budget = budget
    if on_mesh:
        return _glided_on_mesh(run)
    converged, reason, newton = _minimize(run, glide=glide)
    exact = False
    graph = not len(run.problem.held)
    graph = graph and not len(stuck_tets(run.history.model, run.x, glide=glide))
    if problem.torus is not None and isinstance(options, VolumeOptions) and graph:
        with run.timed("equalize"):
            x = equalize(run.history.model, run.x, run.history, options, glide=glide, newton=newton)
            _keep(run, x, glide, "volumes along u, v and s left as they were")
        if options.vertex_exact:
            with run.timed("exact"):
                x, why_not = make_rings_exact(
                    run.history.model, run.x, run.history, options.exact_std_factor
                )
            exact = not why_not and _keep(run, x, glide, "ring volumes left as they were")
            if why_not:
                _log.warning("ring volumes left as they were: %s", why_not)
    return _outcome(run, converged, reason, exact)


def _outcome(run: Run, converged: bool, reason: str, exact: bool = False) -> Outcome:
    return Outcome(run.problem, tuple(run.history.records), converged, reason, run.seconds, exact)


def _keep(run: Run, x: NDArray[np.float64], glide: bool, otherwise: str) -> bool:
    """Take over ``x``, unless it has an inverted tet or a face folded beyond proof."""
    stuck = stuck_tets(run.history.model, x, glide=glide)
    if len(stuck) and not certify(run.problem.solid, x, run.problem.torus).certified:
        _log.warning("%s: a tet or a boundary face would turn over", otherwise)
        return False
    run.x = x
    return True


def _minimize(run: Run, *, glide: bool) -> tuple[bool, str, _core.volume.SolidNewton | None]:
    o, history = run.options, run.history
    goal = min(o.frozen_weight, o.volume_weight) if glide else o.volume_weight
    free = o.free_ratios if isinstance(o, VolumeOptions) else (1.0, 1.0)
    converged, reason, newton = False, "", None
    if not (run.problem.warm and glide):
        with run.timed("frozen"):
            first = o.volume_weight if run.problem.warm else min(1.0, goal)
            done = minimize(
                history.model, run.x, history, glide=False, start=first, goal=goal, free=free
            )
        run.x, converged, reason = done.x, done.converged, done.reason
        newton = None if glide else done.newton
        del done  # the next stage has a Hessian of its own, and memory need not hold both
        _core.base.give_free_memory_back()
    if glide:
        alone = o.volume_weight >= VolumeOptions.volume_weight and free == (1.0, 1.0)
        refines = alone and run.problem.refinement is not None
        leave = None if len(run.problem.held) or not refines else partial(_is_uneven, run.problem)
        with run.timed("glide"):
            first = o.volume_weight if run.problem.warm else goal
            done = minimize(
                history.model, run.x, history, glide=True, start=first, goal=o.volume_weight,
                free=free, asked=None if run.problem.warm else history.model.targets, leave=leave,
            )  # fmt: skip
        if len(run.problem.held) and _keep(run, done.x, True, "the map so far is kept"):
            if certify(run.problem.solid, run.x, run.problem.torus).certified:
                history.budget = run.budget  # proven as it is: worth all the time there is
            with run.timed("release"):
                released = release(run)
            if released or not done.converged:
                with run.timed("glide"):
                    done = minimize(
                        history.model, run.x, history, glide=True,
                        start=goal if released else o.volume_weight, goal=o.volume_weight,
                        free=free,
                    )  # fmt: skip
        if refines and (done.converged or done.left) and not len(run.problem.held):
            with run.timed("finer"):
                done = _finer(run, done)
        converged, reason, newton = done.converged, done.reason, done.newton
        if converged and len(run.problem.held):
            converged, reason = False, f"{len(run.problem.held)} vertices of folded faces are held"
        if not _keep(run, done.x, True, "the map with a held boundary is kept"):
            return False, "gliding would fold the boundary", None
    return converged, reason, newton


def _finer(run: Run, done: Minimized) -> Minimized:
    """With more vertices in the tets that keep volumes worst, as often as that helps in time.

    Then on until nothing more is gained.
    """
    o, history = run.options, run.history
    whole, history.budget = history.budget, history.budget.share(_FINER)
    run.x = done.x
    at_once = _is_bad(run.problem, 0) and _mean_error(run.problem, run.x) > _FAR_TOO_UNEVEN
    for poor in _MORE if at_once else (_POOR, *_MORE):
        for _ in range(_FINER_ROUNDS):
            run.x = done.x
            before, edges = run.problem, _uneven_edges(run.problem, poor)
            if not len(edges) or history.budget.spent:
                break
            if poor != _POOR and not _is_bad(before, TETS_PER_EDGE * len(edges)):
                break
            run.take(before.halved(edges))
            more = minimize(
                history.model, run.x, history, glide=True, start=o.volume_weight,
                goal=o.volume_weight, leave=partial(_is_uneven, run.problem),
            )  # fmt: skip
            gained = _unevenness(run.problem, more.x) < _GAINED * _unevenness(before, before.x)
            if poor != _POOR and not (more.left or more.converged):  # cut off, and yet to settle
                gained &= _mean_error(run.problem, more.x) < _mean_error(before, before.x)
            if not gained:
                run.take(before)
                break
            done = more
            _log.info("volumes are kept badly: %d edges halved", len(edges))
    history.budget = whole
    if not done.converged:
        run.x = done.x
        done = minimize(
            history.model, run.x, history, glide=True, start=o.volume_weight, goal=o.volume_weight
        )
    return done


def _ratios(
    problem: VolumeProblem, x: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Volume ratios (6.5) of the tets, and their volumes."""
    volumes, image = (_core.mesh.tet_volumes(at, problem.solid.T) for at in (problem.V, x))
    return image / volumes * (volumes.sum() / image.sum()), volumes


def _unevenness(problem: VolumeProblem, x: NDArray[np.float64]) -> float:
    """Mean abs(ratio - 1) over the volume."""
    ratios, volumes = _ratios(problem, x)
    return float(np.average(np.abs(ratios - 1.0), weights=volumes))


def _mean_error(problem: VolumeProblem, x: NDArray[np.float64]) -> float:
    """The same over the tets, whatever their volumes."""
    return float(np.abs(_ratios(problem, x)[0] - 1.0).mean())


def _is_bad(problem: VolumeProblem, more: int) -> bool:
    """Whether volumes are kept so badly that so many more tets are worth their time."""
    n_tets = problem.solid.n_tets + more
    enough = next((mean for most, mean in _BADLY if n_tets <= most), np.inf)
    return _mean_error(problem, problem.x) > enough


def _is_uneven(problem: VolumeProblem, x: NDArray[np.float64]) -> bool:
    return _mean_error(problem, x) > _UNEVEN


def _uneven_edges(problem: VolumeProblem, poor: float) -> NDArray[np.int32]:
    """The longest edges of the tets whose volume is kept worst, with more than so many times the
    mean energy; none if all keep it well enough."""
    if not _is_uneven(problem, problem.x):
        return np.empty((0, 2), np.int32)
    ratios, volumes = _ratios(problem, problem.x)
    energy = 0.5 * (ratios + 1.0 / ratios) - 1.0
    worst = (energy > poor * np.average(energy, weights=volumes)) & (volumes > volumes.mean())
    return longest_inner_edges(problem.solid, problem.V, np.flatnonzero(worst))


def _glided_on_mesh(run: Run) -> Outcome:
    """With the boundary gliding on a mesh; held, if it need not, or that makes it cross itself."""
    o, history = run.options, run.history
    weight = min(o.frozen_weight, o.volume_weight)
    with run.timed("frozen"):
        run.x = minimize(
            history.model, run.x, history, glide=False, start=min(1.0, weight), goal=weight
        ).x
    needless, done = history.model.kept(run.x), None
    if not needless:
        with run.timed("glide"):
            done = glide_on_mesh(run.problem, o, history)
    glided = done is not None
    if done is None:
        run.take(run.problem)
        with run.timed("frozen"):
            done = minimize(
                history.model, run.x, history, glide=False, start=weight, goal=o.volume_weight
            )
        if not needless:
            _log.warning("the boundary is held: gliding makes its image cross itself")
    run.x = done.x
    outcome = _outcome(run, done.converged, done.reason)
    return dataclasses.replace(outcome, glided=glided)
