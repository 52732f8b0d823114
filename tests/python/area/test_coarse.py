"""Large surfaces are mapped by way of coarser ones."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from small_handles import small_handle, start_of
from stretchmap import _core
from stretchmap.area import coarse
from stretchmap.area.coarse import Level, levels


@pytest.fixture(scope="module")
def large() -> tuple[sm.TriMesh, sm.ConformalMap]:
    torus = sm.samples.torus_surface(220, 104)
    u, v = np.arctan2(torus.V[:, 1], torus.V[:, 0]), torus.V[:, 2]
    bumps = 1.0 + 0.2 * np.sin(3.0 * u + 2.0 * v) + 0.05 * np.cos(11.0 * u)
    surface = sm.TriMesh(torus.V * bumps[:, None], torus.F)
    return surface, sm.conformal_map(surface)


def test_a_coarser_surface_is_a_torus_over_the_same_chart(large):
    surface, conformal = large
    stack = levels(Level.of(surface, conformal.turns, conformal.forms, conformal.aspect))
    assert [level.surface.n_faces for level in stack] == [surface.n_faces, 20_000]
    fine, coarse = stack
    diagnosis = coarse.surface.diagnose()
    assert diagnosis.ok
    assert list(diagnosis.genus) == [1]
    areas = _core.area.turn_areas(coarse.chart, coarse.turns)
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(1.0)
    assert coarse.surface.area == pytest.approx(surface.area, rel=0.01)
    # What is linear on the coarse faces comes back as it was: the chart's own coordinates.
    back = _core.area.prolong(fine.coarse, fine.chart, coarse.turns)
    np.testing.assert_allclose(back, fine.turns, atol=1e-12)


def test_a_folded_prolongation_is_mended(large):
    surface, conformal = large
    fine, coarse = levels(Level.of(surface, conformal.turns, conformal.forms, conformal.aspect))
    # A shear that jumps from vertex to vertex folds fine faces across coarse edges.
    shaken = coarse.turns + 4e-4 * np.random.default_rng(3).standard_normal(coarse.turns.shape)
    assert (_core.area.turn_areas(coarse.chart, shaken) > 0.0).all()
    found = _core.area.prolong(fine.coarse, fine.chart, shaken)
    assert (_core.area.turn_areas(fine.chart, found) > 0.0).all()


def test_a_large_surface_has_the_quality_of_a_small_one(large):
    surface, conformal = large
    results = [sm.area_map(surface, conformal=conformal, threads=n) for n in (1, 2)]
    result = results[0]
    assert result.converged
    assert result.certificate.certified
    assert result.distortion.flips == 0
    assert result.distortion.element_std <= 5e-3
    assert result.distortion.ring_std <= 1e-9
    stages = [record.stage for record in result.history]
    assert "coarse" in stages
    assert stages.count("newton") <= 12
    np.testing.assert_array_equal(result.image, results[1].image)


@pytest.mark.parametrize(("seed", "far"), [(0, 3.8), (1, 3.8)])
def test_edges_of_a_large_surface_are_halved_too(monkeypatch, seed: int, far: float) -> None:
    """A large body may have limbs or a hole of few edges round, as a small one may."""
    surface = small_handle(seed, far)
    monkeypatch.setattr(coarse, "_MOST_FACES", surface.n_faces - 1)
    monkeypatch.setattr(coarse, "_LEAST_FACES", surface.n_faces // 2)
    stack = levels(start_of(surface).level)
    assert len(stack) == 2
    kept, result = (sm.area_map(surface, refine=refine) for refine in (False, True))
    assert kept.refinement is None and kept.distortion.element_std > 0.02
    assert result.refinement is not None and result.certificate.certified
    assert result.distortion.element_std <= 0.01
