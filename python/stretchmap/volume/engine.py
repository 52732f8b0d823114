"""The one way to a certified volume map, whatever holds its boundary.

Start, untangle, minimize with the boundary held, let it glide where it may, and two optional last
stages. What a stage hands on has no inverted tet; a stage that cannot keep that hands back what it
was given.
"""

from __future__ import annotations

import dataclasses
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.budget import Budget
from ..base.progress import Progress
from ..certificate.checks import certify
from ..mesh.refinement import crowded_edges, longest_inner_edges, surrounding_edges
from .equalize import equalize
from .exact_rings import make_rings_exact
from .ground import glide_on_mesh, untangle_on_mesh
from .minimize import Minimized, minimize
from .model import History
from .options import FillOptions, VolumeOptions
from .problem import Outcome, VolumeProblem
from .start import started
from .untangle import MOST_STUCK, folded_faces, stuck_tets, untangle_patches, untangle_whole

__all__ = ["solve"]

_log = logging.getLogger("stretchmap")

_ROUNDS, _HASTY_ROUNDS = 12, 3  # of halving edges; fewer where another start follows
# Reach of the patches, to begin with and where that does not help; and with more vertices there.
_RINGS, _NARROW = (2, 4, 8), (2, 4)
_HELPED = 0.95  # of them are left at most where patches are worth another round
_FEW_STUCK = 60  # worth more vertices round them before anything else
_GETTING_AWAY = 0.1  # share of the time left that a better start for all that follows is worth
# Shares of the time left before the edges round stuck tets are halved instead, and for wide patches
# where another start follows; that much of all has to be left for those.
_GLIDING, _WIDELY, _EARLY = 0.4, 0.15, 0.5
# Where patches had cured half of their tets when time was up, such a share of what is left is
# better spent on the others than on another start.
_CURED, _GOING_ON = 0.5, 0.4
_WORTH = 0.8  # share for patches in which all edges are halved: mostly those do
_NEARLY = 0.9  # share of the time left that untangling may take if only so few are left
# Times the fewest so far, and so many more: halving breeds more than it cures.
_TIMES, _MORE = 2, 100
# Times the tets there were that halving may come to, and tets added for an edge: a coarse solid
# needs them, where single vertices inside see hundreds of faces.
_MOST_TETS, _PER_EDGE = 10, 6

# Mean abs(ratio - 1) from which on more vertices are worth their time, and how often; the tets they
# are for have so many times the mean energy.
_UNEVEN, _FINER_ROUNDS, _POOR = 0.05, 8, 3.0
_FINER = 0.7  # share of the time left that this may take


@dataclass
class _Run:
    problem: VolumeProblem
    options: FillOptions
    history: History  # with the share of time that untangling may take, at first
    budget: Budget  # all of it
    on_mesh: bool = False  # whether the boundary is going to glide on one
    hasty: bool = False  # whether another start follows, worth more than tets that stay stuck
    afar: bool = True  # whether tets far too many for patches are worth time, too
    resumed: bool = False  # whether this one had made room for others
    seconds: dict[str, float] = field(default_factory=dict)

    def take(self, problem: VolumeProblem) -> None:
        """Go on with another problem."""
        self.problem = problem
        self.history.model = problem.model(self.options)

    @property
    def x(self) -> NDArray[np.float64]:
        return self.problem.x

    @x.setter
    def x(self, value: NDArray[np.float64]) -> None:
        self.problem = dataclasses.replace(self.problem, x=value)

    @property
    def hopeless(self) -> bool:
        """Whether more tets are inverted than patches are going to untangle in time."""
        return _inverted(self) > MOST_STUCK * len(self.history.model.T)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        clock = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - clock


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
    run = _Run(problem, options, history, budget, on_mesh, hasty, afar, resumed)
    run.seconds["start"] = time.perf_counter() - clock
    with run.timed("untangle"):
        left = _untangle(run, glide=glide and not on_mesh)
        if left and _freed(run):
            left = 0
    run.take(run.problem)  # without what untangling kept
    _core.base.give_free_memory_back()
    if left:
        reason = "the time limit was reached; " if run.history.budget.spent else ""
        return _outcome(run, False, f"{reason}{left} tets could not be untangled")
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


def _outcome(run: _Run, converged: bool, reason: str, exact: bool = False) -> Outcome:
    return Outcome(run.problem, tuple(run.history.records), converged, reason, run.seconds, exact)


