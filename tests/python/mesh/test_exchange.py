"""Meshes and fields go to PyVista, trimesh and meshio and come back bit for bit."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import shapes
import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import FileFormatError, KindError, MissingDependencyError
from stretchmap.io import read_arrays
from stretchmap.mesh.given import as_mesh, as_solid, as_surface


@pytest.fixture
def surface() -> sm.TriMesh:
    points, faces = shapes.torus()
    return sm.TriMesh(points / 3, faces)


@pytest.fixture
def solid() -> sm.TetMesh:
    points, tets = shapes.cubes(shapes.RING)
    return sm.TetMesh(points / 3, tets)


def same(first, second) -> None:
    assert type(first) is type(second)
    np.testing.assert_array_equal(first.V, second.V)
    key = "T" if isinstance(first, sm.TetMesh) else "F"
    np.testing.assert_array_equal(getattr(first, key), getattr(second, key))


@pytest.mark.parametrize("library", ["pyvista", "trimesh", "meshio"])
def test_a_surface_goes_and_comes_back(library, surface):
    pytest.importorskip(library)
    there = getattr(surface, f"to_{library}")()
    same(getattr(sm, f"from_{library}")(there), surface)
    same(as_surface(there), surface)
    same(as_mesh(there), surface)


@pytest.mark.parametrize("library", ["pyvista", "meshio"])
def test_a_solid_goes_and_comes_back(library, solid):
    pytest.importorskip(library)
    there = getattr(solid, f"to_{library}")()
    same(getattr(sm, f"from_{library}")(there), solid)
    same(as_solid(there), solid)


def test_what_goes_out_is_a_copy(surface):
    pytest.importorskip("meshio")
    there = surface.to_meshio()
    there.points[0] = 7.0
    assert not (surface.V[0] == 7.0).any()


def test_pairs_are_taken(surface, solid):
    same(as_surface((surface.V, surface.F)), surface)
    same(as_solid((solid.V.tolist(), solid.T.tolist())), solid)
    with pytest.raises(KindError, match="TriMesh was given"):
        as_solid((surface.V, surface.F))


def test_maps_take_them_all(surface, solid):
    pyvista = pytest.importorskip("pyvista")
    basis = sm.homology_basis(pyvista.PolyData.from_regular_faces(surface.V, surface.F))
    assert basis.genus == 1
    assert sm.distortion((solid.V, solid.T), solid.V).flips == 0
    mapped = sm.volume_map(samples.solid_torus(600).to_pyvista())
    assert mapped.certificate.certified


def test_fields_of_a_map_go_along():
    pytest.importorskip("pyvista")
    pytest.importorskip("trimesh")
    pytest.importorskip("meshio")
    result = sm.volume_map(samples.solid_torus(600))
    u, v, s = result.coordinates().T
    for there in (result.to_pyvista(), result.to_meshio()):
        for name, values in (("u", u), ("v", v), ("s", s), ("image", result.image)):
            np.testing.assert_array_equal(there.point_data[name], values)
        np.testing.assert_array_equal(there.point_data["cos_u"] ** 2, np.cos(u) ** 2)
    np.testing.assert_array_equal(result.to_pyvista().cell_data["ratio"], result.distortion.ratios)
    parts = sm.partition(result, 2)
    np.testing.assert_array_equal(parts.to_pyvista().cell_data["part"], parts.labels)
    grid = sm.hex_mesh(result, sections=12, block=2, rings=1)
    there = grid.to_pyvista()
    np.testing.assert_array_equal(there.cells_dict[12], grid.H)
    np.testing.assert_array_equal(there.points, grid.V)
    with pytest.raises(KindError, match="triangles only"):
        grid.to_trimesh()


def every_kind(rng, n):
    whole = {f"{t}{b}": rng.integers(0, 100, n).astype(f"{t}{b}") for t in "iu" for b in (1, 4, 8)}
    reals = {f"f{b}": rng.normal(size=n).astype(f"f{b}") for b in (4, 8)}
    vectors = {f"v{t}": rng.normal(size=(n, 3)).astype(t) for t in ("f4", "f8", "i4")}
    odd = {"least": np.full(n, 5e-324), "zero": np.full(n, -0.0), "nine": rng.normal(size=(n, 9))}
    return whole | reals | vectors | odd


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("library", ["pyvista", "trimesh", "meshio"])
def test_fields_of_every_kind_go_out_bit_by_bit(library, seed):
    pytest.importorskip(library)
    rng = np.random.default_rng(seed)
    mesh = sm.samples.torus_surface(12, 7)
    points, cells = every_kind(rng, mesh.n_vertices), every_kind(rng, mesh.n_faces)
    result = sm.area_map(mesh).with_fields(points, cells)
    out = getattr(result, f"to_{library}")()
    if library == "trimesh":
        found = out.vertex_attributes, out.face_attributes
    elif library == "pyvista":
        found = out.point_data, out.cell_data
    else:
        found = out.point_data, {name: parts[0] for name, parts in out.cell_data.items()}
    for ours, theirs in zip((points, cells), found, strict=True):
        for name, array in ours.items():
            there = np.asarray(theirs[name])
            assert (there.dtype, there.shape) == (array.dtype, array.shape), name
            assert there.tobytes() == array.tobytes(), name


@pytest.mark.parametrize("suffix", [".npz", ".vtu", ".vtk"])
def test_fields_of_every_kind_come_back_from_files_bit_by_bit(suffix, tmp_path):
    pytest.importorskip("meshio")
    rng = np.random.default_rng(3)
    solid = sm.samples.solid_torus(500)
    points = every_kind(rng, solid.n_vertices)
    cells = {f"of_tets_{name}": array for name, array in every_kind(rng, solid.n_tets).items()}
    sm.write(tmp_path / f"a{suffix}", solid, points, cells)
    found = sm.io.read_arrays(tmp_path / f"a{suffix}")
    for ours, theirs in ((points, found.point_data), (cells, found.cell_data)):
        for name, array in ours.items():
            assert theirs[name].dtype == array.dtype, name
            assert theirs[name].tobytes() == array.tobytes(), name


def test_other_cells_and_objects_are_refused(surface):
    pyvista = pytest.importorskip("pyvista")
    with pytest.raises(KindError, match="1 hexahedron; only triangles and tets"):
        sm.from_pyvista(pyvista.UnstructuredGrid({12: np.arange(8)[None]}, np.eye(8, 3)))
    for convert in (sm.from_pyvista, sm.from_trimesh, sm.from_meshio):
        with pytest.raises(KindError, match="is needed"):
            convert(surface)


POINTS = np.vstack([np.zeros(3), np.eye(3), [[1, 1, 1]], np.random.default_rng(0).random((12, 3))])
TETS = [[0, 1, 2, 3], [4, 3, 2, 1]]
# Cells by VTK's number and meshio's name, None where it has none; and the elements they are.
CELLS = {
    "tets": ([(10, "tetra", TETS)], TETS),
    "second order": ([(24, "tetra10", [[0, 1, 2, 3, *range(5, 11)]])], TETS[:1]),
    "any order": ([(71, "VTK_LAGRANGE_TETRAHEDRON", [[0, 1, 2, 3, *range(5, 11)]])], TETS[:1]),
    "and a point": ([(10, "tetra", TETS), (1, "vertex", [[0]])], TETS),
    "and a line": ([(3, "line", [[0, 1]]), (10, "tetra", TETS)], TETS),
    "and a polyline": ([(10, "tetra", TETS), (4, None, [[0, 1, 2]])], TETS),
    "and a face": ([(5, "triangle", [[1, 2, 3]]), (10, "tetra", TETS)], TETS),
    "faces of second order": ([(22, "triangle6", [[*range(6)]])], [[0, 1, 2]]),
    "polygons": (
        [(5, "triangle", [[1, 2, 4]]), (9, "quad", [[0, 1, 2, 3]]), (7, "polygon", [[*range(5)]])],
        [[1, 2, 4], [0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 3, 4]],
    ),
    "hexahedra": ([(10, "tetra", TETS), (12, "hexahedron", [[*range(8)]])], None),
    "no faces": ([(3, "line", [[0, 1]])], None),
}


@pytest.mark.parametrize("name", CELLS)
def test_cells_are_taken_alike_from_objects_and_files(name, tmp_path):
    pyvista, meshio = pytest.importorskip("pyvista"), pytest.importorskip("meshio")
    given, wanted = CELLS[name]
    rows = [row for _, _, block in given for row in block]
    types = np.repeat([kind for kind, _, _ in given], [len(block) for _, _, block in given])
    cells = np.concatenate([[len(row), *row] for row in rows])
    grid = pyvista.UnstructuredGrid(cells, types.astype(np.uint8), POINTS)
    grid.save(tmp_path / "a.vtu")
    found = [lambda: sm.from_pyvista(grid), lambda: sm.read(tmp_path / "a.vtu")]
    if all(kind for _, kind, _ in given):
        there = meshio.Mesh(POINTS, [(kind, np.array(block)) for _, kind, block in given])
        found.append(lambda: sm.from_meshio(there))
    for make in found:
        if wanted is None:
            with pytest.raises((KindError, FileFormatError), match="triangles and"):
                make()
            continue
        mesh = make()
        ids = mesh.T if isinstance(mesh, sm.TetMesh) else mesh.F
        corners, expected = mesh.V[ids].tolist(), POINTS[np.array(wanted)].tolist()
        assert sorted(corners) == sorted(expected)
        assert (mesh.n_vertices < len(POINTS)) == ("order" in name)


def test_surfaces_of_pyvista_with_points_and_lines_beside_the_faces():
    pyvista = pytest.importorskip("pyvista")
    there = pyvista.PolyData(POINTS[:5], faces=[3, 0, 1, 2, 4, 0, 1, 3, 4], verts=[1, 4])
    assert sm.from_pyvista(there).F.tolist() == [[0, 1, 2], [0, 1, 3], [0, 3, 4]]
    with pytest.raises(KindError, match="no triangles and no tets"):
        sm.from_pyvista(pyvista.PolyData(POINTS))


def test_ids_of_meshio_that_are_whole_numbers_are_taken():
    meshio = pytest.importorskip("meshio")
    there = meshio.Mesh(POINTS, [("tetra", np.array(TETS, float))])
    assert sm.from_meshio(there).T.tolist() == TETS
    faces = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]]
    there = meshio.Mesh(POINTS, [("polyhedron4", [[np.array(face) for face in faces]])])
    with pytest.raises(KindError, match="1 polyhedron4; only"):
        sm.from_meshio(there)


def test_a_missing_library_is_named(surface, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MissingDependencyError, match=r"stretchmap\[interop\]"):
        surface.to_trimesh()


def test_files_for_viewers_carry_the_coordinates(tmp_path):
    pytest.importorskip("meshio")
    result = sm.volume_map(samples.solid_torus(600))
    u, v, s = result.coordinates().T
    wanted = {"u": u, "v": v, "s": s, "cos_u": np.cos(u), "sin_u": np.sin(u)}
    wanted |= {"cos_v": np.cos(v), "sin_v": np.sin(v), "image": result.image}
    result.save(tmp_path / "map.vtu")
    sm.morph(result, 2).save(tmp_path / "morph.pvd")
    for name in ("map.vtu", "morph_001.vtu"):
        found = read_arrays(tmp_path / name)
        for field, values in wanted.items():
            np.testing.assert_array_equal(found.point_data[field], values)
        np.testing.assert_array_equal(found.cell_data["ratio"], result.distortion.ratios)
