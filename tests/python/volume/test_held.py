"""Boundary vertices that stay where the others glide, room for slivers, and second starts."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from shapes import cubes, mug, with_branch
from stretchmap.area import finish
from stretchmap.area.coarse import Level
from stretchmap.area.map import finished, turned
from stretchmap.base.budget import Budget
from stretchmap.errors import DegenerateError
from stretchmap.volume import boundary_starts as boundary_starts_module
from stretchmap.volume import certified, engine, untangle_order
from stretchmap.volume.boundary_starts import boundary_starts
from stretchmap.volume.minimize import minimize
from stretchmap.volume.model import GLIDING, History
from stretchmap.volume.options import VolumeOptions
from stretchmap.volume.problem import VolumeProblem
from stretchmap.volume.run import Run
from stretchmap.volume.start import started
from stretchmap.volume.untangle import stuck_tets, untangle_whole

SOLID = sm.samples.bumpy_torus(1500)


@pytest.fixture(scope="module")
def problem() -> VolumeProblem:
    start = sm.area_map(SOLID.surface, finish="none", ratio="search")
    return started(VolumeProblem.of(SOLID, start.image, torus=start.torus), solver="auto", tol=1e-4)


def test_held_vertices_stay_and_the_others_glide(problem):
    held = problem.solid.boundary_vertices[:40].astype(np.intp)
    model = dataclasses.replace(problem, held=held).model(VolumeOptions())
    assert (model.motion(glide=True)[held] != GLIDING).all()
    assert len(model.gliding_faces) < len(model.faces)
    history = History(model, Budget(60.0))
    x = untangle_whole(model, problem.x, history, glide=True).x
    done = minimize(model, x, history, glide=True, start=10.0, goal=100.0)
    assert (done.x[held] == problem.x[held]).all()
    moved = np.linalg.norm(done.x - problem.x, axis=1)
    assert (moved[problem.solid.boundary_vertices[40:]] > 0.0).all()


def flattened(V: np.ndarray, T: np.ndarray, inner: np.ndarray) -> tuple[np.ndarray, int]:
    """Points with one vertex moved onto a face of its star, and the tet that got flat by it."""
    solid = sm.TetMesh(V, T)
    for tet in np.flatnonzero(np.isin(T, inner).any(axis=1)):
        vertex = T[tet][np.isin(T[tet], inner)][0]
        moved = V.copy()
        opposite = V[T[tet][T[tet] != vertex]].mean(axis=0)
        moved[vertex] += 0.9999 * (opposite - V[vertex])
        if sm.distortion(solid, moved).flips == 0:
            return moved, int(tet)
    raise AssertionError("no star allows it")


def test_only_slivers_are_given_room(problem):
    model = problem.model(VolumeOptions())
    assert (model.roomy_volumes == model.local_volumes).all()
    inner = np.setdiff1d(np.arange(len(model.V)), model.boundary)
    V, tet = flattened(model.V, model.T, inner)
    flat = dataclasses.replace(model, V=V)
    given = flat.roomy_volumes / flat.local_volumes
    assert given[tet] > 10.0 and (given > 1.0).sum() < 20


def test_a_needle_mesh_has_no_slivers(problem):
    model = problem.model(VolumeOptions())
    stretched = dataclasses.replace(model, V=np.ascontiguousarray(model.V * [100.0, 1.0, 1.0]))
    assert (stretched.roomy_volumes == stretched.local_volumes).all()


def spoiling(monkeypatch, times: int, spoilt) -> list[tuple[object, object]]:
    """Spoils what the first solves end with, and lists all problems with their outcomes."""
    solved: list[tuple[object, object]] = []
    solve = certified.solve

    def spoils(problem, options, **keywords):
        found = solve(problem, options, **keywords)
        if len(solved) < times:
            found = dataclasses.replace(found, problem=spoilt(found.problem))
        solved.append((problem, found))
        return found

    monkeypatch.setattr(certified, "solve", spoils)
    return solved


def failing(monkeypatch, times: int) -> list[tuple[object, object]]:
    """Lets the first solves end with inverted tets."""

    def inverted(problem):
        x = problem.x.copy()
        x[np.setdiff1d(np.arange(len(x)), problem.solid.boundary_vertices)] *= -1.0
        return dataclasses.replace(problem, x=x)

    return spoiling(monkeypatch, times, inverted)


def holding(monkeypatch, times: int) -> list[tuple[object, object]]:
    """Lets the first solves end with some vertices held."""

    def held(problem):
        some = problem.solid.boundary_vertices[:3].astype(np.intp)
        return dataclasses.replace(problem, held=some)

    return spoiling(monkeypatch, times, held)


def test_another_start_is_tried_where_one_fails(monkeypatch):
    tried = failing(monkeypatch, 1)
    result = sm.volume_map(SOLID)
    assert len(tried) == 2 and (tried[0][0].x != tried[1][0].x).any()
    assert result.certificate.certified and result.distortion.flips == 0
    assert result.seconds["other starts"] > 0.0


def test_what_is_not_certified_has_not_converged(monkeypatch):
    failing(monkeypatch, 9)
    result = sm.volume_map(SOLID, keep_best=True)
    assert not result.certificate.certified
    assert not result.converged and result.certificate.reason in result.stop_reason


def test_the_best_start_is_gone_on_with_where_none_serves(monkeypatch):
    hasty, solve = [], certified.solve

    def stuck(problem, options, **keywords):
        hasty.append(keywords["hasty"])
        found = solve(problem, options, **keywords)
        if not hasty[-1]:
            return found
        x = problem.x.copy()
        x[np.setdiff1d(np.arange(len(x)), problem.solid.boundary_vertices)] *= -1.0 + len(hasty) / 9
        return dataclasses.replace(found, problem=dataclasses.replace(problem, x=x))

    monkeypatch.setattr(certified, "solve", stuck)
    result = sm.volume_map(SOLID)
    assert hasty == [True] * (len(hasty) - 1) + [False] and len(hasty) > 3
    assert result.certificate.certified


def test_the_first_start_has_no_folded_face_if_that_can_be_had():
    solid = with_branch(sm.samples.bumpy_torus(1000), 10, 0.5)
    starts = list(boundary_starts(solid, VolumeOptions(), glide=True, progress=None))
    proven = [start.certificate.certified for start in starts]
    assert proven == [True] * (len(starts) - 2) + [False, True]


def test_the_second_start_has_a_fatter_torus_unless_its_ratio_is_given():
    starts = boundary_starts(SOLID, VolumeOptions(), glide=True, progress=None)
    first, second = next(starts), next(starts)
    assert second.torus.ratio == pytest.approx(np.sqrt(first.torus.ratio), rel=1e-9)
    assert second.certificate.certified
    given = boundary_starts(SOLID, VolumeOptions(ratio=3.0), glide=True, progress=None)
    assert {start.torus.ratio for start in given} == {3.0}


def test_where_equal_areas_fold_a_start_keeps_shapes():
    solid = with_branch(sm.samples.bumpy_torus(1000), 20, 0.5)
    starts = boundary_starts(solid, VolumeOptions(), glide=True, progress=None)
    shapes = next(starts)
    areas = sm.area_map(solid.surface, finish="none", ratio=shapes.ratio)
    assert shapes.certificate.certified and not areas.certificate.certified
    assert shapes.distortion.angle_mean < areas.distortion.angle_mean
    found = sm.volume_map(solid)
    assert found.certificate.certified and found.distortion.flips == 0


def test_a_source_that_meets_itself_is_not_started_again(monkeypatch):
    tried = failing(monkeypatch, 0)
    crossing = with_branch(sm.samples.solid_torus(1000), 10, 0.6, across=True)
    found = sm.volume_map(crossing, keep_best=True)
    assert len(tried) == 1 and not found.certificate.certified
    assert found.certificate.reason.startswith("the source surface touches or crosses itself")


def test_what_a_resumed_start_holds_stays_held(problem):
    held = problem.solid.boundary_vertices[:9].astype(np.intp)
    given = dataclasses.replace(problem, held=held)
    options = VolumeOptions()
    history = History(given.model(options), Budget(60.0))
    run = Run(given, options, history, history.budget)
    untangle_order._hold_folded(run)
    assert np.array_equal(run.problem.held, held)
    assert not len(stuck_tets(run.history.model, run.x, glide=True))


def solved_after_holding(problem, monkeypatch):
    """Outcome where untangling has held nine vertices, and next to no patience is left."""

    def untangled(run, *, glide):
        held = run.problem.solid.boundary_vertices[:9].astype(np.intp)
        run.take(dataclasses.replace(run.problem, held=held))
        return 0

    monkeypatch.setattr(engine, "untangle", untangled)
    return engine.solve(problem, VolumeOptions(), glide=True, budget=Budget(600.0), patience=1e-6)


def test_a_held_boundary_that_is_proven_gets_all_the_time_there_is(problem, monkeypatch):
    outcome = solved_after_holding(problem, monkeypatch)
    assert outcome.converged and not len(outcome.problem.held)


def test_one_that_is_not_proven_makes_room_for_another_start(problem, monkeypatch):
    monkeypatch.setattr(engine, "certify", lambda *_: SimpleNamespace(certified=False))
    outcome = solved_after_holding(problem, monkeypatch)
    assert not outcome.converged and outcome.stop_reason == "the time limit was reached"


def test_one_that_cannot_be_released_is_gone_on_with_all_the_same(problem, monkeypatch):
    monkeypatch.setattr(engine, "release", lambda run: False)
    outcome = solved_after_holding(problem, monkeypatch)
    assert len(outcome.problem.held) == 9
    assert not outcome.converged and outcome.stop_reason == "9 vertices of folded faces are held"


@pytest.mark.parametrize("released", [True, False])
def test_vertices_are_for_a_boundary_that_is_not_held_or_no_longer(problem, monkeypatch, released):
    asked = []
    monkeypatch.setattr(engine, "_finer", lambda run, done: asked.append(run) or done)
    if not released:
        monkeypatch.setattr(engine, "release", lambda run: False)
    outcome = solved_after_holding(problem, monkeypatch)
    assert problem.refinement is not None and len(asked) == released
    assert outcome.converged == released


def test_what_gliding_has_untangled_is_not_untangled_once_more(problem, monkeypatch):
    """Nor is a map that stays short of the floor, which the second time would search in vain."""
    called = []
    untangle = untangle_order.untangle_whole

    def counted(*arguments, glide, **keywords):
        called.append(glide)
        return untangle(*arguments, glide=glide, **keywords)

    monkeypatch.setattr(untangle_order, "untangle_whole", counted)
    options = VolumeOptions(floor=0.9)
    assert engine.solve(problem, options, glide=True, budget=Budget(600.0)).converged
    assert called == [False, True]


def test_folded_faces_are_better_than_inverted_tets(problem, monkeypatch):
    """Halving cures the one inverted tet at the price of more folded faces, which can be held."""
    budget = Budget(60.0)
    history = History(problem.model(VolumeOptions()), budget)
    run = Run(problem, VolumeOptions(), history, budget)
    n, held = problem.solid.n_vertices, []
    halved = lambda run: run.problem.solid.n_vertices > n  # noqa: E731
    monkeypatch.setattr(untangle_order, "_untangle_inside", lambda run, glide: np.arange(3))
    monkeypatch.setattr(
        untangle_order, "_patched", lambda run, glide: np.arange(5) if halved(run) else np.arange(3)
    )
    monkeypatch.setattr(untangle_order, "_inverted", lambda run: 0 if halved(run) else 1)
    monkeypatch.setattr(untangle_order, "_hold_folded", lambda run: held.append(halved(run)))
    assert untangle_order.untangle(run, glide=True) == 0
    assert held == [True]


def test_an_unfinished_area_map_can_be_finished():
    start = sm.area_map(SOLID.surface, finish="none")
    done = finished(start, max_iter=50, tol=0.02)
    assert done.certificate.certified and done.converged
    assert done.distortion.element_std < start.distortion.element_std
    assert (done.mesh is start.mesh) and done.torus == start.torus


def test_where_vertices_stay_held_another_start_is_tried(monkeypatch):
    ended = holding(monkeypatch, 1)
    result = sm.volume_map(SOLID)
    assert len(ended) == 2 and result.history == ended[1][1].history
    assert result.certificate.certified and result.seconds["other starts"] > 0.0


def test_if_all_starts_hold_some_the_lowest_energy_counts(monkeypatch):
    ended = holding(monkeypatch, 9)
    result = sm.volume_map(SOLID)
    assert len(ended) > 1

    def energy(history):
        return [record.energy for record in history if record.stage == "glide"][-1]

    assert energy(result.history) == min(energy(outcome.history) for _, outcome in ended)


@pytest.mark.parametrize(("share", "unfolded"), [(1e-3, True), (5e-2, False)])
def test_equal_areas_with_too_many_folded_faces_are_not_unfolded(monkeypatch, share, unfolded):
    maps = boundary_starts_module._BoundaryMaps(SOLID.surface, VolumeOptions(), None)
    monkeypatch.setattr(maps, "_not_outward", lambda _: int(share * len(SOLID.surface.F)) + 1)
    monkeypatch.setattr(boundary_starts_module, "turned", lambda start, _: start)
    assert maps._turned(maps.first) is (maps.first if unfolded else None)


def test_faces_that_do_not_look_outward_are_counted():
    maps = boundary_starts_module._BoundaryMaps(SOLID.surface, VolumeOptions(), None)
    assert maps._not_outward(maps.first) == 0
    mirrored = dataclasses.replace(maps.first, image=maps.first.image * [1.0, 1.0, -1.0])
    assert maps._not_outward(mirrored) == SOLID.surface.n_faces


def test_folded_faces_of_a_thin_wall_are_turned_by_keeping_all_others():
    """For equal areas they would have to be anywhere else, and take their neighbours along."""
    maps = boundary_starts_module._BoundaryMaps(mug(7, 1, 6).surface, VolumeOptions(), None)
    folded = maps._chart(maps.fatter_ratio, 100.0)
    assert maps._not_outward(folded) > 0
    done = turned(folded)
    assert done.certificate.certified and maps._not_outward(done) == 0
    assert turned(done) is done
    equal = finished(folded, max_iter=0, tol=0.05)

    def changed(found):
        return np.median(np.abs(np.log(np.abs(found.distortion.ratios / folded.distortion.ratios))))

    assert changed(done) < 0.15 and changed(done) < 0.5 * changed(equal)


@pytest.mark.parametrize("lost", [False, True])
def test_what_equal_areas_leave_folded_keeps_its_shape_unless_it_is_lost(monkeypatch, lost):
    def no_area(*_):
        raise DegenerateError("a face without area")

    maps = boundary_starts_module._BoundaryMaps(mug(7, 1, 6).surface, VolumeOptions(), None)
    folded = maps._chart(maps.fatter_ratio, 100.0)
    monkeypatch.setattr(finish, "UNFOLD_STEPS", 0)
    if lost:
        monkeypatch.setattr(Level, "keeping", no_area)
    done = finished(folded, max_iter=0, tol=0.05)
    assert (done.history[-1].flips > 0) == lost
    assert np.array_equal(done.angles, folded.angles) == lost


def test_a_wall_of_one_cell_is_mapped_from_shapes_kept_though_some_faces_fold():
    plates = np.zeros((7, 7, 5), bool)
    plates[:, :, ::2] = plates[3, 3, :] = True
    plates[1, 1, 0] = False  # the hole
    patient = VolumeOptions(time_limit=0.1)
    found = sm.volume_map(sm.TetMesh(*cubes(plates)), options=patient)
    assert found.certificate.certified and found.converged and found.distortion.flips == 0


def test_what_untangling_kept_is_dropped_before_steps_begin(monkeypatch):
    solid, kept, given_back = sm.samples.bumpy_torus(1500), [], []
    minimized, whole = engine._minimize, untangle_order.untangle_whole

    def untangled(model, *arguments, **keywords):
        found = whole(model, *arguments, **keywords)
        model.roomy_weights, kept.append(model)
        return found

    def watched(run, **keywords):
        assert kept and run.history.model is not kept[-1] and given_back
        assert not [name for name in vars(run.history.model) if name.startswith("roomy")]
        return minimized(run, **keywords)

    monkeypatch.setattr(untangle_order, "untangle_whole", untangled)
    monkeypatch.setattr(engine, "_minimize", watched)
    monkeypatch.setattr(engine._core.base, "give_free_memory_back", lambda: given_back.append(1))
    assert sm.volume_map(solid).certificate.certified and len(given_back) == 2
