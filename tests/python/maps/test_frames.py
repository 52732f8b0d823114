"""Gradients and frames of the coordinates against closed forms, differences and files."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import samples
from stretchmap.errors import KindError, OptionError
from stretchmap.maps.frames import without_jump

RNG = np.random.default_rng(8)
TORUS = sm.Torus(3.0, 1.0)
A = np.array([[1.2, 0.3, 0.0], [0.0, 0.8, 0.1], [0.2, 0.0, 1.1]])


@pytest.fixture(scope="module")
def sheared():
    """A solid that an affine map takes to the standard solid torus."""
    solid = samples.solid_torus(4000, R=3.0, r=1.0)
    return a_map(sm.TetMesh(solid.V @ A.T, solid.T), solid.V, TORUS)


def points_of(result, n):
    weights = RNG.dirichlet(np.ones(4), n)
    tets = RNG.integers(result.mesh.n_tets, size=n)
    return np.einsum("ij,ijk->ik", weights, result.mesh.V[result.mesh.T[tets]])


def test_gradients_are_slopes_of_the_coordinates(sheared):
    points, step = points_of(sheared, 200), 1e-6

    def coordinates(x):
        u, v, s = TORUS.coordinates(x @ np.linalg.inv(A).T)
        return np.stack([u, v, s], axis=-1)

    field = sheared.coordinate_field(points)
    assert np.allclose(field.coordinates, coordinates(points), atol=1e-12)
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        slope = coordinates(points + shift) - coordinates(points - shift)
        slope[:, :2] = (slope[:, :2] + np.pi) % (2.0 * np.pi) - np.pi
        expected = slope / (2.0 * step)
        near_core = field.coordinates[:, 2] < 0.05
        assert np.allclose(field.gradients[~near_core, :, axis], expected[~near_core], atol=1e-5)


def test_frames_are_orthonormal_and_follow_the_lines_of_the_coordinates(sheared):
    field = sheared.coordinate_field()
    products = field.frames @ np.swapaxes(field.frames, 1, 2)
    assert np.allclose(products, np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(field.frames), 1.0)
    u, v, s = field.coordinates.T
    step = 1e-6
    along = (TORUS.xi(u + step, v, s) - TORUS.xi(u - step, v, s)) @ A.T
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    assert np.allclose(field.frames[:, 0], along, atol=1e-6)
    radial = np.einsum("nx,nx->n", field.frames[:, 2], field.gradients[:, 2])
    assert np.allclose(radial, np.linalg.norm(field.gradients[:, 2], axis=1))
    around = np.einsum("nx,nx->n", field.frames[:, 1], field.gradients[:, 1])
    assert around.min() > 0.0


def test_outside_and_on_the_core_nothing_is_made_up(sheared):
    core = (A @ np.array([3.0, 0.0, 0.0]))[None]
    field = sheared.coordinate_field(np.concatenate([core, [[50.0, 0.0, 0.0]]]))
    # The core of the solid itself lies on edges of the structured mesh.
    assert field.coordinates[0, 2] < 1e-12
    assert np.isfinite(field.gradients[0, 0]).all()
    if field.coordinates[0, 2] == 0.0:
        assert np.isnan(field.frames[0]).all()
    assert np.isnan(field.coordinates[1]).all() and np.isnan(field.frames[1]).all()


def test_angles_of_a_tet_are_in_one_piece(sheared):
    angles, single = sheared.corner_angles()
    plain = sheared.coordinates()[sheared.mesh.T][:, :, :2]
    turns = (angles - plain) / (2.0 * np.pi)
    assert np.allclose(turns, np.round(turns))
    assert single[:, 0].all() and (np.ptp(angles[:, :, 0], axis=1) < 1.0).all()
    assert (turns[:, :, 0] != 0).any()
    # The core is where v has no single value.
    radius = sheared.coordinate_field().coordinates[:, 2]
    assert 0 < (~single[:, 1]).sum() < 0.2 * len(single) and radius[~single[:, 1]].max() < 0.4
    values, alone = without_jump(np.array([0.0, 2.0, 4.0]), np.array([[0, 1, 2]]))
    assert not alone[0] and np.isfinite(values).all()


def test_sines_and_cosines_have_no_seam(sheared):
    field = sheared.coordinate_field()
    named = field.periodic()
    assert np.allclose(np.arctan2(named["sin_u"], named["cos_u"]) % (2 * np.pi),
                       field.coordinates[:, 0])  # fmt: skip
    assert np.allclose(named["cos_v"] ** 2 + named["sin_v"] ** 2, 1.0)


def test_files_hold_gradients_frames_and_seams(sheared, tmp_path):
    meshio = pytest.importorskip("meshio")
    sheared.save(tmp_path / "map.vtu")
    cells = meshio.read(tmp_path / "map.vtu").cell_data
    field = sheared.coordinate_field()
    for i, name in enumerate(("along", "around", "radial")):
        assert np.array_equal(cells[name][0], field.frames[:, i])
    for i, name in enumerate(("grad_u", "grad_v", "grad_s")):
        assert np.array_equal(cells[name][0], field.gradients[:, i])
    cut = cells["seam_u"][0] == 1
    angles, _ = sheared.corner_angles()
    jumps = np.ptp(sheared.coordinates()[sheared.mesh.T][:, :, 0], axis=1) > np.pi
    assert np.array_equal(cut, jumps) and (np.ptp(angles[cut, :, 0], axis=1) < np.pi).all()
    assert "along" not in sm.load_map(tmp_path / "map.vtu").cell_fields


def test_maps_without_torus_or_of_surfaces_are_refused(sheared):
    with pytest.raises(OptionError):
        a_map(sheared.mesh, sheared.image).coordinate_field()
    surface = sm.area_map(sheared.mesh.surface)
    with pytest.raises(KindError):
        surface.coordinate_field()
    with pytest.raises(KindError):
        surface.corner_angles()
