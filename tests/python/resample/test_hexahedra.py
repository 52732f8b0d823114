"""Measures of hexahedra, the proof that they are valid, and their files."""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import _core, samples
from stretchmap.errors import CertificationError, FileFormatError
from stretchmap.resample.hexes import hex_mesh
from stretchmap.resample.layout import swept_layout
from stretchmap.resample.quality import boundary_distances, boundary_quads

CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float
)
ONE = np.arange(8, dtype=np.int32)[None]


def determinant(corners, at):
    """det dx/d(xi, eta, zeta) of the trilinear map, from its definition."""
    J = np.zeros((3, 3))
    for corner, place in zip(corners, CUBE, strict=True):
        factors = np.where(place == 1.0, at, 1.0 - np.asarray(at))
        for axis in range(3):
            slope = 1.0 if place[axis] else -1.0
            J[:, axis] += corner * slope * np.delete(factors, axis).prod()
    return np.linalg.det(J)


def least_determinant(corners, places):
    """The least at some places, from their slopes at each corner."""
    at = np.asarray(places)[:, None]
    factors = np.where(CUBE == 1.0, at, 1.0 - at)
    signs = np.where(CUBE == 1.0, 1.0, -1.0)
    others = factors[..., [1, 0, 0]] * factors[..., [2, 2, 1]]
    return np.linalg.det(np.einsum("ci,pcj->pij", corners, signs * others)).min()


def valid(corners):
    return bool(_core.resample.valid_hexes(np.ascontiguousarray(corners, float), ONE)[0])


def test_the_coefficients_are_those_of_the_determinant():
    rng = np.random.default_rng(0)
    for _ in range(20):
        corners = CUBE + 0.4 * rng.standard_normal((8, 3))
        net = np.reshape(_core.resample.jacobian_coefficients(corners), (3, 3, 3))
        at = rng.random(3)
        xi, eta, zeta = (np.array([(1 - t) ** 2, 2 * t * (1 - t), t * t]) for t in at)
        value = np.einsum("i,j,k,ijk", xi, eta, zeta, net)
        assert value == pytest.approx(determinant(corners, at), abs=1e-12)
        assert value == pytest.approx(least_determinant(corners, [at]), abs=1e-12)
        volume = _core.resample.hex_volumes(corners, ONE)[0]
        assert volume == pytest.approx(net.mean(), abs=1e-12)


def test_cubes_boxes_and_sheared_boxes_are_valid_and_their_reflections_are_not():
    shear = np.array([[1.0, 0.7, 0.2], [0.0, 1e-3, 0.1], [0.0, 0.0, 5.0]])
    for corners in (CUBE, CUBE * [1.0, 2.0, 1e-4], CUBE @ shear.T + 1e3):
        assert valid(corners)
        assert not valid(corners * [-1.0, 1.0, 1.0])
    assert not valid(CUBE * [1.0, 1.0, 0.0])


def test_positive_corners_do_not_make_a_hexahedron_valid():
    """Found among random ones by the definition, not by the kernel under test."""
    rng = np.random.default_rng(4)
    places = list(itertools.product(np.linspace(0.0, 1.0, 9), repeat=3))
    corners_lie = agree = 0
    for _ in range(3000):
        corners = CUBE + 0.3 * rng.standard_normal((8, 3))
        if least_determinant(corners, CUBE) <= 0.0:
            assert not valid(corners)
            continue
        if valid(corners):
            agree += 1
            continue
        corners_lie += least_determinant(corners, places) <= 0.0
    assert corners_lie >= 3 and agree > 500


def test_a_valid_hexahedron_with_a_negative_coefficient_is_decided_by_halving():
    rng = np.random.default_rng(5)
    found = 0
    for _ in range(3000):
        corners = CUBE + 0.3 * rng.standard_normal((8, 3))
        if valid(corners) and min(_core.resample.jacobian_coefficients(corners)) < 0.0:
            found += 1
            at = rng.random((50, 3))
            assert least_determinant(corners, at) > 0.0
    assert found > 3


def test_scaled_jacobians_are_sines_of_sheared_angles():
    angle = 0.4
    sheared = CUBE @ np.array([[1.0, np.cos(angle), 0], [0, np.sin(angle), 0], [0, 0, 3.0]]).T
    assert np.allclose(_core.resample.scaled_jacobians(sheared, ONE), np.sin(angle), atol=1e-14)


def test_the_layout_is_a_grid_of_one_solid_torus():
    layout = swept_layout(12, 3, 2)
    assert len(layout.H) == 12 * (9 + 24) and len(layout.boundary) == 12 * 12
    assert np.bincount(layout.block).tolist() == [12 * 9] + [12 * 6] * 4
    assert np.bincount(layout.layer).tolist() == [12 * 12, 12 * 12, 12 * 9]
    grid = sm.Torus(3.0, 1.0).xi(layout.u, layout.v, layout.share)
    assert _core.resample.valid_hexes(grid, layout.H).all()
    assert np.array_equal(np.unique(boundary_quads(layout.H)), np.sort(layout.boundary))


