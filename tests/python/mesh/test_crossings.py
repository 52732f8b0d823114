"""Surfaces that cross themselves, and what is too small to tell."""

from __future__ import annotations

import pytest

import stretchmap as sm
from stretchmap.errors import DegenerateError, SelfIntersectionError
from stretchmap.mesh.crossings import require_no_crossing


@pytest.mark.parametrize("exponent", [-110, -105, -100, -95, -90])
def test_what_is_too_small_for_any_test_is_to_be_scaled(exponent):
    solid = sm.samples.solid_torus(400)
    tiny = sm.TetMesh(solid.V * 10.0**exponent, solid.T)
    with pytest.raises(DegenerateError, match="scale the points"):
        sm.volume_map(tiny)


@pytest.mark.parametrize("scale", [1e-74, 1.0, 1e44])
def test_what_crosses_itself_does_at_any_other_scale(scale):
    plain = sm.samples.torus_surface(12, 6)
    require_no_crossing(sm.TriMesh(plain.V * scale, plain.F), "it", "")
    V = plain.V.copy()
    V[0] = -V[0]
    with pytest.raises(SelfIntersectionError, match="it touches or crosses itself"):
        require_no_crossing(sm.TriMesh(V * scale, plain.F), "it", "")
