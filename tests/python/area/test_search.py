"""The search for the phase round the tube, and for R / r."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm


@pytest.mark.parametrize("first", [0, 13, 23])
def test_a_fat_ring_is_recognized_whatever_vertex_comes_first(first):
    ring = sm.samples.torus_surface(60, 60, 1.02, 1.0)
    order = (np.arange(ring.n_vertices) + first) % ring.n_vertices
    V = np.empty_like(ring.V)
    V[order] = ring.V
    surface = sm.TriMesh(V, order[ring.F].astype(np.int32))
    found = sm.area_map(surface, ratio="search", finish="none")
    assert found.ratio == pytest.approx(1.02, abs=0.01)
    assert found.distortion.element_std < 0.1


@pytest.mark.parametrize(("n_u", "n_v"), [(40, 60), (60, 60)])
def test_areas_are_not_balanced_at_the_price_of_all_shapes(n_u, n_v):
    """Even triangles on a fat ring: few places are jammed, and sizes differ by the hundred."""
    ring = sm.samples.torus_surface(n_u, n_v, 1.01, 1.0)
    torus = sm.Torus(1.01, 1.0)
    u, v = torus.coordinates(ring.V)[:2]
    half = np.tan(0.5 * (np.mod(v + np.pi, 2.0 * np.pi) - np.pi))
    conformal = 2.0 * np.arctan(np.sqrt(2.01 / 0.01) * half)
    surface = sm.TriMesh(torus.xi(u, conformal), ring.F)
    found = sm.area_map(surface, ratio="search", finish="none", keep_best=True)
    assert found.ratio == pytest.approx(1.01, abs=0.005)
    assert found.distortion.element_std < 0.08
