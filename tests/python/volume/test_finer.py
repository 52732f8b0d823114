"""Vertices for the tets that keep their volume worst, where volumes are kept badly."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from shapes import mug
from stretchmap import _core
from stretchmap.base import budget
from stretchmap.mesh.refinement import longest_inner_edges, refine_overconstrained
from stretchmap.samples.solids import cut_cells
from stretchmap.volume import engine
from stretchmap.volume import minimize as minimizing
from stretchmap.volume.problem import VolumeProblem


def plate(*shape: int) -> sm.TetMesh:
    """Cells with a hole near one corner: the others are far from it."""
    cells = np.ones(shape, bool)
    cells[1, 1] = False
    return sm.TetMesh(*cut_cells(cells), orient=True)


@pytest.fixture(scope="module")
def solid() -> sm.TetMesh:
    return plate(12, 3, 3)


@pytest.fixture(scope="module")
def finer(solid):
    return sm.volume_map(solid)


@pytest.fixture
def not_coarse(monkeypatch):
    """Small solids are refined as large ones are, with time for all rounds on slow processors."""
    monkeypatch.setattr(engine, "_BADLY", ())
    monkeypatch.setattr(budget, "_LEAST_SECONDS", 10 * budget._LEAST_SECONDS)


def unevenness(result: sm.VolumeMap, solid: sm.TetMesh) -> float:
    """Mean abs(ratio - 1) of the input's tets."""
    volumes = _core.mesh.tet_volumes(result.image, result.mesh.T)
    ratios = np.bincount(result.refinement.parent_tet, volumes) / solid.tet_volumes
    return float(np.abs(ratios / (volumes.sum() / solid.volume) - 1.0).mean())


def mean_error(result: sm.VolumeMap) -> float:
    return float(np.abs(result.distortion.ratios - 1.0).mean())


def chain(n: int) -> sm.TetMesh:
    """Blocks of 27 cells, the first with a hole, each behind a neck of one cell."""
    cells = np.zeros((4 * n + 3, 3, 3), bool)
    for k in range(n + 1):
        cells[4 * k : 4 * k + 3] = cells[4 * k + 3 : 4 * k + 4, 1, 1] = True
    cells[1, 1] = False
    return sm.TetMesh(*cut_cells(cells), orient=True)


def test_tets_that_keep_volumes_badly_get_vertices(monkeypatch, not_coarse):
    """The input's tets gain by a third, all tets by a tenth, there being more small ones.

    How many tets are added is up to rounding, and what is gained goes with it: the chains are
    mapped with solves of two exactnesses.
    """
    solids = [chain(n) for n in (1, 2, 3)] * 2
    exact = [sm.VolumeOptions(cg_tol=tol) for tol in (0.05, 0.001) for _ in range(3)]

    def maps() -> list[sm.VolumeMap]:
        return [sm.volume_map(s, options=o) for s, o in zip(solids, exact, strict=True)]

    finer = maps()
    monkeypatch.setattr(engine, "_FINER_ROUNDS", 0)
    coarse = maps()
    for solid, before, after in zip(solids, coarse, finer, strict=True):
        assert not before.refinement.halved and after.refinement.halved
        assert before.converged and after.converged and after.certificate.certified
        assert unevenness(after, solid) < 0.8 * unevenness(before, solid)
        assert mean_error(after) < mean_error(before) > engine._UNEVEN
        np.testing.assert_array_equal(after.mesh.V[: solid.n_vertices], solid.V)
        np.testing.assert_array_equal(after.mesh.boundary_vertices, solid.boundary_vertices)
    assert sum(map(mean_error, finer)) < 0.9 * sum(map(mean_error, coarse))
    assert sum(map(unevenness, finer, solids)) < 0.7 * sum(map(unevenness, coarse, solids))
    n_finer, n_coarse = (sum(each.mesh.n_tets for each in made) for made in (finer, coarse))
    assert n_finer < 1.7 * n_coarse


