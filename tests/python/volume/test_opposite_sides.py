"""Thin walls start from a boundary map whose sides are mirror images of each other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import stretchmap as sm
from shapes import RING, box, cubes, mug
from stretchmap.base.torus import TWO_PI
from stretchmap.volume import boundary_starts as starts_module
from stretchmap.volume import opposite_sides as module
from stretchmap.volume.boundary_starts import boundary_starts
from stretchmap.volume.opposite_sides import (
    _leveled,
    _mirror,
    _opposite,
    _volume_shares,
    opposite_sides,
)
from stretchmap.volume.options import VolumeOptions

ALONG, ACROSS = 48, 8


def ribbon(
    half_turns: int,
    *,
    thick: float = 0.05,
    wedge: float = 0.0,
    bulge: float = 0.0,
    lopsided: float = 0.0,
    layers: int = 1,
) -> sm.TetMesh:
    """A flat ring of cells, twisted; row ``(layers + 1) (9 i + x) + z`` of its vertices is at
    height z. Its thickness grows across by ``wedge`` and varies along by ``bulge``, as its width
    does by ``lopsided``."""
    points, T = cubes(box(ALONG, ACROSS, layers))
    i, x, z = points.astype(int).T
    last = i == ALONG
    if half_turns % 2:  # which a Kuhn split of the section stays in place under
        x, z = np.where(last, ACROSS - x, x), np.where(last, layers - z, z)
    ids = (layers + 1) * ((ACROSS + 1) * (i % ALONG) + x) + z
    i, x, z = np.indices((ALONG, ACROSS + 1, layers + 1)).reshape(3, -1)
    u = TWO_PI * i / ALONG
    across = 0.4 * (1.0 + lopsided * np.cos(u)) * (2.0 * x / ACROSS - 1.0)
    up = thick * (1.0 + wedge * across) * (1.0 + bulge * np.cos(u)) * (z / layers - 0.5)
    cos, sin = np.cos(0.5 * half_turns * u), np.sin(0.5 * half_turns * u)
    away, height = 1.0 + across * cos - up * sin, across * sin + up * cos
    V = np.stack([away * np.cos(u), away * np.sin(u), height], axis=-1)
    return sm.TetMesh(V, ids[T].astype(np.int32), orient=True)


def pairs_of(solid: sm.TetMesh) -> np.ndarray:
    assert len(solid.boundary_vertices) == solid.n_vertices
    return np.arange(solid.n_vertices).reshape(-1, 2)


def row_across(solid: sm.TetMesh) -> np.ndarray:
    return np.arange(solid.n_vertices) // 2 % (ACROSS + 1)


def off(turns: np.ndarray) -> np.ndarray:
    """Circular distance of each from their mean."""
    mean = np.angle(np.exp(1j * TWO_PI * turns).mean()) / TWO_PI
    return np.abs(turns - mean - np.round(turns - mean))


@pytest.mark.parametrize("bulge", [0.0, 0.6])
@pytest.mark.parametrize("half_turns", [0, 1, 2, 3, 4])
def test_opposite_vertices_are_mirrored_whatever_the_twist(half_turns, bulge):
    solid = ribbon(half_turns, bulge=bulge)
    conformal = sm.conformal_map(solid.surface)
    mirror = _mirror(conformal, _opposite(solid.surface))
    # A longitude may run round with the rims, a whole turn of them at a time.
    assert mirror.twist % 2 == half_turns % 2 and mirror.agreement > 0.95
    found = opposite_sides(solid, conformal, 2.0)
    assert found is not None and found.ratio == 2.0 and not found.converged
    near, far = pairs_of(solid).T

    def from_mirror(turns):
        u, v = turns.T
        apart = u[near] - u[far]
        apart -= np.round(apart)
        assert np.abs(apart).max() < 0.02
        return off(v[near] + v[far] - mirror.twist * (u[near] - 0.5 * apart))

    v = found.angles[:, 1] / TWO_PI
    sums, given = from_mirror(found.angles / TWO_PI), from_mirror(conformal.turns)
    # A twisted one is nearly as long on both sides: mirrored but for what that leaves, and that is
    # drawn out at the rims, where angles are large.
    assert np.median(sums) <= np.median(given) + 1e-9
    assert bulge or (sums.max() < (0.1 if half_turns else 1e-9) and np.median(sums) < 0.01)
    # Not by being all in one place.
    assert np.median(off(v[near] - v[far])) > 0.1


@pytest.mark.parametrize(("layers", "sample"), [(1, 1000), (1, 96), (2, 1000), (2, 96)])
def test_the_mirror_is_found_from_some_vertices_and_through_any_number_of_layers(
    monkeypatch, layers, sample
):
    monkeypatch.setattr(module, "_SAMPLE", sample)
    solid = ribbon(0, layers=layers)
    conformal = sm.conformal_map(solid.surface)
    pairs = _opposite(solid.surface)
    assert len(pairs) <= sample
    mirror = _mirror(conformal, pairs)
    assert mirror.twist == 0 and mirror.agreement > 0.95
    v = conformal.turns[:, 1] - mirror.axis
    if layers == 1:
        from_mirror = v.reshape(-1, 2).sum(axis=1)
    else:  # the rims have a middle, which the mirror leaves in its place
        from_mirror = 2.0 * v[np.abs(solid.surface.V[:, 2]) < 1e-9]
    assert np.abs(from_mirror - np.round(from_mirror)).max() < 0.01


def test_pairs_that_are_none_do_not_move_the_mirror():
    solid = ribbon(0)
    conformal = sm.conformal_map(solid.surface)
    pairs = _opposite(solid.surface)
    v = conformal.turns[:, 1]
    wrong = np.array(
        [(a, b) for a in range(18) for b in range(18) if 0.1 < (v[a] + v[b]) % 1 < 0.3]
    )
    assert len(wrong) > 20
    axis = _mirror(conformal, pairs).axis
    assert _mirror(conformal, np.vstack([pairs, wrong])).axis == pytest.approx(axis, abs=1e-3)


def test_of_pairs_that_fit_several_twists_the_least_is_taken():
    solid = ribbon(0)
    column = pairs_of(solid)[: ACROSS + 1]
    assert _mirror(sm.conformal_map(solid.surface), column).twist == 0


@pytest.mark.parametrize("half_turns", [0, 1, 2, 3])
def test_it_does_not_matter_where_turns_begin_anew(half_turns):
    """What is added to the turns of a vertex is the same from any branch of them."""
    solid = ribbon(half_turns, bulge=0.4, lopsided=0.3)
    conformal = sm.conformal_map(solid.surface)
    mirror = _mirror(conformal, _opposite(solid.surface))
    assert mirror.twist % 2 == half_turns % 2
    shares = _volume_shares(solid)
    branch = np.random.default_rng(0).integers(-1, 2, size=conformal.turns.shape)
    moved = dataclasses.replace(conformal, turns=conformal.turns + branch)
    here, there = (_leveled(mirror, of, shares) for of in (conformal, moved))
    assert there.turns - branch == pytest.approx(here.turns, abs=1e-9)
    assert there.angles(2.0) - TWO_PI * branch == pytest.approx(here.angles(2.0), abs=1e-6)


def test_volumes_all_round_are_those_of_the_wall():
    solid = ribbon(0, bulge=0.5)
    found = opposite_sides(solid, sm.conformal_map(solid.surface), 2.0)
    volumes = np.abs(np.linalg.det(solid.V[solid.T[:, 1:]] - solid.V[solid.T[:, :1]]))
    column = np.arange(solid.n_vertices) // (2 * (ACROSS + 1))
    u = found.angles[:, 0] / TWO_PI
    begin = u[column == 0].mean()
    for to in (8, 12, 24, 36):
        within = column[solid.T].max(axis=1) <= to
        within &= ~((column[solid.T] == 0).any(axis=1) & (column[solid.T] > 1).any(axis=1))
        way = (u[column == to].mean() - begin) % 1.0
        share = volumes[within].sum() / volumes.sum()
        assert min(way, 1.0 - way) == pytest.approx(min(share, 1.0 - share), abs=0.01)


def test_a_wall_that_is_too_uneven_or_no_wall_is_left_to_the_others_for_that_alone(monkeypatch):
    uneven, thick = ribbon(0, thick=0.004), ribbon(0, thick=0.7)
    stretch = np.ones((uneven.n_vertices, 3))
    stretch[:, 2] = np.exp(5.5 * uneven.V[:, 0])
    uneven = sm.TetMesh(uneven.V * stretch, uneven.T)
    for solid, gate, none in ((uneven, "_UNEVEN", np.inf), (thick, "_MIRRORED", 0.0)):
        conformal = sm.conformal_map(solid.surface)
        assert opposite_sides(solid, conformal, 2.0) is None
        with monkeypatch.context() as patched:
            patched.setattr(module, gate, none)
            assert opposite_sides(solid, conformal, 2.0) is not None


def test_a_folded_chart_is_left_to_the_others():
    solid = ribbon(0)
    conformal = sm.conformal_map(solid.surface)
    turns = conformal.turns.copy()
    turns[[100, 102]] = turns[[102, 100]]
    assert opposite_sides(solid, dataclasses.replace(conformal, turns=turns), 2.0) is None


def test_rims_lie_at_the_equators_the_shorter_one_inside():
    solid = ribbon(0)
    found = opposite_sides(solid, sm.conformal_map(solid.surface), 2.0)
    at, x = row_across(solid), np.cos(found.angles[:, 1])
    assert (x[at == 0] < -0.8).all() and (x[at == ACROSS] > 0.8).all()
    assert all(x[at == k].max() < x[at == k + 1].min() for k in range(ACROSS))


@pytest.mark.parametrize("wedge", [0.0, 1.5])
def test_volumes_between_levels_are_those_of_the_wall(wedge):
    solid = ribbon(0, wedge=wedge)
    found = opposite_sides(solid, sm.conformal_map(solid.surface), 3.0)
    volumes = np.abs(np.linalg.det(solid.V[solid.T[:, 1:]] - solid.V[solid.T[:, :1]]))
    x = found.torus.coordinates(found.image)[1]
    level = np.cos(x)  # from the inner to the outer equator
    for edge in (2, 4, 6):
        at = row_across(solid)
        share = volumes[(at[solid.T] <= edge).all(axis=1)].sum() / volumes.sum()
        height = level[at == edge].mean()
        t = np.linspace(-1.0, 1.0, 20001)
        density = np.sqrt(1.0 - t**2) * (3.0 + t)
        assert density[t <= height].sum() / density.sum() == pytest.approx(share, abs=0.02)


def test_shares_of_the_faces_follow_the_thickness():
    solid = ribbon(0, wedge=1.5)
    shares = _volume_shares(solid) / solid.surface.face_areas
    at = row_across(solid)
    side = at[solid.surface.F]
    inner = shares[(side.max(axis=1) == 2) & (side.min(axis=1) == 1)].mean()
    outer = shares[(side.max(axis=1) == ACROSS - 1) & (side.min(axis=1) == ACROSS - 2)].mean()
    assert outer / inner == pytest.approx(1.375 / 0.625, rel=0.2)


@pytest.mark.parametrize(
    "solid",
    [sm.samples.bumpy_torus(2000), sm.TetMesh(*cubes(RING)), mug(7, 1, 6)],
    ids=["thick", "a ring of cubes", "a mug"],
)
def test_what_is_no_even_thin_wall_is_left_to_the_others(solid):
    conformal = sm.conformal_map(solid.surface)
    assert opposite_sides(solid, conformal, 2.0) is None
    first = next(boundary_starts(solid, VolumeOptions(), glide=True, progress=None))
    assert "mirrored" not in first.stop_reason


def test_a_thin_wall_begins_with_it_unless_a_phase_is_asked_for_or_the_boundary_is_held():
    solid = ribbon(1)

    def first(glide: bool = True, **options):
        options = VolumeOptions(**options)
        return next(boundary_starts(solid, options, glide=glide, progress=None))

    assert "mirrored" in first().stop_reason and "mirrored" in first(ratio=3.0).stop_reason
    assert first(ratio=3.0).ratio == 3.0
    assert "mirrored" not in first(phase=0.25).stop_reason
    assert "mirrored" not in first(glide=False).stop_reason


def test_one_that_stays_folded_is_not_taken(monkeypatch):
    solid = ribbon(0)
    monkeypatch.setattr(starts_module, "turned", lambda start, _: start)
    monkeypatch.setattr(starts_module._BoundaryMaps, "_not_outward", lambda *_: 1)
    first = next(boundary_starts(solid, VolumeOptions(), glide=True, progress=None))
    assert "mirrored" not in first.stop_reason


@pytest.mark.parametrize("thick", [0.01, 0.05])
def test_the_map_of_a_thin_wall_keeps_volumes_better_for_it(monkeypatch, thick):
    solid = ribbon(0, thick=thick)
    found = sm.volume_map(solid)
    assert found.certificate.certified and found.converged
    monkeypatch.setattr(starts_module, "opposite_sides", lambda *_: None)
    without = sm.volume_map(solid, keep_best=True)
    assert found.distortion.element_error_mean < 0.75 * without.distortion.element_error_mean
