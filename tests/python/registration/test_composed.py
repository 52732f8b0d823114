"""Registrations by way of the solid torus, where a boundary laid directly on the target fails."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from shapes import cubes
from stretchmap import _core
from stretchmap.base.budget import Budget
from stretchmap.registration import filling
from stretchmap.registration import map as _map
from stretchmap.registration.composed import _angles, composed
from stretchmap.volume.options import FillOptions


@pytest.fixture(scope="module")
def washer():
    """A square one, nine times as wide as high, whose hole is off its center."""
    filled = np.ones((9, 9, 1), bool)
    filled[4:8, 3:6] = False
    return sm.TetMesh(*cubes(filled))


@pytest.fixture(scope="module")
def ring():
    return sm.samples.solid_torus(600)


def test_a_map_there_and_back_turns_few_tets_over_and_keeps_volumes(ring, washer):
    begin = composed(ring, washer, FillOptions(), Budget(60.0), None)
    problem = begin.problem
    T, skin = problem.solid.T, begin.boundary.split.solid.boundary_vertices
    volumes = _core.mesh.tet_volumes(problem.x, T)
    assert (volumes <= 0.0).mean() < 0.05
    np.testing.assert_array_equal(
        problem.x[skin], (begin.boundary.points - problem.center) / problem.length
    )
    ratios = volumes / _core.mesh.tet_volumes(problem.solid.V, T) * problem.solid.volume
    assert np.abs(ratios - 1.0).mean() < 0.5


def test_what_fails_directly_is_tried_by_way_of_the_torus(ring, washer, monkeypatch):
    monkeypatch.setattr(filling, "_FIRST", 0.0)
    result = sm.register(ring, washer)
    assert result.certificate.certified and result.converged and result.boundary == "glide"
    assert result.distortion.element_error_mean < 0.15
    assert result.gauge == composed(ring, washer, FillOptions(), Budget(60.0), None).gauge
    parents = result.refinement.parent_tet if result.refinement else np.arange(ring.n_tets)
    volumes = _core.mesh.tet_volumes(result.mesh.V, result.mesh.T)
    np.testing.assert_allclose(
        np.bincount(parents, volumes), _core.mesh.tet_volumes(ring.V, ring.T), rtol=1e-9
    )


def test_without_time_for_the_maps_there_is_no_other_way(ring, washer):
    assert composed(ring, washer, FillOptions(), Budget(0.0), None) is None


def test_cancelling_ends_the_maps_too(ring, washer):
    def cancel(stage, done, total, **values):
        raise sm.errors.Cancelled("enough")

    with pytest.raises(sm.errors.Cancelled, match="enough"):
        composed(ring, washer, FillOptions(), Budget(60.0), cancel)


def test_all_the_time_is_for_what_goes_well():
    whole = Budget(100.0)
    trial = filling._Trial(whole, None)
    assert trial.left < 50.0
    trial.note("glide", 1, 2, flips=1, element_std=0.1)
    assert trial.left < 50.0
    trial.note("glide", 1, 2, flips=0, element_std=0.1)
    assert trial.left > 90.0


def test_angles_of_even_areas():
    v = np.linspace(-np.pi, np.pi, 31)
    for bend in (0.0, 0.5, 0.99):
        s = v + bend * np.sin(v)
        np.testing.assert_allclose(_angles(s, np.full_like(v, bend)), v, atol=1e-9)


def test_where_the_boundary_crosses_time_is_not_what_lacks():
    def reason(crossings, certified):
        filled = SimpleNamespace(
            boundary=SimpleNamespace(crossings=crossings),
            outcome=SimpleNamespace(stop_reason="no time left: 3 tets are stuck", stuck="3 tets"),
        )
        return _map._stop_reason(filled, SimpleNamespace(certified=certified))

    pairs = np.zeros((7, 2), np.int32)
    assert "no time" in reason(pairs[:0], False) and "no time" in reason(pairs, True)
    assert "no time" not in reason(pairs, False)
    assert reason(pairs, False).startswith("7 pairs of faces of the boundary image cross")
    assert reason(pairs, False).endswith("but landmarks may: 3 tets")
