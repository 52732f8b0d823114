"""Solids as a mesher leaves them that is not asked for quality: all vertices on the boundary."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm


def delaunay(surface: sm.TriMesh) -> sm.TetMesh:
    """Tets between the vertices of a surface, thin ones that reach right across."""
    tetgen = pytest.importorskip("tetgen")
    made = tetgen.TetGen(np.asarray(surface.V), np.asarray(surface.F))
    points, tets = made.tetrahedralize(switches="pYQ")[:2]
    return sm.TetMesh(points, tets[:, :4], orient=True)


@pytest.mark.parametrize(
    ("surface", "mean"),
    [  # with edges halved by number: 0.081, 0.059, 0.059, 0.075
        (sm.samples.vertebra_like(1000).surface, 0.07),
        (sm.samples.vertebra_like(3000).surface, 0.05),
        (sm.samples.bumpy_torus(2000).surface, 0.055),
        (sm.samples.bumpy_torus(6000).surface, 0.06),
    ],
)
def test_solids_without_a_vertex_inside(surface, mean):
    solid = delaunay(surface)
    assert (solid.boundary_index < 0).sum() <= 3
    result = sm.volume_map(solid)
    assert result.certificate.certified and result.converged
    assert result.distortion.element_error_mean < mean
    np.testing.assert_array_equal(result.mesh.V[: solid.n_vertices], solid.V)
