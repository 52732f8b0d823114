"""A stretch common to all tets changes no ratio of volumes, and no map."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from shapes import RING, cubes
from stretchmap.mesh.refinement import refine_overconstrained
from stretchmap.volume import problem
from stretchmap.volume.anisotropy import unstretching

SOLID = sm.samples.bumpy_torus(1500)


def stretched(matrix: np.ndarray) -> sm.TetMesh:
    return sm.TetMesh(SOLID.V @ matrix, SOLID.T)


def test_an_even_mesh_is_left_alone():
    assert unstretching(SOLID.V, SOLID.T) is None
    assert unstretching(SOLID.V * [2.0, 1.0, 1.0], SOLID.T) is None


def test_cubes_cut_along_their_diagonals_are_even():
    """Every tet begins at the corner its cube's diagonal leaves from."""
    assert unstretching(*cubes(RING)) is None


def test_the_order_of_a_tets_corners_does_not_count():
    V = SOLID.V * [40.0, 1.0, 1.0]
    turned = np.ascontiguousarray(SOLID.T[:, [2, 0, 1, 3]])
    assert unstretching(V, turned) == pytest.approx(unstretching(V, SOLID.T), rel=1e-3)


@pytest.mark.parametrize("factors", [(100.0, 1.0, 1.0), (1.0, 30.0, 1.0), (40.0, 1.0, 900.0)])
def test_a_stretch_is_found_whatever_its_direction(factors):
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    matrix = turn @ np.diag(factors) @ turn.T
    undone = unstretching(SOLID.V @ matrix, SOLID.T)
    assert undone is not None and np.linalg.det(undone) == pytest.approx(1.0)
    values = np.linalg.svd(matrix @ undone, compute_uv=False)
    assert values[0] < 2.0 * values[2]


@pytest.mark.parametrize("factors", [(100.0, 1.0, 1.0), (1.0, 1.0, 1000.0)])
def test_the_map_of_a_stretched_solid_is_as_good(factors):
    plain = sm.volume_map(SOLID).distortion
    result = sm.volume_map(stretched(np.diag(factors)))
    assert result.certificate.certified and result.converged
    assert result.distortion.element_error_mean < 1.2 * plain.element_error_mean
    surface = stretched(np.diag(factors)).surface
    start = result.boundary_map
    assert np.array_equal(start.mesh.V, surface.V)
    assert not start.converged and "stretch" in start.stop_reason
    assert result.distortion.source_total == pytest.approx(SOLID.volume * np.prod(factors))


def test_a_held_boundary_keeps_the_areas_of_the_surface_as_it_is():
    result = sm.volume_map(stretched(np.diag([20.0, 1.0, 1.0])), boundary="frozen")
    assert result.certificate.certified
    assert result.boundary_map.distortion.element_std < 0.2


def test_edges_are_as_long_as_without_the_stretch(monkeypatch):
    """The longest are halved first, and what all tets are stretched by makes none of them long."""
    solid, undone = sm.TetMesh(*cubes(RING)), np.diag([0.2, 1.0, 2.0])
    monkeypatch.setattr(problem, "unstretching", lambda V, T: undone)
    found = problem.VolumeProblem.of(solid, solid.V[solid.boundary_vertices]).solid
    expected = refine_overconstrained(solid, solid.V @ undone).solid
    np.testing.assert_array_equal(found.T, expected.T)
    np.testing.assert_array_equal(found.V, expected.V)
    assert not np.array_equal(found.T, refine_overconstrained(solid).solid.T)
