"""Solids whose flat torus has faces that go more than half round it: rings with a long limb."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from shapes import cubes, with_limb
from stretchmap import _core
from stretchmap.errors import SolverError
from stretchmap.mesh.split_edges import SplitSolid
from stretchmap.registration.embed import split_long_edges
from stretchmap.registration.flat_torus import FlatSurface


@pytest.fixture(scope="module")
def ring_with_limb():
    filled = np.zeros((19, 5, 3), bool)
    filled[:5, :, 0] = True
    filled[1:4, 1:4, 0] = False
    filled[4:18, 2, 0] = True
    filled[17, 2, :] = True
    return sm.TetMesh(*cubes(filled))


def test_faces_round_the_flat_torus_are_halved_until_points_are_found_in_them(ring_with_limb):
    solid = ring_with_limb
    flat = FlatSurface.of(solid.surface)
    queries = np.random.default_rng(3).random((20_000, 2))
    assert np.abs(flat.ways(flat.surface.edges)).max() > 0.7
    assert (flat.locator.locate(queries)[0] < 0).any()  # the other copy of a long face is nearer
    split, finer = split_long_edges(SplitSolid.of(solid), flat)
    assert np.abs(finer.ways(finer.surface.edges)).max() <= 0.5
    assert split.n_split > 0 and split.solid.surface.area == pytest.approx(solid.surface.area)
    np.testing.assert_array_equal(finer.turns[: len(flat.turns)], flat.turns)
    points = finer.points(queries)
    faces = flat.locator.locate(queries)[0]
    same = faces >= 0
    np.testing.assert_allclose(points[same], flat.points(queries[same]), atol=1e-7)


def test_a_ring_with_a_long_limb_is_a_target(ring_with_limb):
    result = sm.register(sm.samples.solid_torus(300), ring_with_limb)
    assert result.certificate.certified


def test_a_limb_that_a_flat_torus_shrinks_to_nothing_is_named():
    surface = with_limb(sm.samples.torus_surface(36, 18), 200, 0.12)
    with pytest.raises(SolverError, match=r"of the target lie so far out .* coarser") as caught:
        FlatSurface.of(surface, "target")
    assert len(caught.value.ids)


def test_limbs_that_the_conformal_map_loses_in_rounding_keep_their_tips():
    surface = with_limb(sm.samples.torus_surface(36, 18), 130, 0.12)
    conformal = sm.conformal_map(surface)
    chart = _core.area.SurfaceChart(surface.topology, conformal.forms)
    assert not (_core.area.turn_areas(chart, conformal.turns) > 0.0).all()
    flat = FlatSurface.of(surface)
    ratios = _core.area.turn_areas(flat.chart, flat.turns) * surface.area / surface.face_areas
    assert 0.005 < ratios.min() and ratios.max() < 30.0


def test_stretch_energy_steps_that_break_down_are_left_off(monkeypatch):
    surface = sm.samples.torus_surface(24, 12)
    least = FlatSurface.of(surface).turns

    class BreaksDown:
        def __init__(self, *given):
            self.turns = given[-1]

        def step(self):
            raise SolverError("the matrix is not positive definite")

    monkeypatch.setattr(_core.area, "SurfaceSem", BreaksDown)
    away = FlatSurface.of(surface).turns - least
    assert np.ptp(away, axis=0).max() < 0.01
