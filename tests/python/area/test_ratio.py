"""R / r where it is left to the map: of the fattest tori, and where edges have to be halved."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from small_handles import small_handle


@pytest.mark.parametrize("sides", [(36, 16), (40, 20)])
@pytest.mark.parametrize("ratio", [1.005, 1.02, 1.05])
def test_areas_of_the_fattest_tori_are_right_on_their_own(sides: tuple[int, int], ratio: float):
    surface = sm.samples.torus_surface(*sides, ratio, 1.0)
    result = sm.area_map(surface)
    assert result.converged and result.certificate.certified
    assert result.distortion.element_std < 5e-3 and result.refinement is None
    assert abs(np.log((result.ratio - 1.0) / (ratio - 1.0))) < 0.4


def test_the_ratio_asked_for_is_that_of_the_map():
    """Off by a few per cent of R / r - 1, areas are off by as many."""
    surface = sm.samples.torus_surface(36, 16, 1.02, 1.0)
    conformal = sm.area_map(surface, ratio="conformal")
    assert conformal.ratio == pytest.approx(sm.conformal_map(surface).torus.ratio, rel=1e-12)
    assert not conformal.converged and conformal.distortion.element_std > 0.02
    assert sm.area_map(surface, ratio=1.02).ratio == pytest.approx(1.02, rel=1e-12)


def test_fewer_edges_are_halved_with_the_best_ratio():
    surface = small_handle(4, 3.5)
    conformal, free = sm.area_map(surface, ratio="conformal"), sm.area_map(surface)
    assert conformal.certificate.certified and free.certificate.certified and free.converged
    assert conformal.ratio == pytest.approx(sm.conformal_map(surface).torus.ratio, rel=1e-12)
    assert surface.n_faces < free.mesh.n_faces < 0.95 * conformal.mesh.n_faces
    assert free.ratio < 0.95 * conformal.ratio and free.distortion.element_std < 0.01


def test_where_areas_stay_off_the_best_ratio_is_tried_too():
    """A ring drawn thin: by the conformal map, one of R / r = 30."""
    u, v = np.meshgrid(*(np.arange(n) * 2 * np.pi / n for n in (60, 16)), indexing="ij")
    r = 0.01 + 0.99 * np.sin(u / 2) ** 2
    x = 3.0 + r * np.cos(v)
    V = np.stack([x * np.cos(u), x * np.sin(u), r * np.sin(v)], axis=-1).reshape(-1, 3)
    surface = sm.TriMesh(V, sm.samples.torus_surface(60, 16).F, orient=True)
    conformal, free = sm.area_map(surface, ratio="conformal"), sm.area_map(surface)
    assert free.ratio < 0.5 * conformal.ratio and free.certificate.certified
    assert free.distortion.element_std < 0.6 * conformal.distortion.element_std
    # Not where shapes count as well, nor where but a few steps are asked for.
    for asked in ({"balance": 0.5}, {"max_iter": 3}):
        assert sm.area_map(surface, keep_best=True, **asked).ratio == conformal.ratio
