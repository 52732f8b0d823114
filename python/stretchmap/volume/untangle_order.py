"""What is untangled in which order: all tets, few in patches, and with more vertices round them.

Where no position of the vertices serves, or none is found, edges are halved; how, depends on how
many tets are stuck, and on whether another start follows.
"""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
from numpy.typing import NDArray

from ..base.budget import Budget
from ..mesh.refinement import TETS_PER_EDGE, crowded_edges, surrounding_edges
from .ground import untangle_on_mesh
from .run import Run
from .untangle import (
    MOST_STUCK,
    far_tets,
    folded_faces,
    stuck_tets,
    untangle_patches,
    untangle_whole,
)

__all__ = ["freed", "release", "untangle"]

_log = logging.getLogger("stretchmap")

_ROUNDS, _HASTY_ROUNDS = 12, 3  # of halving edges; fewer where another start follows
# Reach of the patches, to begin with and where that does not help; with more vertices there; where
# another start follows; for what is far too large; and for letting go what was held.
_RINGS, _NARROW, _HASTY, _NEAR, _RELEASED = (1, 2, 4, 8), (2, 4), (1, 2), 2, 4
_HELPED = 0.95  # of them are left at most where patches are worth another round
# Worth more vertices round them before anything else; worth a boundary that glides round them
# before another start.
_FEW_STUCK, _FEW_GLIDING = 60, 300
_GETTING_AWAY = 0.1  # share of the time left that a better start for all that follows is worth
# Shares of the time left before the edges round stuck tets are halved instead, and for wide patches
# where another start follows; that much of all has to be left for those.
_GLIDING, _WIDELY, _EARLY = 0.4, 0.15, 0.5
# Where patches had cured half of their tets when time was up, such a share of what is left is
# better spent on the others than on another start.
_CURED, _GOING_ON = 0.5, 0.4
_WORTH = 0.8  # share for patches in which all edges are halved: mostly those do
# Times the time of all before it that halving edges may take where another start follows: that
# serves as often, and where halving did it took at most a third.
_HALVING = 0.5
_NEARLY = 0.9  # share of the time left that untangling may take if only so few are left
# Times the fewest so far, and so many more: halving breeds more than it cures.
_TIMES, _MORE = 2, 100
# Times the tets there were that halving may come to: a coarse solid needs them, where single
# vertices inside see hundreds of faces.
_MOST_TETS = 10


def untangle(run: Run, *, glide: bool) -> int:
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
        if run.problem.solid.n_tets + TETS_PER_EDGE * len(halved) > most:
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


def _inverted(run: Run) -> int:
    return len(stuck_tets(run.history.model, run.x, glide=False))


def _hopeless(run: Run) -> bool:
    """Whether more tets are inverted than patches are going to untangle in time."""
    return _inverted(run) > MOST_STUCK * len(run.history.model.T)


def _untangle_inside(run: Run, *, glide: bool) -> NDArray[np.intp]:
    """All tets, then patches, and where that does not do, both more thoroughly; tets left.

    Where far too many tets are inverted for patches, all are begun with once more, with more
    vertices.

    A boundary that is going to glide on a mesh gives way before that, next to them before they get
    more vertices, farther round them after. On a torus all of it would have to be untangled once
    more for the sake of a few tets, to which more vertices are cheaper.
    """
    history = run.history
    begin, begun = run.x, run.budget.left
    if not run.resumed:  # else it has been at its end
        _bring_near(run)
        begin = run.x
        run.x = untangle_whole(
            history.model, begin, history, glide=False, hasty=run.hasty, soft=run.hasty
        ).x
    if run.afar and _hopeless(run):
        _untangle_refined(run, begin)
    if run.hasty and _hopeless(run):
        return stuck_tets(history.model, run.x, glide=False)
    many, cheap = _inverted(run), not run.on_mesh  # more vertices are
    stuck = _patched(run, glide=False, few=_FEW_STUCK if cheap else 0)
    if run.hasty and history.budget.spent and _FEW_STUCK < len(stuck) <= _CURED * many:
        history.budget = run.budget.share(_GOING_ON)
        stuck = _patched(run, glide=False, few=_FEW_STUCK if cheap else 0)
    if glide and 0 < len(stuck) <= (_FEW_GLIDING if run.hasty else _FEW_STUCK):
        stuck = _patched_gliding(run, stuck)
    if cheap and 0 < len(stuck) <= _FEW_STUCK:
        budget = max(run.budget.share(_NEARLY), history.budget, key=lambda each: each.left)
        history.budget = budget
        if run.hasty:
            history.budget = Budget(min(_HALVING * (begun - run.budget.left), budget.left))
        stuck = _untangled_halved(run, stuck, glide=glide)
        history.budget = budget
    early = run.budget.left > _EARLY * run.budget.seconds
    if run.hasty and early and glide and 0 < len(stuck) <= _FEW_STUCK:
        stuck = _patched_gliding(run, stuck, rings=_RINGS[-1:], share=_WIDELY)
    if not len(stuck):
        return stuck
    if run.on_mesh:
        if freed(run, slice(1)):
            return stuck[:0]
        before = run.problem
        if len(stuck) <= _FEW_STUCK and before.refinement is not None:
            _halve(run, crowded_edges(before.solid, stuck), stuck)
            if not len(_patched(run, glide=False, rings=_NARROW)):
                return stuck[:0]
            run.take(before)
        if freed(run, slice(1, None)):
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


