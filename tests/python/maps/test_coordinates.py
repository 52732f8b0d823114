"""Points carried through maps, against maps known in closed form."""

from __future__ import annotations

import pickle
import time

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import _core, samples
from stretchmap.errors import ArrayError, NonFiniteError, OptionError
from stretchmap.maps.points import PointMap

RNG = np.random.default_rng(5)


def points_inside(solid, n):
    weights = RNG.dirichlet(np.ones(4), n)
    tets = RNG.integers(solid.n_tets, size=n)
    return np.einsum("ij,ijk->ik", weights, solid.V[solid.T[tets]]), tets


@pytest.fixture(scope="module")
def bumpy_map():
    return sm.volume_map(samples.bumpy_torus(4000))


def test_an_affine_map_is_reproduced_everywhere():
    solid = samples.solid_torus(4000)
    A = np.array([[1.2, 0.3, 0.0], [0.0, 0.8, 0.1], [0.2, 0.0, 1.1]])
    shift = np.array([5.0, -3.0, 11.0])
    result = a_map(solid, solid.V @ A.T + shift)
    points, _ = points_inside(solid, 5000)
    assert np.allclose(result.forward(points), points @ A.T + shift, atol=1e-12)
    assert np.allclose(result.inverse(points @ A.T + shift), points, atol=1e-12)


def test_the_tet_found_holds_the_point():
    solid = samples.vertebra_like(5000)
    points, tets = points_inside(solid, 20_000)
    found = PointMap(a_map(solid, solid.V)).forward(points)
    assert found.inside.all()
    assert (found.tets == tets).mean() > 0.999  # but for points on faces within rounding
    assert np.abs(found.weights.sum(axis=1) - 1.0).max() < 1e-12
    assert np.allclose(found.interpolate(solid.T, solid.V[:, 2]), points[:, 2], atol=1e-12)


def test_there_and_back_on_a_certified_map(bumpy_map):
    solid = bumpy_map.mesh
    points, _ = points_inside(solid, 50_000)
    both = PointMap(bumpy_map)
    there = both.forward(points)
    back = both.inverse(there.points)
    size = np.linalg.norm(np.ptp(solid.V, axis=0))
    assert there.inside.all() and back.inside.all()
    assert np.abs(back.points - points).max() < 1e-9 * size


@pytest.mark.parametrize("name", ["rocker_arm_small", "kitten_small"])
def test_there_and_back_on_scanned_shapes(load_solid, name):
    result = sm.volume_map(load_solid(name))
    assert result.certificate.certified
    points, _ = points_inside(result.mesh, 50_000)
    size = np.linalg.norm(np.ptp(result.mesh.V, axis=0))
    assert np.abs(result.inverse(result.forward(points)) - points).max() < 1e-9 * size
    outside = result.mesh.V.max(axis=0) + size * np.array([[0.0, 0.0, 1e-3], [1.0, 1.0, 1.0]])
    assert np.isnan(result.forward(outside)).all()
    assert not result.point_map.forward(outside).inside.any()


def test_search_structures_do_not_hinder_copies(bumpy_map):
    before = bumpy_map.forward(bumpy_map.mesh.V[:5])
    copy = pickle.loads(pickle.dumps(bumpy_map.point_map))
    assert np.array_equal(copy.forward(bumpy_map.mesh.V[:5]).points, before)


def test_vertices_and_boundary_points_belong_to_the_mesh(bumpy_map):
    solid = bumpy_map.mesh
    assert np.allclose(bumpy_map.forward(solid.V), bumpy_map.image, atol=1e-12)
    surface = solid.surface
    weights = RNG.dirichlet(np.ones(3), surface.n_faces)
    on_faces = np.einsum("ij,ijk->ik", weights, surface.V[surface.F])
    found = PointMap(bumpy_map).forward(on_faces)
    assert found.inside.all()


def test_points_outside_are_told_and_not_guessed():
    solid = samples.solid_torus(4000)
    result = a_map(solid, solid.V)
    hole, above, far, inner = [0, 0, 0], [3, 0, 1.5], [1e9, 0, 0], [3.0, 0.0, 0.1]
    found = PointMap(result).forward([hole, above, far, inner])
    assert found.inside.tolist() == [False, False, False, True]
    assert np.isnan(found.points[:3]).all() and np.isnan(found.weights[:3]).all()
    assert (found.tets[:3] == -1).all()


@pytest.mark.parametrize("share, inside", [(1e-3, True), (1e-1, True), (1e1, False)])
def test_tolerance_is_a_distance_from_the_boundary(share, inside):
    solid = samples.ball(3)
    size = np.linalg.norm(np.ptp(solid.V, axis=0))
    surface = solid.surface
    corners = surface.V[surface.F]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    points = corners.mean(axis=1) + share * 1e-6 * size * normal
    found = PointMap(a_map(solid, solid.V), tolerance=1e-6).forward(points)
    assert (found.inside == inside).all()
    if inside:
        assert np.allclose(found.points, points, atol=1e-12)


def test_coordinates_of_the_standard_solid_torus():
    solid = samples.solid_torus(20_000, R=3.0, r=1.0)
    torus = sm.Torus(3.0, 1.0)
    result = a_map(solid, solid.V, torus)
    per_vertex = result.coordinates()
    assert np.allclose(torus.xi(*per_vertex.T), solid.V, atol=1e-12)
    u, v, s = (RNG.uniform(a, b, 500) for a, b in ((0, 2 * np.pi), (0, 2 * np.pi), (0.05, 0.9)))
    found = result.coordinates(torus.xi(u, v, s))
    assert np.allclose(found, np.stack([u, v, s], axis=1), atol=1e-11)


def test_a_million_points_take_seconds():
    solid = samples.solid_torus(20_000)
    points, _ = points_inside(solid, 1_000_000)
    result = PointMap(a_map(solid, solid.V))
    start = time.perf_counter()
    assert result.forward(points).inside.all()
    assert time.perf_counter() - start < 20.0


def test_no_queries_have_no_answers(bumpy_map):
    for none in ([], np.zeros((0, 3))):
        assert bumpy_map.forward(none).shape == bumpy_map.inverse(none).shape == (0, 3)
        found = PointMap(bumpy_map).forward(none)
        assert found.inside.shape == (0,) and found.weights.shape == (0, 4)
        assert bumpy_map.coordinates(none).shape == (0, 3)


def test_bad_input_is_named(bumpy_map):
    broken = bumpy_map.image.copy()
    broken[7] = np.nan
    with pytest.raises(NonFiniteError, match="image"):
        a_map(bumpy_map.mesh, broken).inverse(bumpy_map.image)
    with pytest.raises(ArrayError):
        bumpy_map.forward(np.zeros((3, 2)))
    with pytest.raises(NonFiniteError):
        bumpy_map.forward([[0.0, np.nan, 0.0]])
    with pytest.raises(ArrayError):
        PointMap(sm.area_map(bumpy_map.mesh.surface))
    with pytest.raises(OptionError):
        PointMap(bumpy_map, tolerance=-1.0)
    with pytest.raises(OptionError):
        a_map(bumpy_map.mesh, bumpy_map.image).coordinates()


def test_a_face_without_area_hides_no_closest_point():
    V = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    F = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]], np.int32)  # the search begins at the first
    queries = np.array([[0.5, -0.3, 0.0], [0.2, 0.2, 0.1]])
    points = _core.maps.SurfaceTree(V, F).closest(queries)[0]
    np.testing.assert_allclose(points, [[0.5, 0.0, 0.0], [0.2, 0.2, 0.0]], atol=1e-15)
