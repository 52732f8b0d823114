"""Elements of higher order, quads, Gmsh's own files, and those other packages read."""

from __future__ import annotations

import logging

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.errors import FileFormatError, MissingDependencyError
from stretchmap.io import read, read_arrays
from stretchmap.io.foreign import for_vtk_alone

# Two tets of a physical group, one of none, a triangle and a point beside them; tags with gaps.
GMSH = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
1
3 7 "the bone"
$EndPhysicalNames
$Entities
1 0 1 2
9 0 0 0 0
4 0 0 0 1 1 1 0 0
1 0 0 0 1 1 1 1 7 1 4
2 0 0 0 1 1 1 0 0
$EndEntities
$Nodes
2 6 10 99
3 1 0 4
10
20
30
40
0 0 0
1 0 0
0 1 0
0 0 1
3 2 1 2
99
50
1 1 1 0 0 0
2 0 0 0 0 0
$EndNodes
$Elements
4 5 1 5
0 9 15 1
1 10
2 4 2 1
2 10 20 30
3 1 4 2
3 10 20 30 40
4 20 30 40 99
3 2 4 1
5 20 99 40 50
$EndElements
$ElementData
1
"heat"
1
0.0
3
0
1
2
4 0.5
5 1.5
$EndElementData
"""


def test_gmsh_with_groups_of_some_entities(tmp_path):
    path = tmp_path / "part.msh"
    path.write_text(GMSH)
    found = read_arrays(path)
    np.testing.assert_array_equal(found.V[4:], [[1, 1, 1], [2, 0, 0]])
    np.testing.assert_array_equal(found.T, [[0, 1, 2, 3], [1, 2, 3, 4], [1, 4, 3, 5]])
    np.testing.assert_array_equal(found.cell_data["gmsh:physical"], [7, 7, 0])
    np.testing.assert_array_equal(found.cell_data["gmsh:geometrical"], [1, 1, 2])
    np.testing.assert_array_equal(found.cell_data["heat"], [np.nan, 0.5, 1.5])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("2 6 10 99", "2 7 10 99"), "7 nodes are announced, 6 follow"),
        (("3 10 20 30 40", "3 10 20 30 41"), "not there"),
        (("\n50\n", "\n99\n"), "one tag"),
        (("4 5 1 5", "4 6 1 5"), "6 elements are announced"),
        (("3 2 4 1\n", "3 2 94 1\n"), "type 94"),
        (("$EndElements", "$End"), "within a section"),
        (("4.1 0 8\n", "4.1 1 8\n"), "another kind of machine"),
    ],
)
def test_gmsh_files_that_are_wrong(change, message, tmp_path):
    assert change[0] in GMSH
    path = tmp_path / "part.msh"
    path.write_text(GMSH.replace(*change))
    with pytest.raises(FileFormatError, match=message):
        read(path)


GMSH_2 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
5
1 0 0 0
7 1 0 0
3 0 1 0
4 0 0 1
99 1 1 1
$EndNodes
$Elements
4
1 15 2 0 9 1
2 2 2 8 2 1 7 3
3 4 2 7 1 1 7 3 4
4 4 3 5 1 0 7 3 4 99
$EndElements
"""


def test_gmsh_of_version_2(tmp_path):
    path = tmp_path / "part.msh"
    path.write_text(GMSH_2)
    found = read_arrays(path)
    np.testing.assert_array_equal(found.V[4], [1, 1, 1])
    np.testing.assert_array_equal(found.T, [[0, 1, 2, 3], [1, 2, 3, 4]])
    np.testing.assert_array_equal(found.cell_data["gmsh:physical"], [7, 5])
    path.write_text(GMSH_2.replace("99 1 1 1", "999999999 1 1 1"))
    with pytest.raises(FileFormatError, match="not there"):
        read(path)
    path.write_text(GMSH_2.replace("$Elements\n4", "$Elements\n5"))
    with pytest.raises(FileFormatError, match="part"):
        read(path)