def drilled(half: float) -> sm.TetMesh:
    """A block of 48 tets, 3 wide, with a square hole."""
    cells = np.ones((3, 3, 1), bool)
    cells[1, 1] = False
    V, T = cut_cells(cells)
    at = np.column_stack([np.interp(V[:, :2], range(4), [0, 1.5 - half, 1.5 + half, 3]), V[:, 2]])
    return sm.TetMesh(at, T, orient=True)


def test_coarse_solids_get_as_many_vertices_as_it_takes(monkeypatch):
    """All tets about a small hole are small; what is large is too few to have any far above the
    mean."""
    solids = [drilled(half) for half in (0.08, 0.05, 0.02, 0.01, 0.007)]
    maps = [sm.volume_map(each) for each in solids]
    assert all(each.certificate.certified and each.converged for each in maps)
    assert max(map(mean_error, maps)) < 0.075
    assert max(each.mesh.n_tets for each in maps) <= engine._BADLY[0][0]
    monkeypatch.setattr(engine, "_MORE", ())
    assert min(mean_error(sm.volume_map(each)) for each in solids) > 0.08


def test_solids_that_are_not_coarse_get_more_where_volumes_are_kept_worse(monkeypatch):
    """A comb of two rows of cells; its teeth are what is squeezed."""
    cells = np.zeros((11, 5, 2), bool)
    cells[:, 0] = cells[:3, :3] = cells[4::2] = True
    cells[1, 1] = False
    solid = sm.TetMesh(*cut_cells(cells), orient=True)
    more = sm.volume_map(solid)
    assert more.certificate.certified and more.converged and mean_error(more) < 0.08
    assert engine._BADLY[0][0] < more.mesh.n_tets <= engine._BADLY[1][0]
    monkeypatch.setattr(engine, "_BADLY", engine._BADLY[:1])
    assert mean_error(sm.volume_map(solid)) > 0.08


def test_rounds_go_on_while_volumes_are_kept_badly(monkeypatch, not_coarse):
    solids = [chain(n) for n in (2, 3)]
    all_rounds = [sm.volume_map(each) for each in solids]
    monkeypatch.setattr(engine, "_FINER_ROUNDS", 1)
    one_round = [sm.volume_map(each) for each in solids]
    assert all(result.converged for result in all_rounds)
    left, before = (sum(map(unevenness, made, solids)) for made in (all_rounds, one_round))
    assert left < 0.9 * before


def test_vertices_come_once_steps_gain_little(monkeypatch, not_coarse):
    """How many steps there are is up to rounding: three mugs, with solves of two exactnesses."""
    solids = [mug(*shape) for shape in ((5, 2, 5), (5, 2, 6), (6, 2, 6))] * 2
    exact = [sm.VolumeOptions(cg_tol=tol) for tol in (0.05, 0.001) for _ in range(3)]

    def maps() -> list[sm.VolumeMap]:
        return [sm.volume_map(s, options=o) for s, o in zip(solids, exact, strict=True)]

    early = maps()
    monkeypatch.setattr(minimizing, "_LITTLE", -np.inf)  # once they gain nothing
    late = maps()
    assert all(each.converged and each.certificate.certified for each in early)
    steps, before = (sum(len(each.history) for each in made) for made in (early, late))
    assert steps < 0.9 * before
    left, least = (sum(map(unevenness, made, solids)) for made in (early, late))
    assert left < 1.05 * least


def test_what_keeps_volumes_well_is_left_as_it_is(solid, monkeypatch):
    monkeypatch.setattr(engine, "_UNEVEN", 0.2)
    assert not sm.volume_map(solid).refinement.halved


def test_no_vertices_where_a_held_boundary_keeps_volumes_badly():
    solid = mug(7, 1, 7)
    start = sm.area_map(solid.surface, ratio=1.5, keep_best=True)
    result = sm.volume_map(solid, start=start)
    assert "are held" in result.stop_reason
    assert mean_error(result) > engine._UNEVEN
    assert not result.refinement.halved


