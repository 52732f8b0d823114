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