@pytest.mark.parametrize("version", ["gmsh22", "gmsh"])
@pytest.mark.parametrize("binary", [False, True])
def test_gmsh_as_meshio_writes_it(binary, version, tmp_path):
    meshio = pytest.importorskip("meshio")
    solid = sm.samples.solid_torus(600)
    data = {"gmsh:physical": [np.arange(solid.n_tets)], "gmsh:geometrical": [np.ones(solid.n_tets)]}
    data = {name: [a.astype(np.int32) for a in parts] for name, parts in data.items()}
    mesh = meshio.Mesh(solid.V, [("tetra", solid.T)], cell_data=data)
    mesh.write(tmp_path / "t.msh", file_format=version, binary=binary)
    found = read_arrays(tmp_path / "t.msh")
    np.testing.assert_array_equal(found.V, solid.V)
    np.testing.assert_array_equal(found.T, solid.T)
    if version == "gmsh22":  # of version 4.1 entities have groups, which meshio does not write
        np.testing.assert_array_equal(found.cell_data["gmsh:physical"], np.arange(solid.n_tets))


def quadratic(solid: sm.TetMesh) -> tuple[np.ndarray, np.ndarray]:
    """Points and tets with a point in the middle of each edge, in the order of VTK."""
    pairs = np.sort(solid.T[:, [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]], axis=2)
    edges, ids = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middle = solid.V[edges].mean(axis=1)
    cells = np.hstack([solid.T, ids.reshape(-1, 6) + solid.n_vertices])
    return np.vstack([solid.V, middle]), cells


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh"])
def test_tets_of_second_order_are_taken_by_their_corners(suffix, tmp_path, caplog):
    meshio = pytest.importorskip("meshio")
    solid = sm.samples.solid_torus(600)
    points, cells = quadratic(solid)
    data = {"height": points[:, 2]} if suffix != ".msh" else {}
    mesh = meshio.Mesh(points, [("tetra10", cells)], point_data=data)
    mesh.write(tmp_path / f"t{suffix}", file_format={".msh": "gmsh"}.get(suffix, suffix[1:]))
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        found = read_arrays(tmp_path / f"t{suffix}")
    left_out = len(points) - solid.n_vertices
    assert f"{solid.n_tets} elements of higher order" in caplog.text
    assert f"{left_out} points left out" in caplog.text
    np.testing.assert_array_equal(found.V, solid.V)
    np.testing.assert_array_equal(found.T, solid.T)
    assert all(len(array) == solid.n_vertices for array in found.point_data.values())


def test_quads_of_a_surface_are_split_and_hexahedra_refused(tmp_path, caplog):
    meshio = pytest.importorskip("meshio")
    points = np.array([[x, y, 0.0] for y in range(2) for x in range(3)])
    cells = [("quad", np.array([[0, 1, 4, 3]])), ("triangle", np.array([[1, 2, 5], [1, 5, 4]]))]
    data = {"part": [np.array([7]), np.array([8, 9])]}
    meshio.Mesh(points, cells, cell_data=data).write(tmp_path / "t.vtu")
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        found = read_arrays(tmp_path / "t.vtu")
    assert "1 polygons were split into 2 triangles" in caplog.text
    np.testing.assert_array_equal(found.F, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    np.testing.assert_array_equal(found.cell_data["part"], [7, 7, 8, 9])


@pytest.mark.parametrize("name", ["t.vtp", "t.vtk"])
def test_surfaces_as_pyvista_saves_them(name, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    torus = sm.samples.torus_surface(12, 8)
    data = torus.to_pyvista()
    data.cell_data["part"] = np.arange(torus.n_faces)  # 64 bits
    data.save(tmp_path / name)
    found = read_arrays(tmp_path / name)
    np.testing.assert_array_equal(found.V, torus.V)
    np.testing.assert_array_equal(found.F, torus.F)
    np.testing.assert_array_equal(found.cell_data["part"], np.arange(torus.n_faces))
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:900])
    with pytest.raises(FileFormatError, match=name):
        read(tmp_path / name)
    assert pyvista


