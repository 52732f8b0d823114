"""What is untangled in which order, and what gets more vertices."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.base.budget import Budget, processor_seconds
from stretchmap.volume import untangle
from stretchmap.volume import untangle_order as order
from stretchmap.volume.glide_relax import Relaxation
from stretchmap.volume.model import History
from stretchmap.volume.options import VolumeOptions
from stretchmap.volume.problem import VolumeProblem
from stretchmap.volume.run import Run
from stretchmap.volume.start import started
from stretchmap.volume.untangle import Untangled


@pytest.mark.parametrize(("hasty", "afar"), [(True, True), (True, False), (False, True)])
@pytest.mark.parametrize("better", ["more", ""])
def test_what_is_hopeless_is_begun_once_more(monkeypatch, better, hasty, afar):
    """With more vertices; what does not help is undone."""
    run = run_of(sm.samples.bumpy_torus(600))
    run.hasty, run.afar, begin, done = hasty, afar, run.x, []
    given, n = run.problem.solid, run.problem.solid.n_tets

    def whole(model, x, history, *, glide, hasty=False, soft=False, thorough=False):
        if thorough:
            assert not soft
            return Untangled(x, n, -1.0)
        assert soft == run.hasty  # where no other start follows, far ones are brought back first
        np.testing.assert_array_equal(x[: len(begin)], begin)
        done.append("more" if len(x) > len(begin) else "whole")
        return Untangled(np.full(x.shape, 2.0 if done[-1] == better else 1.0), 0, -1.0)

    monkeypatch.setattr(order, "untangle_whole", whole)
    monkeypatch.setattr(
        order, "stuck_tets", lambda model, x, glide: np.arange(0 if x[0, 0] == 2.0 else n)
    )
    left = order._untangle_inside(run, glide=True)
    assert done == ["whole", *(["more"] if afar else [])]
    helped = better in done
    assert len(left) == (0 if helped else n) and run.x[0, 0] == (2.0 if helped else 1.0)
    assert (run.problem.solid is given) == (not helped)


def test_hopeless_solids_get_no_vertices_when_time_is_up(monkeypatch):
    run = run_of(sm.samples.bumpy_torus(600))
    run.history.budget, given = Budget(0.0), run.problem.solid
    n = given.n_tets
    monkeypatch.setattr(order, "untangle_whole", lambda _, x, *a, **k: Untangled(x, n, -1.0))
    monkeypatch.setattr(order, "stuck_tets", lambda *_, **__: np.arange(n))
    monkeypatch.setattr(order, "_halve", lambda *_: pytest.fail("halved"))
    assert len(order._untangle_inside(run, glide=True)) == n and run.problem.solid is given


def test_halving_ends_before_a_solid_has_too_many_tets(monkeypatch):
    run = run_of(sm.samples.bumpy_torus(600))
    n, halve, made = run.problem.solid.n_tets, order._halve, []

    def all_inside(solid, _):
        inside = (solid.boundary_index[solid.edges] < 0).any(axis=1)
        return np.ascontiguousarray(solid.edges[inside])

    def noted(run, edges, stuck):
        halve(run, edges, stuck)
        made.append(run.problem.solid.n_tets)

    monkeypatch.setattr(order, "_untangle_inside", lambda run, glide: np.arange(3))
    monkeypatch.setattr(order, "_patched", lambda run, glide: np.arange(3))
    monkeypatch.setattr(order, "untangle_whole", lambda _, x, *a, **k: Untangled(x, 3, -1.0))
    monkeypatch.setattr(order, "_inverted", lambda run: 3)
    monkeypatch.setattr(order, "crowded_edges", all_inside)
    monkeypatch.setattr(order, "_halve", noted)
    assert order.untangle(run, glide=False) == 3
    assert made and 2 * n < max(made) < 10 * n


@pytest.mark.parametrize("on_mesh", [False, True])
def test_a_boundary_on_a_mesh_gives_way_before_edges_are_halved(monkeypatch, on_mesh):
    run = run_of(sm.samples.bumpy_torus(6000))
    run.on_mesh, done = on_mesh, []
    monkeypatch.setattr(order, "untangle_whole", lambda _, x, *a, **k: Untangled(x, 3, -1.0))
    monkeypatch.setattr(order, "stuck_tets", lambda *_, **__: np.arange(3))
    monkeypatch.setattr(order, "_patched", lambda *_, **__: np.arange(3))
    monkeypatch.setattr(order, "freed", lambda run, reaches: done.append("freed") or True)

    def halved(run, stuck, *, glide):
        done.append("halved")
        return stuck[:0]

    monkeypatch.setattr(order, "_untangled_halved", halved)
    assert not len(order._untangle_inside(run, glide=False))
    assert done == (["freed"] if on_mesh else ["halved"])


def run_of(solid: sm.TetMesh, seconds: float = 60.0, patience: float = 1.0) -> Run:
    plain = sm.area_map(solid.surface, finish="none")
    problem = started(VolumeProblem.of(solid, plain.image, torus=plain.torus), solver="auto")
    budget = Budget(seconds)
    history = History(problem.model(VolumeOptions()), budget.share(patience))
    return Run(problem, VolumeOptions(), history, budget)


@pytest.mark.parametrize("folded", [0, 5])
def test_few_folded_faces_are_unfolded_with_what_is_round_them(monkeypatch, folded):
    run = run_of(sm.samples.bumpy_torus(600))
    done, left = [], [folded, 0]

    def patched(run, *, glide):
        done.append("patches")
        return np.arange(left.pop(0))

    def whole(model, x, history, *, glide):
        done.append("whole")
        return Untangled(x, 0, 1.0)

    monkeypatch.setattr(order, "_untangle_inside", lambda run, glide: np.arange(0))
    monkeypatch.setattr(order, "_patched", patched)
    monkeypatch.setattr(order, "untangle_whole", whole)
    assert order.untangle(run, glide=True) == 0
    assert done == (["patches", "whole", "patches"] if folded else ["patches", "whole"])


@pytest.mark.parametrize("glide", [True, False])
@pytest.mark.parametrize(("stuck", "cured"), [(3, True), (3, False), (200, False)])
def test_few_stuck_tets_get_more_vertices_before_anything_else(monkeypatch, stuck, cured, glide):
    run = run_of(sm.samples.bumpy_torus(6000), patience=0.1)
    begun, done = run.problem.solid, []
    inner = np.setdiff1d(np.arange(begun.n_vertices), begun.boundary_vertices)
    ends = begun.T[(begun.T == inner[0]).any(axis=1)][0]
    edge = np.sort([inner[0], ends[ends != inner[0]][0]]).astype(np.int32)
    monkeypatch.setattr(order, "crowded_edges", lambda *_: edge[None])

    def halved():
        return run.problem.solid.n_vertices > begun.n_vertices

    def patched(run, *, glide, few=0, rings=()):
        return np.arange(0 if cured and halved() else stuck)

    def whole(model, x, history, *, glide, thorough=False, hasty=False, soft=False):
        done.append("thorough" if thorough else "whole")
        return Untangled(x, stuck, -1.0)

    monkeypatch.setattr(order, "_patched", patched)
    monkeypatch.setattr(order, "stuck_tets", lambda *_, **__: patched(run, glide=False))
    monkeypatch.setattr(order, "untangle_whole", whole)
    left = order._untangle_inside(run, glide=glide)
    assert len(left) == (0 if cured else stuck)
    assert done == (["whole"] if cured else ["whole", "thorough"])
    assert halved() == cured
    assert (run.history.budget.left > 0.5 * run.budget.seconds) == (stuck == 3)  # almost there


@pytest.mark.parametrize("resumed", [False, True])
def test_a_start_gone_on_with_begins_with_patches(monkeypatch, resumed):
    run = run_of(sm.samples.bumpy_torus(600))
    run.resumed, done = resumed, []

    def whole(model, x, history, *, glide, thorough=False, hasty=False, soft=False):
        assert not hasty and not soft
        done.append("thorough" if thorough else "whole")
        return Untangled(x, 300, -1.0)

    def patched(run, *, glide, few=0, rings=()):
        done.append("patches")
        return np.arange(300)

    monkeypatch.setattr(order, "untangle_whole", whole)
    monkeypatch.setattr(order, "_patched", patched)
    order._untangle_inside(run, glide=True)
    assert done == [*([] if resumed else ["whole"]), "patches", "thorough", "patches"]


@pytest.mark.parametrize(("share", "hopeless"), [(0.045, False), (0.055, True)])
def test_with_more_than_a_twentieth_inverted_another_start_is_better(monkeypatch, share, hopeless):
    run = run_of(sm.samples.bumpy_torus(600))
    monkeypatch.setattr(order, "_inverted", lambda run: int(share * run.problem.solid.n_tets))
    assert order._hopeless(run) == hopeless


@pytest.mark.parametrize("left", [30, 110, 130])
def test_a_hundredth_of_the_tets_is_soon_left_to_patches(monkeypatch, left):
    run = run_of(sm.samples.bumpy_torus(6000))
    asked = []
    monkeypatch.setattr(
        untangle, "_continue", lambda *_, enough, **__: asked.append(enough) or None
    )
    untangle.untangle_whole(run.history.model, run.x, run.history, glide=False)
    share = left / 12_000 * run.problem.solid.n_tets
    assert asked[0](int(share), 4, 1.0) == (left < 120)
    assert not asked[0](int(share), 3, 1.0)


@pytest.mark.parametrize(
    ("share", "epsilon", "hasty", "steps"),
    [
        (0.04, 0.05, True, 10),
        (0.04, 0.5, True, 30),
        (0.06, 0.05, True, 30),
        (0.04, 0.05, False, 30),
    ],
)
def test_in_haste_patches_come_soon_once_epsilon_is_narrow(
    monkeypatch, share, epsilon, hasty, steps
):
    run = run_of(sm.samples.bumpy_torus(6000))
    asked = []
    monkeypatch.setattr(
        untangle, "_continue", lambda *_, enough, **__: asked.append(enough) or None
    )
    untangle.untangle_whole(run.history.model, run.x, run.history, glide=False, hasty=hasty)
    left = int(share * len(run.history.model.T))
    assert asked[0](left, steps, epsilon) and not asked[0](left, steps - 1, epsilon)


@pytest.mark.parametrize(
    ("stuck", "hasty", "tried"),
    [
        (55, True, [(), (8,)]),
        (290, True, [()]),
        (310, True, []),
        (55, False, [()]),
        (65, False, []),
    ],
)
def test_some_stuck_tets_are_worth_a_gliding_boundary_before_another_start(
    monkeypatch, stuck, hasty, tried
):
    run = run_of(sm.samples.bumpy_torus(600))
    run.hasty, gliding = hasty, []
    monkeypatch.setattr(order, "untangle_whole", lambda _, x, *a, **k: Untangled(x, stuck, -1.0))
    monkeypatch.setattr(order, "_inverted", lambda run: 0)

    def patched(run, *, glide, few=0, rings=()):
        gliding.extend([rings] if glide else [])
        return np.arange(stuck)

    monkeypatch.setattr(order, "_patched", patched)
    monkeypatch.setattr(order, "stuck_tets", lambda *_, **__: np.arange(stuck))
    monkeypatch.setattr(order, "_untangled_halved", lambda run, stuck, glide: stuck)
    assert len(order._untangle_inside(run, glide=True)) == stuck
    assert gliding == tried


@pytest.mark.parametrize(("left", "rounds"), [(90, 2), (110, 1)])
def test_what_patches_were_curing_when_time_was_up_is_gone_on_with(monkeypatch, left, rounds):
    run = run_of(sm.samples.bumpy_torus(6000))
    run.hasty, run.history.budget, seconds = True, Budget(0.0), []
    monkeypatch.setattr(order, "untangle_whole", lambda _, x, *a, **k: Untangled(x, 1000, -1.0))
    monkeypatch.setattr(order, "_inverted", lambda run: 200)

    def patched(run, *, glide, few=0, rings=()):
        if not glide:
            seconds.append(run.history.budget.left)
        return np.arange(left)

    monkeypatch.setattr(order, "_patched", patched)
    monkeypatch.setattr(order, "_untangled_halved", lambda run, stuck, glide: stuck)
    assert len(order._untangle_inside(run, glide=False)) == left
    assert len(seconds) == rounds and seconds[0] == 0.0
    assert rounds == 1 or seconds[1] == pytest.approx(0.4 * run.budget.left, rel=0.1)


@pytest.mark.parametrize("hasty", [True, False])
def test_edges_are_halved_for_half_of_the_time_so_far_where_another_start_follows(
    monkeypatch, hasty
):
    """Which takes as long and serves as often; what follows halving has all the time it had."""
    run = run_of(sm.samples.bumpy_torus(600))
    run.hasty, given = hasty, []
    monkeypatch.setattr(order, "_inverted", lambda run: 0)
    monkeypatch.setattr(order, "_patched", lambda *_, **__: np.arange(3))

    def whole(model, x, *_, **__):
        end = processor_seconds() + 0.1
        while processor_seconds() < end:
            pass
        return Untangled(x, 3, -1.0)

    def halved(run, stuck, *, glide):
        given.append((run.history.budget.left, run.budget.seconds - run.budget.left))
        return stuck[:0]

    monkeypatch.setattr(order, "untangle_whole", whole)
    monkeypatch.setattr(order, "_untangled_halved", halved)
    order._untangle_inside(run, glide=False)
    ((left, took),) = given
    assert left == pytest.approx(0.5 * took if hasty else run.budget.seconds, rel=0.2)
    assert run.history.budget.left > 0.8 * run.budget.seconds


def test_single_elements_are_relaxed_on_a_torus():
    run = run_of(sm.samples.bumpy_torus(600))
    measures = np.linspace(-0.5, 0.5, 20_000)
    near = Relaxation(run.history.model)._near_folding(measures)
    assert np.array_equal(np.flatnonzero(near), np.arange(4))


@pytest.mark.parametrize(("stuck", "hopeless"), [(3, False), (400, False), (400, True)])
def test_a_start_makes_room_for_the_next_where_tets_are_stuck(monkeypatch, stuck, hopeless):
    run = run_of(sm.samples.bumpy_torus(600))
    run.hasty, done = True, []
    monkeypatch.setattr(order, "_HALVING", np.inf)  # nothing takes time here

    def whole(model, x, history, *, glide, thorough=False, hasty=False, soft=False):
        done.append("thorough" if thorough else "whole")
        return Untangled(x, stuck, -1.0)

    def patched(run, *, glide, few=0, rings=()):
        done.append("gliding" if glide else "patches")
        return np.arange(stuck)

    monkeypatch.setattr(order, "untangle_whole", whole)
    monkeypatch.setattr(order, "_patched", patched)
    monkeypatch.setattr(order, "_inverted", lambda run: len(run.problem.solid.T) * hopeless)
    monkeypatch.setattr(order, "stuck_tets", lambda *_, **__: np.arange(stuck))
    edge = np.sort(run.problem.solid.T[:1, :2]).astype(np.int32)
    monkeypatch.setattr(order, "crowded_edges", lambda *_: edge)
    monkeypatch.setattr(type(run.problem), "halved", lambda problem, edges: problem)
    assert len(order._untangle_inside(run, glide=True)) == stuck
    # Of few the boundary round them may glide, and they get more vertices, but not for as long as
    # another start may take. Where it is hopeless all are begun with once more, with more vertices.
    few = [*(4 * ["patches", "gliding"]), "gliding"]  # once more, wide, while it is early
    more = ["whole"] if hopeless else ["patches"] if stuck == 400 else few
    assert done == ["whole", *more]
    monkeypatch.setattr(order, "_untangle_inside", lambda run, glide: np.arange(stuck))
    assert order.untangle(run, glide=True) == stuck  # nothing else is tried either
    assert done == ["whole", *more]


@pytest.mark.parametrize(("left", "kept"), [(0, True), (1, True), (2, False), (5, False)])
def test_the_boundary_gives_way_round_few_stuck_tets_if_that_helps(monkeypatch, left, kept):
    run = run_of(sm.samples.bumpy_torus(600))
    before = run.x

    def patched(run, *, glide, rings=()):
        assert glide
        run.x = run.x + 1.0
        return np.arange(left)

    monkeypatch.setattr(order, "_patched", patched)
    monkeypatch.setattr(order, "stuck_tets", lambda *_, glide: np.arange(99 if glide else left))
    assert len(order._patched_gliding(run, np.arange(2))) == min(left, 2)
    assert (run.x is not before) == kept


@pytest.mark.parametrize(("left", "rings"), [(200, [1, 4, 8]), (150, [1, 1, 1, 1, 2, 4, 8])])
def test_patches_reach_further_where_they_hardly_help(monkeypatch, left, rings):
    """So many of 200 stuck tets are left the first time, and three quarters of these the next."""
    run = run_of(sm.samples.bumpy_torus(6000))
    reached = []

    def patches(model, x, stuck, *, rings, glide, budget):
        reached.append(rings)
        found = {200: left, 150: 100, 100: 60}.get(int(x[0, 0]), x[0, 0] - 1.0)
        return np.full(x.shape, float(found))

    def patched(hasty=False, **given):
        reached.clear()
        run.x, run.hasty = np.full(run.x.shape, 200.0), hasty
        return len(order._patched(run, glide=False, **given))

    monkeypatch.setattr(order, "untangle_patches", patches)
    monkeypatch.setattr(order, "stuck_tets", lambda model, x, glide: np.arange(int(x[0, 0])))
    assert patched() == (200 if left == 200 else 56) and reached == rings
    # So few are for the boundary to let go.
    assert patched(few=55) and reached == rings
    assert patched(few=200) and reached == [one for one in rings if one == 1]
    # Where another start follows, none are as large as all.
    assert patched(hasty=True) and reached == ([1, 2] if left == 200 else [1, 1, 1, 1, 2])
    assert patched(rings=(8,)) and reached == [8] * (1 if left == 200 else 4)


@pytest.mark.parametrize(("counts", "kept"), [([3, 4, 4], 1), ([3, 2, 5], 2), ([6, 6, 7], 0)])
def test_halving_that_cures_some_keeps_what_it_cured(monkeypatch, counts, kept):
    """The fewest tets left, with the edges halved up to there."""
    run, left = run_of(sm.samples.bumpy_torus(600)), iter(counts)
    run.hasty = True
    problems = [run.problem]

    def halve(run, edges, stuck):
        run.x = run.x.copy()
        problems.append(run.problem)

    monkeypatch.setattr(order, "_halve", halve)
    monkeypatch.setattr(order, "_patched", lambda *_, **__: np.arange(next(left)))
    monkeypatch.setattr(order, "crowded_edges", order.surrounding_edges)
    found = order._untangled_halved(run, np.arange(5), glide=False)
    assert len(found) == min(5, *counts) and run.problem is problems[kept]
