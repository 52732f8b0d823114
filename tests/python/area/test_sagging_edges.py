"""Surfaces too coarse for the torus: what is halved, what that brings, what is left alone."""

from __future__ import annotations

import dataclasses
import itertools
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from small_handles import eased, inward_faces, small_handle, start_of
from stretchmap import TriMesh, _core
from stretchmap.area import finest, finish
from stretchmap.area.coarse import Level
from stretchmap.area.finer import Finer, goal
from stretchmap.area.finish import Pace, approach_areas, unfold_faces
from stretchmap.area.route import Made
from stretchmap.area.work import Work
from stretchmap.base.torus import TWO_PI
from stretchmap.mesh.halved_faces import halve_edges


@pytest.mark.parametrize(("seed", "far"), [(0, 3.8), (2, 4.0)])
def test_areas_of_small_handles_are_right_once_edges_are_halved(seed: int, far: float) -> None:
    surface = small_handle(seed, far)
    plain, finer = sm.area_map(surface, refine=False), sm.area_map(surface)
    assert plain.refinement is None and plain.distortion.element_std > 0.02
    assert finer.certificate.certified and finer.distortion.flips == 0
    assert finer.distortion.element_std <= 0.01
    added = finer.refinement
    assert added is not None and added.surface is finer.mesh
    n = surface.n_vertices
    assert (finer.mesh.V[:n] == surface.V).all() and finer.image.shape == finer.mesh.V.shape
    report = finer.to_dict()
    assert report["added_vertices"] == added.n_split == finer.mesh.n_vertices - n
    assert report["added_faces"] == added.n_added_faces > 0
    # Certified anew, from the mesh and the image alone.
    assert sm.certify(TriMesh(finer.mesh.V, finer.mesh.F), finer.image, finer.torus).certified


def test_surfaces_fine_enough_stay_as_they_are() -> None:
    for surface in (sm.samples.torus_surface(), sm.samples.bumpy_torus(4_000).surface):
        result = sm.area_map(surface)
        assert result.refinement is None and len(result.image) == surface.n_vertices
        assert result.to_dict()["added_faces"] == 0


def test_halving_keeps_the_chart() -> None:
    start = start_of(small_handle(0))
    surface = start.level.surface
    marked = np.arange(len(surface.edges)) % 5 == 0
    finer = start.halved(marked)
    before, after = (
        _core.area.turn_areas(each.level.chart, np.ascontiguousarray(each.angles / TWO_PI))
        for each in (start, finer)
    )
    sums = np.bincount(finer.added.parent_face, after, surface.n_faces)
    assert np.allclose(sums, before, rtol=1e-9, atol=1e-15)
    assert (finer.angles[: surface.n_vertices] == start.angles).all()
    # Sums of closed forms along the two angles' loops are whole turns, as they were.
    assert before.sum() == pytest.approx(after.sum()) == pytest.approx(1.0)


def test_what_sags_is_found_and_fitted() -> None:
    start = start_of(small_handle(0, 3.8))
    level = start.level
    assert Finer.of(level, start.angles, start.ratio).too_coarse()
    fitted = start.fitted(1.0)
    assert fitted is not None and (fitted.sags() > 1.0).mean() < 0.005 < (start.sags() > 1.0).mean()
    assert 0.0 < fitted.share < 1.0
    assert start_of(small_handle(0, 3.2)).fitted(1.0) is None  # so many faces are not worth it
    torus = sm.samples.torus_surface()
    fine = start_of(torus)
    assert not fine.too_coarse()
    # The sag of an edge along the outer equator, over the height of its faces.
    turn = TWO_PI / 30
    grid = sm.samples.torus_surface(30, 20, 3.0, 1.0)
    u, v = np.arctan2(grid.V[:, 1], grid.V[:, 0]), np.rint(np.arange(600) % 20)
    spread = sm.Torus(3.0, 1.0).xi(u + 0.5 * turn * (v % 2), TWO_PI * v / 20)
    equator = start_of(TriMesh(spread, grid.F))
    ends = equator.level.surface.V[equator.level.surface.edges]
    outer = (np.abs(ends[:, :, 2]) < 1e-9).all(axis=1) & (np.hypot(*ends.T[:2]) > 3.9).all(axis=0)
    sag = (equator.ratio + 1.0) * (1.0 - np.cos(turn / 2.0))
    assert outer.sum() == 30
    height = sag / equator.sags()[outer]
    assert np.ptp(height) < 0.1 * height.mean() and 0.2 < height.mean() < 0.45