def test_no_vertices_where_they_are_not_allowed(solid):
    whole = refine_overconstrained(solid).solid
    result = sm.volume_map(whole, options=sm.VolumeOptions(refine=False))
    assert result.mesh.n_tets == whole.n_tets
    assert mean_error(result) > engine._UNEVEN


@pytest.mark.parametrize("served", [0, 1])
def test_a_round_that_gains_nothing_is_taken_back(solid, finer, monkeypatch, served):
    minimize, outcome, rounds, left = engine.minimize, engine._outcome, [], []

    def gaining_once(model, x, history, *, glide, start, goal, leave=None, **keywords):
        first = x.copy()
        done = minimize(
            model, x, history, glide=glide, start=start, goal=goal, leave=leave, **keywords
        )
        if not glide or start < goal or leave is None:
            return done
        rounds.append(history.budget.seconds)
        return done if len(rounds) <= served else dataclasses.replace(done, x=first)

    def ended(run, *arguments):
        left.append(run.history.budget.seconds)
        return outcome(run, *arguments)

    monkeypatch.setattr(engine, "minimize", gaining_once)
    monkeypatch.setattr(engine, "_outcome", ended)
    result = sm.volume_map(solid)
    assert result.converged and result.certificate.certified
    assert [len(edges) for edges in result.refinement.halved] == [
        len(edges) for edges in finer.refinement.halved[:served]
    ]
    assert len(rounds) == served + 1
    assert max(rounds) < 0.75 * left[-1]  # what follows has all of the time again


def test_a_round_cut_off_by_time_is_kept_where_volumes_gain(solid, monkeypatch):
    minimize, rounds = engine.minimize, []

    def cut_off(model, x, history, *, leave=None, **keywords):
        done = minimize(model, x, history, leave=leave, **keywords)
        if not keywords["glide"] or keywords["start"] < keywords["goal"]:
            return done
        rounds.append(leave is not None)
        if leave is not None:
            history.budget = history.budget.share(0.0)
            done = dataclasses.replace(done, converged=False, left=False)
        return done

    monkeypatch.setattr(engine, "minimize", cut_off)
    result = sm.volume_map(solid)
    assert len(result.refinement.halved) == 1 and rounds == [True, False]
    assert result.converged and result.certificate.certified  # by the steps after it


@pytest.mark.parametrize("falls", [False, True])
def test_a_further_round_cut_off_by_time_counts_where_the_mean_of_all_falls(monkeypatch, falls):
    minimize, rounds = engine.minimize, []

    def cut_off(model, x, history, *, leave=None, **keywords):
        done = minimize(model, x, history, leave=leave, **keywords)
        if keywords["glide"] and keywords["start"] == keywords["goal"] and leave is not None:
            rounds.append(done)
            history.budget = history.budget.share(0.0)
            done = dataclasses.replace(done, converged=False, left=False)
        return done

    monkeypatch.setattr(engine, "minimize", cut_off)
    monkeypatch.setattr(engine, "_POOR", np.inf)  # further rounds alone
    monkeypatch.setattr(engine, "_unevenness", lambda problem, x: 1.0 / problem.solid.n_tets)
    monkeypatch.setattr(
        engine, "_mean_error", lambda problem, x: problem.solid.n_tets ** (-1.0 if falls else 1.0)
    )
    monkeypatch.setattr(engine, "_BADLY", ((5_000, 0.0),))
    monkeypatch.setattr(engine, "_UNEVEN", 0.0)
    result = sm.volume_map(drilled(0.05), options=sm.VolumeOptions(ratio=2.0))  # on one torus
    assert len(rounds) == 1 and result.certificate.certified
    assert (len(result.refinement.halved) > 0) == falls