def _keep(run: _Run, x: NDArray[np.float64], glide: bool, otherwise: str) -> bool:
    """Take over ``x``, unless it has an inverted tet or a face folded beyond proof."""
    stuck = stuck_tets(run.history.model, x, glide=glide)
    if len(stuck) and not certify(run.problem.solid, x, run.problem.torus).certified:
        _log.warning("%s: a tet or a boundary face would turn over", otherwise)
        return False
    run.x = x
    return True


def _freed(run: _Run) -> bool:
    """Whether the boundary, giving way on its mesh, lets go what nothing inside untangles."""
    if run.problem.ground is None:
        return False
    freed = untangle_on_mesh(run.problem, run.options, run.history)
    if freed is not None:
        run.x = freed
    return freed is not None


def _untangle(run: _Run, *, glide: bool) -> int:
    """Inverted tets, and tets at folded faces, that are left."""
    history = run.history
    stuck, opened = _untangle_inside(run, glide=glide), None
    if run.hasty and len(stuck):
        return len(stuck)
    if glide and not len(stuck):
        # A few folded faces are a matter of what is round them; for their sake all the rest would
        # be turned over once more.
        stuck = _patched(run, glide=True)
    if glide and len(stuck):
        run.x = opened = untangle_whole(history.model, run.x, history, glide=True).x
        stuck = _patched(run, glide=True)
    best, fewest, least, edges = run.problem, stuck, _inverted(run), crowded_edges
    most = _MOST_TETS * run.problem.solid.n_tets
    for _ in range(_ROUNDS):
        if not len(stuck) or run.problem.refinement is None or history.budget.spent:
            break
        if len(stuck) > min(MOST_STUCK * run.problem.solid.n_tets, _TIMES * len(fewest) + _MORE):
            break
        if not _inverted(run):
            break  # folded faces are left, which more vertices inside do not unfold
        halved = edges(run.problem.solid, stuck)
        if run.problem.solid.n_tets + _PER_EDGE * len(halved) > most:
            break
        _halve(run, halved, stuck)
        stuck = _patched(run, glide=glide)
        # Folded faces can be held, inverted tets cannot.
        inverted = _inverted(run)
        if (inverted, len(stuck)) < (least, len(fewest)):
            best, fewest, least = run.problem, stuck, inverted
        elif edges is crowded_edges and inverted > least:  # as in `_untangled_halved`
            run.take(best)
            stuck, edges = fewest, surrounding_edges
    if len(fewest) and len(stuck):
        run.take(best)
        if least or not glide:
            return least
        _hold_folded(run)
    if run.x is opened:
        return 0
    # Away from folding: the nearer to it, the shorter are all steps that follow.
    whole, history.budget = history.budget, history.budget.share(_GETTING_AWAY)
    away = untangle_whole(history.model, run.x, history, glide=glide)
    history.budget = whole
    if not away.left and not len(stuck_tets(history.model, away.x, glide=glide)):
        run.x = away.x
    return 0


def _inverted(run: _Run) -> int:
    return len(stuck_tets(run.history.model, run.x, glide=False))


def _untangle_inside(run: _Run, *, glide: bool) -> NDArray[np.intp]:
    """All tets, then patches, and where that does not do, both more thoroughly; tets left.

    Where far too many tets are inverted for patches, all are begun with once more: in haste from
    afar, then with more vertices.

    A boundary that is going to glide on a mesh gives way before that. On a torus all of it would
    have to be untangled once more for the sake of a few tets, to which more vertices are cheaper.
    """
    history, begin = run.history, run.x
    if not run.resumed:  # else it has been at its end
        run.x = untangle_whole(history.model, begin, history, glide=False, hasty=run.hasty).x
    if run.hasty and run.afar and run.hopeless:
        near, inverted = run.x, _inverted(run)
        run.x = untangle_whole(history.model, begin, history, glide=False, from_afar=True).x
        if _inverted(run) >= inverted:
            run.x = near
    if run.afar and run.hopeless:
        _untangle_refined(run, begin)
    if run.hasty and run.hopeless:
        return stuck_tets(history.model, run.x, glide=False)
    many, cheap = _inverted(run), not run.on_mesh  # more vertices are
    stuck = _patched(run, glide=False, few=_FEW_STUCK if cheap else 0)
    if run.hasty and history.budget.spent and _FEW_STUCK < len(stuck) <= _CURED * many:
        history.budget = run.budget.share(_GOING_ON)
        stuck = _patched(run, glide=False, few=_FEW_STUCK if cheap else 0)
    if glide and 0 < len(stuck) <= _FEW_STUCK:
        stuck = _patched_gliding(run, stuck)
    if cheap and 0 < len(stuck) <= _FEW_STUCK:
        more = run.budget.share(_NEARLY)
        history.budget = more if more.left > history.budget.left else history.budget
        stuck = _untangled_halved(run, stuck, glide=glide)
    early = run.budget.left > _EARLY * run.budget.seconds
    if run.hasty and early and glide and 0 < len(stuck) <= _FEW_STUCK:
        stuck = _patched_gliding(run, stuck, rings=_RINGS[-1:], share=_WIDELY)
    if not len(stuck):
        return stuck
    if run.on_mesh and _freed(run):
        return stuck[:0]
    if run.hasty:
        return stuck
    before = run.problem
    run.x = untangle_whole(history.model, run.x, history, glide=False, thorough=True).x
    left = _patched(run, glide=False)
    if len(left) > len(stuck):
        run.take(before)
        return stuck
    return _untangled_halved(run, left, glide=glide) if cheap and len(left) else left


