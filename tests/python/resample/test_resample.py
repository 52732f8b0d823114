"""Hexahedral grids and fields carried over, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import _core, samples
from stretchmap.errors import FileFormatError, OptionError
from stretchmap.registration.flat_torus import FlatSurface
from stretchmap.registration.map import register
from stretchmap.resample.hexes import hex_mesh
from stretchmap.resample.quality import corner_tets

RNG = np.random.default_rng(2)


@pytest.fixture(scope="module")
def standard():
    solid = samples.solid_torus(40_000, R=3.0, r=1.0)
    return a_map(solid, solid.V, sm.Torus(3.0, 1.0))


@pytest.fixture(scope="module")
def bumpy_map():
    return sm.volume_map(samples.bumpy_torus(6000))


@pytest.fixture(scope="module")
def vertebra_map():
    return sm.volume_map(samples.vertebra_like(8000))


@pytest.fixture(scope="module")
def registered():
    pair = samples.vertebra_pair(n_landmarks=30, n_tets=(6000, 8000))
    return register(pair.source, pair.target, (pair.source_landmarks, pair.target_landmarks))


def test_the_grid_of_the_standard_torus_is_the_standard_grid(standard):
    mesh = hex_mesh(standard, sections=48, block=4, rings=4)
    assert np.allclose(mesh.V, mesh.grid, atol=1e-9)
    assert mesh.n_invalid == 0 and mesh.n_pulled_back_invalid == 0
    assert len(mesh.H) == 48 * (4 * 4 + 4 * 4 * 4)
    assert mesh.volume == pytest.approx(standard.mesh.volume, rel=0.04)
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
    assert mesh.n_invalid == 0 and mesh.jacobians.max() <= 1.0 + 1e-12
    assert mesh.volume == pytest.approx(bumpy_map.mesh.volume, rel=0.1)
    u, v, s = mesh.coordinates.T
    assert np.allclose(bumpy_map.torus.xi(u, v, s), mesh.grid, atol=1e-12)


def test_a_tangled_grid_is_repaired(vertebra_map):
    """Coarse sections through a sharply bent image leave negative corners."""
    igl = pytest.importorskip("igl")
    result = vertebra_map
    raw = hex_mesh(result, sections=40, repair=False)
    assert raw.n_invalid == raw.n_pulled_back_invalid > 0
    assert raw.moved == raw.boundary_moved == 0.0
    seen = []
    mesh = hex_mesh(
        result,
        sections=40,
        progress=lambda stage, done, total, **values: seen.append((stage, values)),
    )
    assert seen[0][0] == "untangle" and seen[-1][0] == "draw back"
    assert mesh.n_invalid == 0 and mesh.jacobians.min() > 0.05
    rim = np.arange(len(mesh.V)).reshape(40, -1)[:, -16:].ravel()
    size = np.linalg.norm(np.ptp(result.mesh.V, axis=0))
    surface = result.mesh.surface
    squared = igl.point_mesh_squared_distance(mesh.V[rim], surface.V, surface.F)[0]
    assert np.sqrt(squared.max()) < 1e-12 * size
    moved = np.linalg.norm(mesh.V - raw.V, axis=1) / size
    assert mesh.moved == pytest.approx(moved.max(), rel=1e-12)
    assert mesh.boundary_moved == pytest.approx(moved[rim].max(), rel=1e-12)
    assert mesh.moved < 0.15 and np.median(moved) < 0.01
    assert mesh.volume_ratios.std() < 2.0 * raw.volume_ratios.std()
    assert mesh.volumes.sum() == pytest.approx(result.mesh.volume, rel=0.1)


@pytest.mark.parametrize(("sections", "block", "rings"), [(16, 1, 1), (24, 2, 3), (60, 3, 2)])
def test_grids_of_other_sizes_are_repaired_too(vertebra_map, sections, block, rings):
    mesh = hex_mesh(vertebra_map, sections=sections, block=block, rings=rings)
    assert mesh.n_invalid == 0 and mesh.jacobians.min() > 0.05


def test_the_search_lowers_its_energy_and_leaves_good_corners_alone(standard):
    mesh = hex_mesh(standard, sections=16, block=2, rings=2)
    surface = FlatSurface.of(standard.mesh.surface)
    rim = np.zeros(0, np.int32)
    y = np.zeros((0, 2))
    tets = corner_tets(mesh.H)
    rest = np.tile(np.eye(3).ravel() / np.cbrt(mesh.volumes.mean()), (len(tets), 1))
    shaken = mesh.V + 0.02 * RNG.standard_normal(mesh.V.shape)

    def relax(start, slack, pull):
        return _core.resample.relax_grid(
            tets, rest, np.ones(len(tets)), _core.volume.EnergyWeights(1.0, 1.0), slack, 1.0,
            mesh.V, y,
            np.full(len(start), pull), surface.locator, surface.surface.V, surface.surface.F,
            surface.face_slopes, rim, 2, y, start, np.full(len(start), 0.05),
        )  # fmt: skip

    def energy(V):
        edges = V[tets][:, 1:] - V[tets][:, :1]
        J = np.swapaxes(edges, 1, 2) @ rest.reshape(-1, 3, 3)
        det = np.linalg.det(J)
        return (J**2).sum((1, 2)) / (3.0 * np.cbrt(det) ** 2) - 1.0 + 0.5 * (det + 1 / det) - 1.0

    assert (energy(shaken) > 0.0).all()
    _, moved, _, gain, count = relax(shaken, 0.0, 0.0)
    assert count > 0
    assert gain == pytest.approx(energy(shaken).sum() - energy(moved).sum(), rel=1e-9)
    # Nothing is worse than this slack: the points only go home.
    _, home, _, _, _ = relax(shaken, 1e3, 1.0)
    assert np.array_equal(home, mesh.V)


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


def test_bad_input_is_named(standard, registered):
    for options in ({"sections": 2}, {"block": 0}, {"rings": 0}):
        with pytest.raises(OptionError):
            hex_mesh(standard, **options)
    with pytest.raises(OptionError):
        hex_mesh(registered)