def test_vertices_are_for_large_tets_that_keep_their_volume_worst(monkeypatch):
    solid = sm.samples.bumpy_torus(3000)
    torus = sm.area_map(solid.surface).torus
    problem = VolumeProblem.of(solid, solid.V, torus=torus, warm=True)
    assert not len(engine._uneven_edges(problem, engine._POOR))  # all ratios are one
    volumes, inside = solid.tet_volumes, solid.boundary_index < 0
    moved = int(np.flatnonzero(inside)[len(solid.V) // 5])
    at = (solid.T == moved).any(axis=1)
    x = problem.x.copy()
    x[moved] += 0.4 * (x[solid.T[at]].reshape(-1, 3).max(axis=0) - x[moved])
    uneven = dataclasses.replace(problem, x=x)
    assert not len(engine._uneven_edges(uneven, engine._POOR))  # on the whole they are good enough
    monkeypatch.setattr(engine, "_UNEVEN", 0.0)
    ratios = _core.mesh.tet_volumes(x, solid.T) / _core.mesh.tet_volumes(problem.V, solid.T)
    assert ratios.min() > 0.0 and (np.abs(ratios[at] - 1.0) > 0.05).any()
    energy = 0.5 * (ratios + 1.0 / ratios) - 1.0
    large = volumes > volumes.mean()
    worst = large & (energy > 3.0 * (energy * volumes).sum() / volumes.sum())
    assert (worst & at).any() and (large & ~worst).any() and not (worst & ~at).any()
    found = engine._uneven_edges(uneven, engine._POOR)
    np.testing.assert_array_equal(
        found, longest_inner_edges(solid, problem.V, np.flatnonzero(worst))
    )


def test_the_longest_edges_that_reach_inside(solid):
    whole = refine_overconstrained(solid).solid
    tets = np.arange(0, whole.n_tets, 7)
    inside = whole.boundary_index < 0
    wanted = set()
    for corners in whole.T[tets]:
        pairs = [(a, b) for a in corners for b in corners if a < b and (inside[a] or inside[b])]
        lengths = [np.linalg.norm(whole.V[a] - whole.V[b]) for a, b in pairs]
        if pairs:
            wanted.add(max(lengths))
    found = longest_inner_edges(whole, whole.V, tets)
    assert found.shape[1] == 2 and (found[:, 0] < found[:, 1]).all()
    assert (inside[found].any(axis=1)).all()
    lengths = np.linalg.norm(whole.V[found[:, 0]] - whole.V[found[:, 1]], axis=1)
    assert set(np.round(lengths, 12)) == set(np.round(list(wanted), 12))
    assert len(np.unique(found, axis=0)) == len(found)
    assert longest_inner_edges(whole, whole.V, tets[:0]).shape == (0, 2)


def test_where_volumes_are_kept_far_too_badly_more_get_vertices_at_once(monkeypatch):
    """How many steps that saves is up to rounding: solves of two exactnesses."""
    exact = [sm.VolumeOptions(cg_tol=tol) for tol in (0.1, 0.01)]

    def maps() -> list[sm.VolumeMap]:
        return [sm.volume_map(chain(4), options=o) for o in exact]

    at_once = maps()
    monkeypatch.setattr(engine, "_FAR_TOO_UNEVEN", np.inf)
    steps, before = (sum(len(each.history) for each in made) for made in (at_once, maps()))
    assert steps < 0.92 * before
    assert all(each.converged and mean_error(each) < 0.08 for each in at_once)


@pytest.mark.parametrize(
    ("n_tets", "error", "bad"),
    [(4_990, 0.07, True), (5_000, 0.07, False), (5_000, 0.09, True), (199_990, 0.09, True),
     (200_000, 0.09, False), (199_990, 0.07, False)],
)  # fmt: skip
def test_what_is_bad_goes_with_the_number_of_tets(monkeypatch, n_tets, error, bad):
    monkeypatch.setattr(engine, "_mean_error", lambda *_: error)
    problem = SimpleNamespace(solid=SimpleNamespace(n_tets=n_tets), x=None)
    assert engine._is_bad(problem, 6) == bad