def _bring_near(run: Run) -> None:
    """What is far too large for where it is, brought down to that by itself, all else held.

    Where a boundary image squeezes a limb within a few edges, the body outside reaches farther into
    it in the harmonic map than there is room. Among very many inverted tets, patches round these
    are no better off than all of them.
    """
    model = run.history.model
    far = far_tets(model, run.x)
    if not len(far) or _hopeless(run):
        return
    run.x = untangle_patches(model, run.x, far, rings=_NEAR, glide=False, budget=run.history.budget)
    _log.info("%d tets were far too large for where they are", len(far))


def _untangle_refined(run: Run, begin: NDArray[np.float64]) -> None:
    """All tets with more vertices by the stuck ones; as they are, if far too many stay so.

    Where the boundary has most of the vertices, the few inside have no place that suits all faces.
    """
    before, history = run.problem, run.history
    if before.refinement is None or history.budget.spent:
        return
    stuck = stuck_tets(history.model, run.x, glide=False)
    run.x = begin
    _halve(run, crowded_edges(before.solid, stuck), stuck)
    run.x = untangle_whole(history.model, run.x, history, glide=False, hasty=True, soft=run.hasty).x
    if _hopeless(run):
        run.take(before)


def _halve(run: Run, edges: NDArray[np.int32], stuck: NDArray[np.intp]) -> None:
    run.take(run.problem.halved(edges))
    _log.info("%d inverted tets are stuck: %d edges round them halved", len(stuck), len(edges))


def _untangled_halved(run: Run, stuck: NDArray[np.intp], *, glide: bool) -> NDArray[np.intp]:
    """Few stuck tets untangled with edges round them halved, or fewer left, or as they are.

    First those by which they hang on the boundary. Where that breeds more than it cures, all in
    their surroundings: a vertex that sees less of the boundary still has to see all of its star,
    and that gets room only where the stars next to it do.
    """
    best, fewest, left, edges = run.problem, stuck, stuck, crowded_edges
    for _ in range(_HASTY_ROUNDS if run.hasty else _ROUNDS):
        if best.refinement is None or not 0 < len(left) <= _FEW_STUCK:
            break
        if run.history.budget.spent:
            break
        last = run.problem
        _halve(run, edges(last.solid, left), left)
        if not glide:
            now = _patched(run, glide=False, rings=_NARROW)
        elif edges is crowded_edges:
            now = _patched(run, glide=False, few=_FEW_STUCK)
        else:
            now = stuck_tets(run.history.model, run.x, glide=False)
        if edges is crowded_edges and len(now) > len(left):
            run.take(last)
            edges = surrounding_edges
            continue
        if glide and len(now):
            now = _patched_gliding(run, now, rings=_NARROW, share=_WORTH)
        left = now
        if len(left) < len(fewest):
            best, fewest = run.problem, left
    if run.problem is not best:
        run.take(best)
    return fewest


def _patched(
    run: Run, *, glide: bool, few: int = 0, rings: tuple[int, ...] = ()
) -> NDArray[np.intp]:
    """Untangle patches as long as that helps, and then larger ones if more than a few are left.

    The largest cost as much as another start, which serves more often: where one follows, it comes
    first.
    """
    model, budget = run.history.model, run.history.budget
    stuck = stuck_tets(model, run.x, glide=glide)
    wider = iter(rings or (_HASTY if run.hasty else _RINGS))
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
    run: Run, stuck: NDArray[np.intp], *, rings: tuple[int, ...] = (), share: float = _GLIDING
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


def freed(run: Run, reaches: slice = slice(None)) -> bool:
    """Whether the boundary, giving way on its mesh, lets go what nothing inside untangles."""
    if run.problem.ground is None:
        return False
    freed = untangle_on_mesh(run.problem, run.options, run.history, reaches=reaches)
    if freed is not None:
        run.x = freed
    return freed is not None


def _hold_folded(run: Run) -> None:
    """Let the boundary glide but for folded faces, which no step could unfold.

    A start that is resumed may hold some already: faces of theirs alone are none that glide.
    """
    faces = folded_faces(run.history.model, run.x)
    held = np.union1d(run.problem.held, run.history.model.faces[faces]).astype(np.intp)
    _log.info("%d boundary faces stay folded: their vertices are held", len(faces))
    run.take(dataclasses.replace(run.problem, held=held))


def release(run: Run) -> bool:
    """Let go what was held, if the faces there can be unfolded by now."""
    before = run.problem
    run.take(dataclasses.replace(before, held=before.held[:0]))
    model, history = run.history.model, run.history
    run.x = untangle_whole(model, run.x, history, glide=True).x
    stuck = stuck_tets(model, run.x, glide=True)
    if len(stuck):
        run.x = untangle_patches(
            model, run.x, stuck, rings=_RELEASED, glide=True, budget=history.budget
        )
    if len(stuck_tets(model, run.x, glide=True)):
        run.take(before)
        return False
    return True
