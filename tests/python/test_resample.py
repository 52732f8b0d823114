"""Hexahedral grids and fields carried over, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import ArrayError, FileFormatError, OptionError
from stretchmap.registration import register
from stretchmap.resample import hex_mesh, transfer
from test_coordinates import a_map

RNG = np.random.default_rng(2)


@pytest.fixture(scope="module")
def standard():
    solid = samples.solid_torus(40_000, R=3.0, r=1.0)
    return a_map(solid, solid.V, sm.Torus(3.0, 1.0))


@pytest.fixture(scope="module")
def bumpy_map():
    return sm.volume_map(samples.bumpy_torus(6000))


@pytest.fixture(scope="module")
def registered():
    pair = samples.vertebra_pair(n_landmarks=30, n_tets=(6000, 8000))
    return register(pair.source, pair.target, (pair.source_landmarks, pair.target_landmarks))


def test_the_grid_of_the_standard_torus_is_the_standard_grid(standard):
    mesh = hex_mesh(standard, sections=48, block=4, rings=4)
    assert np.allclose(mesh.V, mesh.grid, atol=1e-9)
    assert mesh.n_negative == 0 and mesh.n_pulled_back_negative == 0
    assert len(mesh.H) == 48 * (4 * 4 + 4 * 4 * 4)
    assert mesh.volume == pytest.approx(standard.solid.volume, rel=0.04)
    # Every inner quad is shared by two hexahedra, the rest is a torus.
    faces = mesh.H[:, [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6],
                       [3, 0, 4, 7]]].reshape(-1, 4)  # fmt: skip
    _, count = np.unique(np.sort(faces, axis=1), axis=0, return_counts=True)
    assert set(count) == {1, 2} and (count == 1).sum() == 48 * 16
    edges = np.sort(mesh.H[:, [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4],
                               [0, 4], [1, 5], [2, 6], [3, 7]]].reshape(-1, 2), axis=1)  # fmt: skip
    n_edges = len(np.unique(edges, axis=0))
    assert len(mesh.V) - n_edges + len(count) - len(mesh.H) == 0


def test_a_mapped_grid_has_positive_jacobians_and_fills_the_solid(bumpy_map):
    mesh = hex_mesh(bumpy_map, sections=40)
    assert mesh.n_negative == 0 and mesh.jacobians.max() <= 1.0 + 1e-12
    assert mesh.volume == pytest.approx(bumpy_map.solid.volume, rel=0.1)
    u, v, s = mesh.coordinates.T
    assert np.allclose(bumpy_map.torus.xi(u, v, s), mesh.grid, atol=1e-12)


def test_a_tangled_grid_is_repaired(bumpy_map):
    """Coarse sections through a sharply bent image leave negative corners."""
    solid = samples.vertebra_like(8000)
    result = sm.volume_map(solid)
    raw = hex_mesh(result, sections=40, repair=False)
    assert raw.n_negative == raw.n_pulled_back_negative > 0
    mesh = hex_mesh(result, sections=40)
    assert mesh.n_negative == 0
    # The boundary stays but for the few vertices no inner point could make right.
    moved = np.linalg.norm(mesh.V - raw.V, axis=1)
    rim = np.arange(len(moved)).reshape(40, -1)[:, -16:].ravel()
    assert (moved[rim] > 0.0).mean() < 0.05
    size = np.linalg.norm(np.ptp(raw.V, axis=0))
    assert mesh.rim_moved == pytest.approx(moved[rim].max() / size, rel=1e-12)
    assert mesh.rim_moved < 0.05 and raw.rim_moved == 0.0


def test_saving_hexahedra(standard, tmp_path):
    meshio = pytest.importorskip("meshio")
    mesh = hex_mesh(standard, sections=12, block=2, rings=2)
    mesh.save(tmp_path / "grid.vtu")
    back = meshio.read(tmp_path / "grid.vtu")
    assert np.array_equal(back.cells_dict["hexahedron"], mesh.H)
    assert np.array_equal(back.points, mesh.V)
    with pytest.raises(FileFormatError):
        mesh.save(tmp_path / "grid.stl")
    assert "n hexahedra" in mesh.summary()


def test_fields_keep_their_integral_or_mean(registered):
    solid, target = registered.solid, registered.target
    field = 2.0 + np.sin(solid.V[:, 0])
    integral = (solid.tet_volumes * field[solid.T].mean(axis=1)).sum()
    carried = transfer(registered, field)
    assert (target.tet_volumes * carried).sum() == pytest.approx(integral, rel=1e-12)
    mean = transfer(registered, field, conserve="mean")
    assert (target.tet_volumes * mean).sum() / target.volume == pytest.approx(
        integral / solid.volume, rel=1e-12
    )
    # The correction itself is small: the carried field is the field, not its fudge.
    ones = transfer(registered, np.ones(solid.n_tets), per="tet", conserve="mean")
    assert np.allclose(ones, 1.0, atol=1e-12)


def test_a_registration_read_from_a_file_carries_fields_too(registered, tmp_path):
    registered.save(tmp_path / "r.npz")
    field = registered.solid.V[:, 0] + 10.0
    loaded = sm.load_map(tmp_path / "r.npz")
    assert np.array_equal(transfer(loaded, field), transfer(registered, field))


def test_a_field_follows_the_map():
    solid = samples.bumpy_torus(6000)
    same = register(solid, solid)
    field = solid.V @ [1.0, 2.0, 3.0] + 20.0
    carried = transfer(same, field)
    assert np.allclose(carried, field[solid.T].mean(axis=1), rtol=0.02)


def test_bad_input_is_named(standard, registered):
    for options in ({"sections": 2}, {"block": 0}, {"rings": 0}):
        with pytest.raises(OptionError):
            hex_mesh(standard, **options)
    with pytest.raises(OptionError):
        hex_mesh(registered)
    with pytest.raises(ArrayError):
        transfer(registered, np.zeros(3))
    with pytest.raises(OptionError):
        transfer(registered, np.zeros(registered.solid.n_vertices), conserve="energy")
    with pytest.raises(OptionError, match="no target"):
        transfer(standard, np.zeros(standard.solid.n_vertices))