def slender(finer: Finer) -> np.ndarray:
    """Of the image in the chart: longest edge of each face squared, over its area."""
    surface = finer.level.surface
    lengths = finer.lengths()[surface.topology.edge.reshape(-1, 3)].max(axis=1)
    turns = np.ascontiguousarray(finer.angles / TWO_PI)
    return lengths**2 / _core.area.turn_areas(finer.level.chart, turns)


def sags_along_the_torus(finer: Finer) -> np.ndarray:
    """What `Finer.sags` is to be, from the corners' angles alone: feet and heights in the chart."""
    surface, chart, R = finer.level.surface, finer.level.chart, finer.ratio
    shifts = np.stack([chart.shift_u, chart.shift_v], axis=-1)
    corners = finer.angles[surface.F] + TWO_PI * shifts
    torus, most = sm.Torus(R, 1.0), np.zeros(len(surface.edges))
    heights = surface.face_areas * torus.area / surface.face_areas.sum()
    for k in range(3):
        a, b, c = (corners[:, (k + m) % 3] for m in range(3))
        middle = 0.5 * (a + b)
        scale = np.column_stack([R + np.cos(middle[:, 1]), np.ones(len(a))])
        along, third = scale * (b - a), scale * (c - a)
        foot = np.clip((third * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        chord = 0.5 * (torus.xi(*a.T) + torus.xi(*b.T))
        sag = 4.0 * foot * (1.0 - foot) * np.linalg.norm(torus.xi(*middle.T) - chord, axis=1)
        sag *= np.linalg.norm(along, axis=1) / (2.0 * heights)
        np.maximum.at(most, surface.topology.edge.reshape(-1, 3)[:, k], sag)
    return most


def chart_shares(finer: Finer) -> np.ndarray:
    """Areas of the faces in the chart of equal area, over those of the source."""
    turns = np.ascontiguousarray(finer.angles / TWO_PI)
    density = 1.0 + np.cos(finer.angles[:, 1])[finer.level.surface.F].mean(axis=1) / finer.ratio
    areas = finer.level.surface.face_areas
    return density * _core.area.turn_areas(finer.level.chart, turns) / areas * areas.sum()


def test_long_edges_of_needles_may_lie_deep_below_the_torus() -> None:
    """Rings of needles: their long edges follow the equators, their short ones cross them."""
    angles = [np.linspace(0.0, TWO_PI, n, endpoint=False) for n in (12, 400)]
    turned = np.stack(np.meshgrid(*angles, indexing="ij"), axis=-1)
    turned[..., 0] += np.linspace(0.0, TWO_PI, 400) / 24  # sheared: no right angles
    V = sm.Torus(3.0, 1.0).xi(*turned.reshape(-1, 2).T)
    F = sm.samples.torus_surface(12, 400).F
    needles = start_of(TriMesh(V, F, orient=True))
    i, j = needles.level.surface.edges.T
    long = np.linalg.norm(needles.level.surface.V[i] - needles.level.surface.V[j], axis=1) > 0.5
    assert long.sum() > 4_000 and needles.sags()[long].max() < 1.0
    # One of them halved alone stands up where the other still lies deep.
    once = needles.halved(np.arange(len(long)) == np.flatnonzero(long)[0])
    assert once.sags().max() > 5.0
    # In one ring of them every third; the ones between go with them, those of other rings do not.
    third = long & (i // 400 == 3) & (j // 400 == 4) & (i % 3 == 0)
    assert needles.halved(third).sags().max() > 5.0
    twins = dataclasses.replace(needles, near=True).halved_with_twins(third)
    assert twins.sags().max() < 1.0
    assert 2 * third.sum() < twins.added.n_split < 7 * third.sum()


def test_twins_are_edges_that_are_still_whole(monkeypatch) -> None:
    """Others are halved with those marked, as the longest of a face, and are no twins."""
    start = dataclasses.replace(start_of(small_handle(0, 3.8)), near=True, needles=True)
    halved, rounds = Finer.halved, []

    def seen(finer, marked):
        rounds.append((marked, halved(finer, marked)))
        return rounds[-1][1]

    monkeypatch.setattr(Finer, "halved", seen)
    start.halved_with_twins(start.sags() > 0.5)
    assert len(rounds) == 3
    for (marked, finer), (more, _) in itertools.pairwise(rounds):
        whole = set(map(tuple, np.sort(finer.level.surface.edges, axis=1)))
        twins = start.level.surface.edges[more & ~marked]
        assert len(twins) and whole.issuperset(map(tuple, np.sort(twins, axis=1)))


def test_only_needles_have_twins() -> None:
    surface = small_handle(0, 3.8)
    start = dataclasses.replace(start_of(surface), near=True)
    marked = start.sags() > 1.0
    assert not start.needles and marked.any()
    alike = start.halved(marked), start.halved_with_twins(marked)
    assert np.array_equal(alike[0].angles, alike[1].angles)
    more = dataclasses.replace(start, needles=True).halved_with_twins(marked)
    assert more.added.n_split > alike[0].added.n_split


@pytest.mark.parametrize("seed", [0, 4])
def test_large_faces_keep_their_areas_where_the_flat_chart_is_bent(seed: int) -> None:
    level, turns, phase, ratio = eased(small_handle(seed, 3.4))
    flat = np.column_stack([turns[:, 0], turns[:, 1] + phase]) * TWO_PI
    v = _core.area.angle_from_equal_area(np.ascontiguousarray(flat[:, 1]), 1.0 / ratio)
    plain = Finer.of(level, np.column_stack([flat[:, 0], v]), ratio)
    wrapped = Finer.wrapped(level, turns, phase, ratio)
    n = level.surface.n_vertices
    assert np.allclose(wrapped.angles[:n], plain.angles, atol=1e-12)  # bent in full
    # What equal areas there were in the flat chart: its pieces have them on the torus, too.
    share = _core.area.turn_areas(level.chart, turns) / level.surface.face_areas
    kept = (
        chart_shares(wrapped) / (share * level.surface.face_areas.sum())[wrapped.added.parent_face]
    )
    lost = chart_shares(plain) / (share * level.surface.face_areas.sum())
    assert lost.min() < 0.3 and kept.min() > 0.4


@pytest.mark.parametrize("seed", [1, 3])
def test_areas_are_led_near_and_no_face_is_left_inward(seed: int) -> None:
    start = Finer.wrapped(*eased(small_handle(seed, 3.8))).fitted(1.5)
    assert start is not None and start.ratios().std() > 0.2
    work = Work(start.level.surface.n_faces, 1e9, 40)
    near, pace, records = start.approached(None, work)
    assert {record.stage for record in records} == {"approach"} and work.left < 1e9
    assert near.ratios().std() < 0.15 and pace.weight > 1.0
    assert (near.sags() > 1.0).mean() < 0.005
    assert inward_faces(near) == 0
    # Halving alone does that, too, wherever the chart has no folds.
    rough = start_of(small_handle(seed, 3.8))
    assert inward_faces(rough) > 4 * inward_faces(rough.outward())


@pytest.mark.parametrize("far", [3.3, 3.4])
def test_single_faces_do_not_cut_steps_short(far: float) -> None:
    """Needles by the hundred: undamped, the first of them to turn over ends a step at a tenth."""
    start = Finer.wrapped(*eased(small_handle(0, far))).fitted(3.0)
    assert start is not None
    newton = start.newton()
    weights = _core.area.SurfaceWeights(shape=0.05, chart=1.0)
    taken = [newton.step(weights) for _ in range(6)]
    assert min(each.step for each in taken) > 0.35 and newton.solves > 6
    assert all(each.after < each.before for each in taken)
    assert (_core.area.turn_areas(start.level.chart, newton.angles / TWO_PI) > 0.0).all()


def test_steps_that_end_nowhere_early_are_solved_once() -> None:
    newton = start_of(sm.samples.torus_surface()).newton()
    weights = _core.area.SurfaceWeights(shape=0.1, chart=1.0)
    assert [newton.step(weights).step > 0.5 for _ in range(3)] == [True] * 3 and newton.solves == 3


def test_faces_left_inward_are_turned_where_areas_are_nearly_right() -> None:
    """Edges still sag too much here; where they are halved, no face is left inward."""
    by_pace, without, work = [], [], Work(1, 1e12, 40)
    for seed in range(8):
        start = Finer.wrapped(*eased(small_handle(seed, 3.6))).fitted(3.0)
        assert start is not None
        newton = start.newton()
        _, pace = approach_areas(newton, 10, None)
        assert newton.measures().flips > 0 and newton.measures().face_std < 0.1
        other = start.level.newton(newton.angles, start.ratio)
        unfold_faces(newton, 20, None, pace)
        unfold_faces(other, 20, None)  # shapes weigh as much as areas: these are lost
        assert newton.measures().flips == other.measures().flips == 0
        by_pace.append(newton.measures().face_std)
        without.append(other.measures().face_std)
        near, _, _ = start.approached(None, work)
        assert near.newton().least_facing() > 0.0 and near.newton().measures().face_std < 0.12
    assert np.mean(by_pace) < 0.65 * np.mean(without)


def test_steps_towards_areas_go_on_while_these_get_better(monkeypatch) -> None:
    start = Finer.wrapped(*eased(small_handle(0, 3.4))).fitted(3.0)
    assert start is not None
    monkeypatch.setattr(finish, "_SURE", 2)
    monkeypatch.setattr(finish, "_LOOK", 1)
    records, pace = approach_areas(start.newton(), 30, None)
    stds = [record.element_std for record in records]
    assert len(records) > 2 and stds[-1] <= 0.25 < stds[-2] and pace.weight > 4.0
    monkeypatch.setattr(finish, "_FALLS", 0.0)  # no step is good enough
    newton = start.newton()
    records, pace = approach_areas(newton, 30, None)
    assert len(records) == 2
    # Steps that follow on the same surface go on at that pace, and do no harm.
    before, weight = newton.measures().face_std, pace.weight
    afresh, _ = approach_areas(start.level.newton(newton.angles, start.ratio), 1, None)
    follow, faster = approach_areas(newton, 2, None, None, pace)
    assert pace.weight == weight <= faster.weight and follow[-1].element_std < before
    assert follow[0].energy < 0.5 * afresh[0].energy  # shapes weigh less by then


@pytest.mark.parametrize(("steps", "times"), [(4, 1), (0, 3)])
def test_approaches_that_lead_away_end(steps: int, times: int, monkeypatch) -> None:
    start = Finer.wrapped(*eased(small_handle(0, 3.4))).fitted(3.0)
    assert start is not None
    newton, middle = start.newton(), start.newton()
    approach_areas(newton, steps, None)
    approach_areas(middle, 2, None)
    assert 0.3 < middle.measures().face_std < 0.5
    taken = []

    def to_the_middle(newton: _core.area.SurfaceNewton, *_: object) -> tuple[list, Pace]:
        taken.append(newton)
        if len(taken) == 1:
            newton.angles = middle.angles
        return [], Pace()

    monkeypatch.setattr("stretchmap.area.finer.approach_areas", to_the_middle)
    near = dataclasses.replace(start, angles=newton.angles)
    found, _, _ = near.approached(None, Work(1, 1e12, 40))
    assert len(taken) == times and found.level.surface.n_faces > start.level.surface.n_faces


def test_edges_may_sag_more_where_faces_are_few() -> None:
    start = Finer.wrapped(*eased(small_handle(0, 3.2)))
    start = dataclasses.replace(start, affordable=10**5).fitted(3.0)
    assert start is not None
    newton = start.newton()
    approach_areas(newton, 10, None)
    near = dataclasses.replace(start, angles=newton.angles, near=True)
    fine = near.fitted_as_affordable()
    assert (fine.sags() > 1.0).mean() < 0.005
    most = near.level.surface.n_faces + 1000
    few = dataclasses.replace(near, affordable=most)
    assert few.fitted(1.0) is None and few.fitted(1.4) is None
    found = few.fitted_as_affordable()
    assert near.level.surface.n_faces < found.level.surface.n_faces <= most
    assert (found.sags() > 2.0).mean() < 0.005 < (found.sags() > 1.0).mean()


@pytest.mark.parametrize("turns", [9, 11, -8])
def test_edges_whose_ends_meet_again_are_long(turns: int) -> None:
    """A grid sheared so far that edges of its columns go most of the way round the torus."""
    start = start_of(sm.samples.torus_surface(40, 12, 3.0, 1.0))
    level, shear = start.level, np.array([[1, turns], [0, 1]], np.int32)
    forms = np.ascontiguousarray(shear @ level.forms)
    angles = start.angles @ shear.T
    sheared = Finer.of(Level.of(level.surface, angles / TWO_PI, forms, 1.0), angles, start.ratio)
    i, j = level.surface.edges.T
    span = np.abs(sheared.angles[j, 0] - sheared.angles[i, 0] + TWO_PI * forms[0])
    long, lengths = span > 1.2 * np.pi, sheared.lengths()
    chords = np.linalg.norm(sheared.image[i] - sheared.image[j], axis=1)
    assert long.sum() > 300 and (lengths >= chords - 1e-12).all()
    assert lengths[long].min() > 1.2 * np.pi * (start.ratio - 1.0)
    assert (2.0 * chords < lengths)[long].any()
    edge = level.surface.topology.edge.reshape(-1, 3)
    assert sheared.sags()[edge].max(axis=1).min() > 1.0
    assert np.allclose(sheared.sags(), sags_along_the_torus(sheared), rtol=1e-9, atol=1e-12)
    # Whatever edge of a face is halved, its longest is, too: no face becomes thinner.
    longest = edge[np.arange(len(edge)), lengths[edge].argmax(axis=1)]
    left = sheared.halved(~long).level.surface.edges @ [1, 10**6]
    assert not np.isin(left, level.surface.edges[longest] @ [1, 10**6]).any()
    fitted = sheared
    for _ in range(4):
        fitted = fitted.halved(fitted.sags() > 1.0)
    assert slender(fitted).max() < 3.0 * slender(sheared).max()


def test_a_chart_lost_in_rounding_is_passed_over(monkeypatch) -> None:
    """Where the surface is too coarse and no finer one serves, the next weight of shape follows."""
    surface = sm.samples.bumpy_torus(1000).surface
    monkeypatch.setattr(finest.Finest, "_finer_at_once", lambda self: (True, None))
    made, weights = finest.Finest._made, []

    def first_lost(self: finest.Finest, shape: float) -> Made:
        weights.append(shape)
        if len(weights) == 1:
            raise sm.errors.SolverError("lost")
        return made(self, shape)

    monkeypatch.setattr(finest.Finest, "_made", first_lost)
    found = sm.area_map(surface, keep_best=True)
    assert weights == list(finest.SHAPES[:2]) and found.certificate.certified
    assert found.stop_reason.startswith("too coarse for equal areas; ")
    monkeypatch.setattr(finest, "SHAPES", finest.SHAPES[:1])
    weights.clear()
    with pytest.raises(sm.errors.SolverError, match="lost"):
        sm.area_map(surface, keep_best=True)


def test_charts_are_eased_where_halving_takes_too_many_faces() -> None:
    surface = small_handle(1, 3.3)
    assert start_of(surface).fitted(1.0) is None
    plain, eased = sm.area_map(surface, refine=False), sm.area_map(surface)
    assert eased.certificate.certified and eased.refinement is not None
    # 0.01 where there is time enough; and what does not reach it says so.
    found = eased.distortion
    assert found.element_std < plain.distortion.element_std / 9.0
    worst = max(found.ratio_max - 1.0, 1.0 - found.ratio_min)
    assert eased.converged == (found.element_std <= 0.01 and worst <= 0.1)
    assert eased.converged or "face SD" in eased.stop_reason


@lru_cache(maxsize=2)
def mapped(seed: int) -> sm.AreaMap:
    return sm.area_map(small_handle(seed), ratio="conformal")


@pytest.mark.parametrize("seed", [3, 4])
def test_barriers_as_heavy_as_the_error_leave_steps_long(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, shares = mapped(seed), []
    assert found.converged
    monkeypatch.setattr(finish, "_CENTERED", 0.0)
    for each in (found, sm.area_map(small_handle(seed), ratio="conformal")):
        steps = [r.step for r in each.history if r.stage == "newton" and np.isfinite(r.step)]
        shares.append(np.mean(np.array(steps) > 0.9))
    assert shares[0] > 0.65 and shares[1] < 0.5


def test_barriers_follow_the_error_and_fade_where_long_steps_gain_little() -> None:
    center = finish._Center(10.0)
    assert center.least(0.01) == pytest.approx(1e-3)
    assert center.least(3.0) == 0.2  # from afar they would be all that counts
    for step, after, share in (
        (1.0, 0.95, 7.0),  # long, for little
        (1.0, 0.8, 7.0),
        (0.7, 0.95, 7.0),
        (1.0, 0.99, 4.9),
        (0.3, 0.95, 7.0),  # short: back again
        (0.0, 1.0, 10.0),
        (0.1, 0.99, 10.0),  # as heavy as they were, at most
    ):
        center.move_on(SimpleNamespace(step=step, before=1.0, after=after))
        assert center.share == pytest.approx(share)
    held = finish._Center(0.0)  # where shapes are kept, the energy stays what it is
    held.move_on(SimpleNamespace(step=0.1, before=1.0, after=0.9))
    assert held.least(0.5) == 0.0


@pytest.mark.parametrize("seed", [1, 2])
def test_less_curvature_is_modeled_after_long_steps(seed: int) -> None:
    newton = start_of(small_handle(seed)).newton()
    steps, curvature = [], [newton.curvature]
    for weight in (1.0, 1.0, 0.1, 0.1, 1e-3, 1e-3, 1e-3):
        steps.append(newton.step(_core.area.SurfaceWeights(chart=weight)).step)
        curvature.append(newton.curvature)
    assert curvature[:3] == [0.25, 0.125, 0.1] and min(steps[:2]) > 0.9
    short = int(np.argmin(steps))
    assert steps[short] < 0.5 and curvature[short + 1] == 2.0 * curvature[short]
    assert min(curvature) == 0.1


def test_rings_are_made_exact_only_where_faces_are_good() -> None:
    surface = small_handle(0, 4.0)
    # Edges are halved there, so that faces may be off by twice as much.
    far, good = sm.area_map(surface, tol=1e-4), sm.area_map(surface, tol=0.05)
    assert far.distortion.element_std > 2e-4
    assert good.distortion.element_std <= 0.05 and good.distortion.ring_std < 1e-9
    assert far.distortion.ring_std > 1e-9


@pytest.mark.parametrize("seed", [3, 4])
def test_edges_halved_let_areas_be_off_by_twice_the_tolerance(seed: int) -> None:
    for tol, found in ((0.005, mapped(seed)), (0.01, sm.area_map(small_handle(seed), tol=0.01))):
        assert found.refinement is not None and found.converged
        assert tol < found.distortion.element_std <= 2.0 * tol


def test_slivers_are_asked_for_less() -> None:
    surface = sm.samples.torus_surface()
    assert goal(surface, 5e-3) == pytest.approx(0.01) and goal(surface, 0.02) == pytest.approx(0.04)
    flat = TriMesh(surface.V * [1.0, 1.0, 50.0], surface.F)
    assert goal(flat, 5e-3) == pytest.approx(0.03)


def test_fields_and_files_of_a_refined_map(tmp_path) -> None:
    surface = small_handle(0, 4.2)
    labels = np.arange(surface.n_faces)
    result = sm.area_map(surface).with_fields({"x": surface.V[:, 0]}, {"label": labels})
    assert (result.cell_fields["label"] == result.refinement.parent_face).all()
    assert np.allclose(result.point_fields["x"], result.mesh.V[:, 0])
    result.save(tmp_path / "map.npz")
    loaded = sm.load_map(tmp_path / "map.npz")
    assert (loaded.arrays["parent_face"] == result.refinement.parent_face).all()
    assert (loaded.image == result.image).all() and loaded.distortion.flips == 0


def test_a_map_of_a_refined_boundary_can_start_a_solid(tmp_path) -> None:
    """It is made anew of the boundary as it is, on the same torus and with the same phase."""
    solid = sm.samples.bumpy_torus(1_000)
    edges = np.arange(len(solid.surface.edges)) % 9 == 0
    done = halve_edges(solid.surface, edges, np.ones(len(edges)))
    finer = sm.area_map(done.surface, ratio=2.5)
    assert finer.mesh.n_vertices > solid.surface.n_vertices
    finer.save(tmp_path / "map.npz")
    for start in (finer, sm.load_map(tmp_path / "map.npz")):
        result = sm.volume_map(solid, start=start)
        assert result.certificate.certified and result.boundary_map.phase == finer.phase
        assert result.boundary_map.ratio == finer.ratio
        assert result.boundary_map.mesh.n_faces == solid.surface.n_faces
    moved = TriMesh(finer.mesh.V + 1.0, finer.mesh.F)
    with pytest.raises(sm.errors.MeshError, match="another surface"):
        sm.volume_map(solid, start=dataclasses.replace(finer, mesh=moved))


def test_refinement_is_the_same_for_any_number_of_threads() -> None:
    surface = small_handle(1, 4.2)
    one, two = (sm.area_map(surface, threads=threads) for threads in (1, 2))
    assert (one.mesh.F == two.mesh.F).all() and (one.image == two.image).all()