def test_solids_as_pyvista_saves_them(tmp_path):
    pytest.importorskip("pyvista")
    solid = sm.samples.solid_torus(600)
    data = solid.to_pyvista()
    data.cell_data["part"] = np.arange(solid.n_tets)
    for binary in (True, False):
        data.save(tmp_path / "t.vtk", binary=binary)
        found = read_arrays(tmp_path / "t.vtk")
        np.testing.assert_allclose(found.V, solid.V, atol=0 if binary else 1e-5)
        np.testing.assert_array_equal(found.T, solid.T)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_arrays_of_every_kind_as_pyvista_saves_them(suffix, tmp_path, monkeypatch, caplog):
    pytest.importorskip("pyvista")
    solid = sm.samples.solid_torus(600)
    rows = np.arange(solid.n_tets)
    kept = {f"{kind} of": (rows % 100).astype(kind) for kind in ("?", "i1", "u1", "i2", "u8", "f4")}
    data = solid.to_pyvista()
    for name, array in {**kept, "a/b": rows, "wave": rows * 1j, "text": rows.astype(str)}.items():
        data.cell_data[name] = array
    data.user_dict = {"who": "we"}
    path = tmp_path / f"t{suffix}"
    data.save(path)
    with caplog.at_level(logging.INFO, logger="stretchmap"):
        found = read_arrays(path)
    np.testing.assert_array_equal(found.T, solid.T)
    assert set(found.cell_data) == {*kept, "a/b"}
    for name, array in kept.items():
        assert found.cell_data[name].dtype == array.dtype
        np.testing.assert_array_equal(found.cell_data[name], array)
    assert "no real numbers left out: " in caplog.text
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(
        MissingDependencyError, match=rf"t{suffix} holds .*stretchmap\[viz\].* without"
    ):
        read(path)


@pytest.mark.parametrize(
    ("suffix", "data", "wanted"),
    [
        (".vtu", b"this is no mesh", "an unstructured grid in VTK's XML format"),
        (".vtk", b"\x89PNG", "in VTK's legacy format"),
        (".mesh", b"<html></html>", "in Medit's text format"),
        (".xdmf", b"<html></html>", "in the format XDMF"),
        (".msh", b"this is no mesh", "in Gmsh's format"),
    ],
)
def test_what_meshio_gives_up_on_in_silence_is_explained(suffix, data, wanted, tmp_path):
    pytest.importorskip("meshio")
    path = tmp_path / f"t{suffix}"
    path.write_bytes(data)
    message = f"{suffix} cannot be read: it is damaged, or not {wanted} as meshio reads it$"
    with pytest.raises(FileFormatError, match=message):
        read_arrays(path)


@pytest.mark.parametrize(
    ("version", "line", "found"),
    [
        (b"5.1", b"SCALARS part unsigned_char", True),
        (b"4.2", b"SCALARS part unsigned_char", False),
        (b"4.2", b"SCALARS part signed_char 1", True),
        (b"5.1", b"heat 1 4 vtktypeint64", False),
        (b"4.2", b"heat 1 4 vtktypeint64", True),
        (b"5.1", b"COLOR_SCALARS part 1", True),
        (b"5.1", b"LOOKUP_TABLE default", False),
        (b"5.1", b"LOOKUP_TABLE colors 256", True),
        (b"5.1", b"POINTS 4 double", False),
        (b"5.1", b"name 1 4 string\r", True),
        (b"5.1", b"how long", False),
        (b"5.1", b"DATASET POLYDATA", True),
    ],
)
def test_what_meshio_does_not_know_of_vtk_is_seen(version, line, found, tmp_path):
    path = tmp_path / "t.vtk"
    path.write_bytes(b"# vtk DataFile Version " + version + b"\ntitle\nBINARY\n" + line + b"\n\0")
    assert (for_vtk_alone(path) is not None) == found


@pytest.mark.parametrize("suffix", [".glb", ".3mf"])
def test_surfaces_as_trimesh_exports_them(suffix, tmp_path):
    pytest.importorskip("trimesh")
    if suffix == ".3mf":
        pytest.importorskip("lxml")
        pytest.importorskip("networkx")
    torus = sm.samples.torus_surface(12, 8)
    torus.to_trimesh().export(tmp_path / f"t{suffix}")
    mesh = read(tmp_path / f"t{suffix}")
    mesh.require_genus_one()
    assert (mesh.n_vertices, mesh.n_faces) == (torus.n_vertices, torus.n_faces)
    assert mesh.volume == pytest.approx(torus.volume, rel=1e-5)


@pytest.mark.slow
def test_a_file_vtk_reads_for_ever_is_refused(tmp_path):
    """A loop over components, two thousand million of them."""
    pytest.importorskip("pyvista")
    path = tmp_path / "a.vtp"
    sm.samples.torus_surface(8, 6).to_pyvista().save(path)
    text = path.read_bytes()
    assert text.count(b'NumberOfComponents="3"') >= 1
    path.write_bytes(text.replace(b'NumberOfComponents="3"', b'NumberOfComponents="2147483648"', 1))
    with pytest.raises(FileFormatError, match="does not come to an end"):
        read(path)
