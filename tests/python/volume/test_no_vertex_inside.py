"""Solids as a mesher leaves them that is not asked for quality: all vertices on the boundary."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm


@pytest.fixture(autouse=True)
def mesher() -> None:
    pytest.importorskip("tetgen")


@pytest.mark.parametrize(
    ("surface", "mean"),
    [  # with edges halved by number: 0.076, 0.063, 0.057, 0.073
        (sm.samples.vertebra_like(1000).surface, 0.07),
        (sm.samples.vertebra_like(3000).surface, 0.05),
        (sm.samples.bumpy_torus(2000).surface, 0.055),
        (sm.samples.bumpy_torus(6000).surface, 0.06),
    ],
)
def test_solids_without_a_vertex_inside(surface, mean):
    solid = sm.samples.tetrahedralize(surface, quality=1e6)  # tets that reach right across
    assert (solid.boundary_index < 0).mean() < 0.02
    result = sm.volume_map(solid)
    assert result.certificate.certified and result.converged
    assert result.distortion.element_error_mean < mean
    np.testing.assert_array_equal(result.mesh.V[: solid.n_vertices], solid.V)