def _untangle_refined(run: _Run, begin: NDArray[np.float64]) -> None:
    """All tets with more vertices by the stuck ones; as they are, if far too many stay so.

    Where the boundary has most of the vertices, the few inside have no place that suits all faces.
    """
    before, history = run.problem, run.history
    if before.refinement is None:
        return
    stuck = stuck_tets(history.model, run.x, glide=False)
    run.x = begin
    _halve(run, crowded_edges(before.solid, stuck), stuck)
    run.x = untangle_whole(history.model, run.x, history, glide=False, hasty=True).x
    if run.hopeless:
        run.take(before)


def _halve(run: _Run, edges: NDArray[np.int32], stuck: NDArray[np.intp]) -> None:
    run.take(run.problem.halved(edges))
    _log.info("%d inverted tets are stuck: %d edges round them halved", len(stuck), len(edges))


def _untangled_halved(run: _Run, stuck: NDArray[np.intp], *, glide: bool) -> NDArray[np.intp]:
    """Few stuck tets untangled with edges round them halved, or left as they are.

    First those by which they hang on the boundary. Where that breeds more than it cures, all in
    their surroundings: a vertex that sees less of the boundary still has to see all of its star,
    and that gets room only where the stars next to it do.
    """
    before, left, edges = run.problem, stuck, crowded_edges
    for _ in range(_HASTY_ROUNDS if run.hasty else _ROUNDS):
        if before.refinement is None or not 0 < len(left) <= _FEW_STUCK:
            break
        if run.history.budget.spent:
            break
        last = run.problem
        _halve(run, edges(last.solid, left), left)
        if edges is crowded_edges:
            now = _patched(run, glide=False, few=_FEW_STUCK)
            if len(now) > len(left):
                run.take(last)
                edges = surrounding_edges
                continue
        else:
            now = stuck_tets(run.history.model, run.x, glide=False)
        if not glide:
            left = _patched(run, glide=False, rings=_NARROW)
        else:
            left = _patched_gliding(run, now, rings=_NARROW, share=_WORTH) if len(now) else now
    if not len(left):
        return left
    run.take(before)
    return stuck


def _patched(
    run: _Run, *, glide: bool, few: int = 0, rings: tuple[int, ...] = ()
) -> NDArray[np.intp]:
    """Untangle patches as long as that helps, and then larger ones if more than a few are left.

    Those cost as much as another start, which serves more often: where one follows, it comes first.
    """
    model, budget = run.history.model, run.history.budget
    stuck = stuck_tets(model, run.x, glide=glide)
    wider = iter(rings or (_RINGS[:1] if run.hasty else _RINGS))
    reach = next(wider)
    while 0 < len(stuck) <= MOST_STUCK * len(model.T) and not budget.spent:
        x = untangle_patches(model, run.x, stuck, rings=reach, glide=glide, budget=budget)
        left = stuck_tets(model, x, glide=glide)
        gained = len(left) < len(stuck)
        helped = gained and len(left) <= _HELPED * len(stuck)
        if gained:
            run.x, stuck = x, left
        if helped:
            continue
        larger = next(wider, None)
        if larger is None or len(stuck) <= few:
            break
        reach = larger if gained else next(wider, larger)  # all or nothing
    return stuck