def test_distances_between_a_cube_and_its_shell():
    box = samples.torus_surface(24, 24, R=3.0, r=1.0)
    layout = swept_layout(96, 6, 1)
    torus = sm.Torus(3.0, 1.0)
    quads = boundary_quads(layout.H)
    inflated = torus.xi(layout.u, layout.v, layout.share * 1.1)
    out, back = boundary_distances(inflated, quads, box)
    # Vertices of the surface lie on the torus, its faces inside it.
    assert 0.1 < out < 0.1 + 0.05 and 0.07 < back < 0.15


@pytest.fixture(scope="module")
def grid():
    solid = samples.solid_torus(4000, R=3.0, r=1.0)
    result = a_map(solid, solid.V, sm.Torus(3.0, 1.0))
    return hex_mesh(result, sections=12, block=2, rings=2, optimize=False)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh"])
def test_fields_are_written_and_read_back(grid, tmp_path, suffix):
    meshio = pytest.importorskip("meshio")
    grid.save(tmp_path / f"grid{suffix}")
    back = meshio.read(tmp_path / f"grid{suffix}")
    assert np.array_equal(back.cells_dict["hexahedron"], grid.H)
    assert np.array_equal(back.points, grid.V)
    for name, column in zip("uvs", grid.coordinates.T, strict=True):
        assert np.array_equal(back.point_data[name].ravel(), column)
    assert np.array_equal(back.cell_data["block"][0].ravel(), grid.block)
    assert np.array_equal(back.cell_data["layer"][0].ravel(), grid.layer)


def test_vtk_itself_reads_all_fields_of_its_legacy_format(grid, tmp_path):
    """It knows no integers of 32 bits by meshio's name for them, and reads no field after them."""
    pyvista = pytest.importorskip("pyvista")
    grid.save(tmp_path / "grid.vtk")
    back = pyvista.read(tmp_path / "grid.vtk")
    assert np.array_equal(back.cell_data["block"], grid.block)
    assert np.array_equal(back.cell_data["layer"], grid.layer)
    assert np.array_equal(back.cell_data["scaled_jacobian"], grid.scaled_jacobians)
    assert back.compute_cell_sizes().cell_data["Volume"].min() > 0.0


def test_abaqus_files_hold_sets_and_field_variables(grid, tmp_path):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / "grid.inp"
    grid.save(path)
    text = path.read_text()
    back = meshio.read(path)
    assert np.array_equal(back.cells_dict["hexahedron"], grid.H)
    assert np.array_equal(back.points, grid.V)
    members = np.concatenate(back.cell_sets["BLOCK_3"])
    assert np.array_equal(np.sort(members), np.flatnonzero(grid.block == 3))
    start = text.index("TYPE=FIELD, VARIABLE=2\n")
    rows = text[start:].split("\n")[1 : len(grid.V) + 1]
    assert np.array_equal([float(row.split(",")[1]) for row in rows], grid.coordinates[:, 1])


def test_nastran_files_hold_ten_digits_and_property_ids(grid, tmp_path):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / "grid.bdf"
    grid.save(path)
    lines = path.read_text().splitlines()
    temperatures = [line for line in lines if line.startswith("TEMP")]
    assert len(temperatures) == 3 * len(grid.V)
    assert float(temperatures[-1][40:56]) == pytest.approx(grid.coordinates[-1, 2], rel=1e-9)
    path.write_text("\n".join(line for line in lines if line[:4] not in ("TEMP", "*")))
    back = meshio.read(path)
    assert np.array_equal(back.cells_dict["hexahedron"], grid.H)
    assert np.allclose(back.points, grid.V, rtol=1e-9, atol=1e-9)
    ids = [int(line[16:24]) for line in lines if line.startswith("CHEXA")]
    assert np.array_equal(ids, 100 * grid.layer + grid.block + 1)


def test_a_folded_map_is_refused():
    solid = samples.solid_torus(600)
    image = solid.V.copy()
    image[5] += 2.0
    with pytest.raises(CertificationError, match="hexahedra needs a certified map") as refused:
        hex_mesh(a_map(solid, image, sm.Torus(3.0, 1.0)), n_hexahedra=100)
    assert len(refused.value.ids)


def test_other_suffixes_are_refused(grid, tmp_path):
    with pytest.raises(FileFormatError, match=r"\.bdf"):
        grid.save(tmp_path / "grid.stl")


@pytest.mark.parametrize(("least", "proven"), [(1e-3, True), (1e-5, False)])
def test_a_determinant_near_zero_along_a_plane_ends_in_time(least, proven):
    """Its parts double with every halving; what is not proven in time does not count as valid."""
    corners = []
    for x, y, z in CUBE:
        across = np.array([[x - 0.3, -least], [least, x - 0.3]]) @ [y - 0.5, z - 0.5]
        corners.append([x, *across])  # its determinant is (x - 0.3)^2 + least^2
    start = time.process_time()
    assert valid(corners) == proven
    assert time.process_time() - start < 20.0