def _patched_gliding(
    run: _Run, stuck: NDArray[np.intp], *, rings: tuple[int, ...] = (), share: float = _GLIDING
) -> NDArray[np.intp]:
    """Few stuck tets untangled with the boundary round them gliding; inverted tets that are left.

    Where a coarse boundary pins them, no vertex inside has a place from where it sees all of it.
    """
    x, history = run.x, run.history
    whole, history.budget = history.budget, history.budget.share(share)
    _patched(run, glide=True, rings=rings)
    history.budget = whole
    left = stuck_tets(history.model, run.x, glide=False)
    if len(left) < len(stuck):
        return left
    run.x = x
    return stuck


def _hold_folded(run: _Run) -> None:
    """Let the boundary glide but for folded faces, which no step could unfold."""
    faces = folded_faces(run.history.model, run.x)
    held = np.unique(run.history.model.faces[faces]).astype(np.intp)
    _log.info("%d boundary faces stay folded: their vertices are held", len(faces))
    run.take(dataclasses.replace(run.problem, held=held))


def _release(run: _Run) -> bool:
    """Let go what was held, if the faces there can be unfolded by now."""
    before = run.problem
    run.take(dataclasses.replace(before, held=before.held[:0]))
    model, history = run.history.model, run.history
    run.x = untangle_whole(model, run.x, history, glide=True).x
    stuck = stuck_tets(model, run.x, glide=True)
    if len(stuck):
        run.x = untangle_patches(
            model, run.x, stuck, rings=_RINGS[1], glide=True, budget=history.budget
        )
    if len(stuck_tets(model, run.x, glide=True)):
        run.take(before)
        return False
    return True


def _minimize(run: _Run, *, glide: bool) -> tuple[bool, str, _core.volume.SolidNewton | None]:
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
        with run.timed("glide"):
            first = o.volume_weight if run.problem.warm else goal
            done = minimize(
                history.model, run.x, history, glide=True, start=first, goal=o.volume_weight,
                free=free, asked=None if run.problem.warm else history.model.targets,
            )  # fmt: skip
        if len(run.problem.held) and _keep(run, done.x, True, "the map so far is kept"):
            history.budget = run.budget  # proven as it is: worth all the time there is
            with run.timed("release"):
                released = _release(run)
            if released or not done.converged:
                with run.timed("glide"):
                    done = minimize(
                        history.model, run.x, history, glide=True,
                        start=goal if released else o.volume_weight, goal=o.volume_weight,
                        free=free,
                    )  # fmt: skip
        alone = o.volume_weight >= VolumeOptions.volume_weight and free == (1.0, 1.0)
        if done.converged and alone and not len(run.problem.held):
            with run.timed("finer"):
                done = _finer(run, done)
        converged, reason, newton = done.converged, done.reason, done.newton
        if converged and len(run.problem.held):
            converged, reason = False, f"{len(run.problem.held)} vertices of folded faces are held"
        if not _keep(run, done.x, True, "the map with a held boundary is kept"):
            return False, "gliding would fold the boundary", None
    return converged, reason, newton


def _finer(run: _Run, done: Minimized) -> Minimized:
    """The same with more vertices in the tets that keep volumes worst, if that ends in time."""
    o, history = run.options, run.history
    whole, history.budget = history.budget, history.budget.share(_FINER)
    for _ in range(_FINER_ROUNDS):
        run.x = done.x
        before, edges = run.problem, _uneven_edges(run.problem)
        if before.refinement is None or not len(edges):
            break
        run.take(before.halved(edges))
        more = minimize(
            history.model, run.x, history, glide=True, start=o.volume_weight, goal=o.volume_weight
        )
        if not more.converged:
            run.take(before)
            break
        done = more
        _log.info("volumes are kept badly: %d edges halved", len(edges))
    history.budget = whole
    return done


def _uneven_edges(problem: VolumeProblem) -> NDArray[np.int32]:
    """The longest edges of the tets whose volume is kept worst; none if all keep it well enough."""
    volumes = _core.mesh.tet_volumes(problem.V, problem.solid.T)
    ratios = _core.mesh.tet_volumes(problem.x, problem.solid.T) / volumes
    if not np.abs(ratios - 1.0).mean() > _UNEVEN:
        return np.empty((0, 2), np.int32)
    energy = 0.5 * (ratios + 1.0 / ratios) - 1.0
    poor = (energy > _POOR * np.average(energy, weights=volumes)) & (volumes > volumes.mean())
    return longest_inner_edges(problem.solid, problem.V, np.flatnonzero(poor))


def _glided_on_mesh(run: _Run) -> Outcome:
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
