"""Files: round trips, the traps of each format, and that no file brings the process down."""

from __future__ import annotations

import logging
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest

import shapes
from stretchmap.errors import (
    ArrayError,
    FileFormatError,
    IndexRangeError,
    KindError,
    MissingDependencyError,
    NonFiniteError,
)
from stretchmap.io import read, read_arrays, read_solid, read_surface, write, writing
from stretchmap.io.npz import save_npz
from stretchmap.mesh.meshes import TetMesh, TriMesh

SURFACE = [".npz", ".obj", ".off", ".ply", ".stl", ".msh", ".vtu", ".vtk", ".mesh", ".xdmf"]
SOLID = [".npz", ".msh", ".vtu", ".vtk", ".mesh", ".xdmf"]
THROUGH_MESHIO = {".msh", ".vtu", ".vtk", ".mesh", ".xdmf"}


def need(suffix: str) -> None:
    if suffix in THROUGH_MESHIO:
        pytest.importorskip("meshio", reason=f"{suffix} goes through meshio")


@pytest.fixture
def surface() -> TriMesh:
    points, faces = shapes.torus()
    return TriMesh(points / 3, faces)


@pytest.fixture
def solid() -> TetMesh:
    points, tets = shapes.cubes(shapes.RING)
    return TetMesh(points / 3, tets)


@pytest.mark.parametrize("suffix", SURFACE)
def test_surface_comes_back(suffix, surface, tmp_path):
    need(suffix)
    path = tmp_path / f"torus{suffix}"
    write(path, surface)
    back = read(path)
    assert isinstance(back, TriMesh)
    assert sorted(p.name for p in tmp_path.iterdir()) == [path.name]
    if suffix == ".stl":  # no indices, single precision
        np.testing.assert_allclose(back.V[back.F], surface.V[surface.F], atol=1e-7)
        back.require_genus_one()
    else:
        np.testing.assert_array_equal(back.V, surface.V)
        np.testing.assert_array_equal(back.F, surface.F)


@pytest.mark.parametrize("suffix", SOLID)
def test_solid_comes_back_with_its_data(suffix, solid, tmp_path, capfd):
    need(suffix)
    path = tmp_path / f"ring{suffix.upper()}"
    rng = np.random.default_rng(1)
    points = {"image": rng.random((solid.n_vertices, 3)), "h": rng.random(solid.n_vertices)}
    cells = {"ratio": rng.random(solid.n_tets)}
    write(path, solid, points, cells)
    back = read(path)
    assert isinstance(back, TetMesh)
    np.testing.assert_array_equal(back.V, solid.V)
    np.testing.assert_array_equal(back.T, solid.T)
    if suffix != ".mesh":
        found = read_arrays(path)
        for name, array in points.items():
            np.testing.assert_array_equal(np.ravel(found.point_data[name]), array.ravel())
        np.testing.assert_array_equal(np.ravel(found.cell_data["ratio"]), cells["ratio"])
    assert capfd.readouterr() == ("", "")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("name", ["x", "z", "höhe"])
def test_ply_refuses_names_it_has_for_the_mesh(surface, tmp_path, name):
    with pytest.raises(ArrayError, match="rename it"):
        write(tmp_path / "t.ply", surface, point_data={name: surface.V[:, 0]})
    with pytest.raises(ArrayError, match="rename it"):
        both = {"vertex_indices": surface.V[:, 0]}, {"vertex_indices": surface.face_areas}
        write(tmp_path / "t.ply", surface, *both)
    assert not list(tmp_path.iterdir())
    write(tmp_path / "t.ply", surface, point_data={"xy": surface.V[:, 0]})
    assert set(read_arrays(tmp_path / "t.ply").point_data) == {"xy"}


def test_ply_keeps_scalars_and_splits_vectors(surface, tmp_path):
    path = tmp_path / "t.ply"
    ratios = np.linspace(0, 1, surface.n_faces)
    image = np.random.default_rng(0).random((surface.n_vertices, 3))
    write(path, surface, {"image": image, "mark": image[:, 0] > 0.5}, {"ratio": ratios})
    found = read_arrays(path)
    columns = np.stack([found.point_data[f"image_{k}"] for k in range(3)], axis=1)
    np.testing.assert_array_equal(columns, image)
    np.testing.assert_array_equal(found.point_data["mark"], image[:, 0] > 0.5)
    np.testing.assert_array_equal(found.cell_data["ratio"], ratios)


def test_npz_sorts_arrays_by_their_rows(surface, tmp_path):
    path = tmp_path / "t.npz"
    image, ratios = np.zeros((surface.n_vertices, 3)), np.ones(surface.n_faces)
    write(path, surface, {"image": image}, {"ratio": ratios})
    with np.load(path) as stored:
        assert set(stored) == {"V", "F", "image", "ratio"}
        everything = dict(stored)
    np.savez(path, meta=np.array("text"), **everything)
    found = read_arrays(path)
    assert (set(found.point_data), set(found.cell_data)) == ({"image"}, {"ratio"})
    assert set(found.extra) == {"meta"}


def test_obj_with_a_seam(surface, tmp_path):
    """One vertex, several texture coordinates: what every cut torus has."""
    uv = np.random.default_rng(3).random((surface.n_faces, 3, 2))
    path = tmp_path / "t.obj"
    write(path, surface, corner_uv=uv)
    found = read_arrays(path)
    np.testing.assert_array_equal(found.F, surface.F)
    np.testing.assert_array_equal(found.corner_uv, uv)


def test_obj_as_others_write_it(tmp_path):
    path = tmp_path / "t.obj"
    path.write_bytes(
        b"# made by hand\r\nmtllib x.mtl\r\no part\r\nv 0 0 0 0.5 0.5 0.5\r\nv 1 0 0 1 1 1\r\n"
        b"v 0 1 0 1 1 1\r\nv\t0 0 \\\r\n1 1 1 1\r\nvn 0 0 1\r\ng a\r\ns off\r\n"
        b"f 1//1 3//1 2//1\r\nf -4 -3 -1 # the last three\r\n  f 2/ 3/ 4/\r\n"
    )
    found = read_arrays(path)
    np.testing.assert_array_equal(found.V, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    np.testing.assert_array_equal(found.F, [[0, 2, 1], [0, 1, 3], [1, 2, 3]])
    assert found.corner_uv is None


def test_off_as_others_write_it(tmp_path):
    path = tmp_path / "t.off"
    path.write_text(
        "COFF # colours\n\n3 1  0\n0 0 0 255 0 0\n1 0 0 1 1 1 # c\n0 1 0 2 2 2\n3  0 1 2  9\n"
    )
    found = read_arrays(path)
    np.testing.assert_array_equal(found.V, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(found.F, [[0, 1, 2]])


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_as_others_write_it(order, tmp_path):
    """Extra elements before and after, flags and lists beside the corners, either byte order."""
    header = (
        f"ply\r\nformat {order} 1.0\r\ncomment c\r\nelement camera 1\r\nproperty short id\r\n"
        "element vertex 3\r\nproperty uchar red\r\nproperty float x\r\nproperty float y\r\n"
        "property float z\r\nelement face 2\r\nproperty uchar flag\r\n"
        "property list uchar uint vertex_index\r\nproperty list uchar float texcoord\r\n"
        "element edge 1\r\nproperty int a\r\nend_header\r\n"
    ).encode()
    sign = {"binary_big_endian": ">", "binary_little_endian": "<"}.get(order)
    if sign is None:
        body = b"7\n9 0 0 0\n9 1 0 0\n9 0 1 0.5\n1 3 0 1 2 2 .5 .5\n0 3 2 1 0 2 .25 1\n4\n"
    else:
        vertex = np.zeros(3, [("r", "u1"), ("p", sign + "f4", 3)])
        vertex["r"], vertex["p"] = 9, [[0, 0, 0], [1, 0, 0], [0, 1, 0.5]]
        layout = [("f", "u1"), ("n", "u1"), ("i", sign + "u4", 3), ("k", "u1")]
        face = np.zeros(2, [*layout, ("t", sign + "f4", 2)])
        face["f"], face["n"], face["i"], face["k"] = [1, 0], 3, [[0, 1, 2], [2, 1, 0]], 2
        body = np.array([7], sign + "i2").tobytes() + vertex.tobytes() + face.tobytes() + b"abcd"
    path = tmp_path / "t.ply"
    path.write_bytes(header + body)
    found = read_arrays(path)
    np.testing.assert_array_equal(found.V, [[0, 0, 0], [1, 0, 0], [0, 1, 0.5]])
    np.testing.assert_array_equal(found.F, [[0, 1, 2], [2, 1, 0]])
    np.testing.assert_array_equal(found.point_data["red"], [9, 9, 9])
    np.testing.assert_array_equal(found.cell_data["flag"], [1, 0])
    assert read(path).V.dtype.isnative


def test_text_stl_is_welded(tmp_path):
    points, faces = shapes.torus(6, 5)
    facets = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist())
        + " endloop\nendfacet\n"
        for corners in points[faces]
    )
    path = tmp_path / "t.stl"
    path.write_text(f"solid t\n{facets}endsolid t\n")
    mesh = read(path)
    assert (mesh.n_vertices, mesh.n_faces) == (len(points), len(faces))
    mesh.require_genus_one()


def test_big_endian_vtk(solid, tmp_path):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / "t.vtk"
    meshio.Mesh(solid.V, [("tetra", solid.T)]).write(path, file_format="vtk42", binary=True)
    mesh = read(path)
    assert mesh.V.dtype == np.float64 and mesh.V.dtype.isnative
    np.testing.assert_array_equal(mesh.T, solid.T)
    mesh.require_solid_torus()


def test_files_read_in_two_threads_leave_standard_output_and_warnings_alone(tmp_path, monkeypatch):
    meshio = pytest.importorskip("meshio")
    started, overlapped, done = (threading.Event() for _ in range(3))

    def first(path):
        started.set()
        overlapped.wait(0.1)
        raise ValueError

    def second(path):
        overlapped.set()
        done.wait(10.0)
        raise ValueError

    def attempt(name, reader):
        (tmp_path / name).write_text("something")
        monkeypatch.setitem(meshio._helpers.reader_map, name.split(".")[1], reader)
        with pytest.raises(FileFormatError):
            read(tmp_path / name)

    before = sys.stdout, sys.stderr, list(warnings.filters)
    other = threading.Thread(target=lambda: (started.wait(10.0), attempt("a.vtk", second)))
    other.start()
    attempt("a.vtu", first)
    done.set()
    other.join()
    after = sys.stdout, sys.stderr, list(warnings.filters)
    sys.stdout, sys.stderr, warnings.filters[:] = before
    assert after == before


def test_what_meshio_prints_is_logged_and_what_others_print_is_printed(
    tmp_path, monkeypatch, capsys, caplog
):
    meshio = pytest.importorskip("meshio")

    def reader(path):
        meshio._common.warn("ours")
        other = threading.Thread(target=lambda: (print("theirs"), meshio._common.warn("their own")))
        other.start()
        other.join()
        raise ValueError

    monkeypatch.setitem(meshio._helpers.reader_map, "vtu", reader)
    (tmp_path / "a.vtu").write_text("something")
    with caplog.at_level(logging.DEBUG, logger="stretchmap"), pytest.raises(FileFormatError):
        read(tmp_path / "a.vtu")
    printed = capsys.readouterr()
    assert printed.out == "theirs\n"
    assert "their own" in printed.err and "ours" not in printed.err
    assert "meshio: Warning: ours" in caplog.text


UNSIGNED = """<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">
0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
<Cells><DataArray type="UInt64" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="UInt64" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10</DataArray></Cells>
</Piece></UnstructuredGrid></VTKFile>
"""


def test_vertex_ids_of_any_type_are_read(tmp_path):
    pytest.importorskip("meshio")
    path = tmp_path / "a.vtu"
    path.write_text(UNSIGNED)
    assert read_arrays(path).T.tolist() == [[0, 1, 2, 3]]
    assert read(path).n_tets == 1
    path.write_text(
        UNSIGNED.replace('"UInt64" Name="c', '"Float64" Name="c').replace("2 3<", "2.5 3<")
    )
    with pytest.raises(FileFormatError, match="by fractions"):
        read(path)


def test_tets_win_over_triangles_and_other_cells_are_named(solid, tmp_path):
    meshio = pytest.importorskip("meshio")
    triangles = solid.boundary_vertices[solid.surface.F]
    path = tmp_path / "t.vtu"
    lines = ("line", np.array([[0, 1]]))
    meshio.Mesh(solid.V, [("triangle", triangles), lines, ("tetra", solid.T)]).write(path)
    mesh = read(path)
    assert isinstance(mesh, TetMesh)
    np.testing.assert_array_equal(mesh.T, solid.T)
    cube = ("hexahedron", np.arange(8)[None])
    meshio.Mesh(np.random.default_rng(0).random((40, 3)), [("tetra", solid.T), cube]).write(path)
    with pytest.raises(FileFormatError, match="1 hexahedron"):
        read(path)
    meshio.Mesh(solid.V, [lines]).write(path)
    with pytest.raises(FileFormatError, match="no triangles and no tets"):
        read(path)


def test_compact_and_orient_on_reading(tmp_path):
    points, tets = shapes.cubes(shapes.RING)
    path = tmp_path / "t.npz"
    turned = tets.copy()
    turned[:5] = tets[:5][:, [1, 0, 2, 3]]
    np.savez(path, V=np.vstack([points, [[9, 9, 9]]]), T=turned)
    assert read(path).n_vertices == len(points) + 1
    mesh = read(path, orient=True, compact=True)
    np.testing.assert_array_equal(mesh.V, points)
    mesh.require_solid_torus()


def test_solid_into_a_surface_format_is_refused(solid, tmp_path):
    for suffix in (".obj", ".off", ".ply", ".stl"):
        with pytest.raises(FileFormatError, match=r"mesh\.surface"):
            write(tmp_path / f"t{suffix}", solid)
    assert not list(tmp_path.iterdir())


def test_a_failed_write_leaves_the_old_file(surface, tmp_path, monkeypatch):
    path = tmp_path / "t.off"
    path.write_text("precious")

    def fail(file, mesh):
        file.write(b"half")
        raise OSError("disk full")

    monkeypatch.setitem(writing._WRITERS, ".off", fail)
    with pytest.raises(OSError, match="disk full"):
        write(path, surface)
    assert path.read_text() == "precious"
    assert [p.name for p in tmp_path.iterdir()] == ["t.off"]


@pytest.mark.parametrize(
    "data",
    [{"a": np.zeros(3)}, {"a": np.array(["x"] * 96)}, {"a": 1.0}, {"a": np.zeros((96, 2, 2))}],
)
def test_bad_data_arrays_are_refused(data, surface, tmp_path):
    with pytest.raises(ArrayError, match="'a'"):
        write(tmp_path / "t.npz", surface, data)
    with pytest.raises(ArrayError, match="two arrays named"):
        write(tmp_path / "t.npz", surface, {"V": surface.V})
    assert not list(tmp_path.iterdir())


def test_formats_without_arrays_say_so(surface, tmp_path, caplog):
    with caplog.at_level(logging.INFO, logger="stretchmap"):
        write(tmp_path / "t.off", surface, {"height": surface.V[:, 2]})
    assert "height" in caplog.text


def test_without_meshio(surface, solid, tmp_path, monkeypatch):
    """Surfaces and .npz need no extra; the others name the pip line."""
    monkeypatch.setitem(sys.modules, "meshio", None)
    for suffix in (".npz", ".obj", ".off", ".ply", ".stl"):
        write(tmp_path / f"t{suffix}", surface)
        read(tmp_path / f"t{suffix}")
    (tmp_path / "t.vtu").write_text("<VTKFile/>")
    with pytest.raises(MissingDependencyError, match=r"pip install 'stretchmap\[io\]'"):
        read(tmp_path / "t.vtu")
    with pytest.raises(MissingDependencyError, match=r"pip install 'stretchmap\[io\]'"):
        write(tmp_path / "new.vtu", solid)
    assert not (tmp_path / "new.vtu").exists()


@pytest.mark.parametrize("name", ["x.foo", "x", "x.tar.gz"])
def test_unknown_suffix(name, surface, tmp_path):
    for action in (lambda p: read(p), lambda p: write(p, surface)):
        with pytest.raises(FileFormatError, match=r"unknown format.*\.npz"):
            action(tmp_path / name)


def test_operating_system_errors_stay_what_they_are(surface, tmp_path):
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "absent.obj")
    with pytest.raises(FileNotFoundError, match="no such folder"):
        write(tmp_path / "absent" / "t.obj", surface)


def test_defects_in_files_keep_their_own_error(tmp_path):
    path = tmp_path / "t.obj"
    path.write_text("v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(NonFiniteError):
        read(path)
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n")
    with pytest.raises(IndexRangeError):
        read(path)
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2\n")
    with pytest.raises(FileFormatError, match="not a face: 'f 1 2'"):
        read(path)


# Runs in a process of its own: an exit, a crash or an endless loop must fail this test alone.
_ABUSE = """
import sys, warnings
import numpy as np
from pathlib import Path
from stretchmap.errors import StretchmapError
from stretchmap.io import read
warnings.simplefilter("error")
outcomes = {}
for path in sorted(Path(sys.argv[1]).iterdir()):
    data = path.read_bytes()
    rng = np.random.default_rng(len(data))
    cuts = sorted({0, 1, 2, 5, *rng.integers(0, len(data), int(sys.argv[2])).tolist()})
    bad = [data[:cut] for cut in cuts]
    bad += [b"\\n" * 50, b"solid", rng.bytes(300), b"ply\\nformat ascii 1.0\\n"]
    bad += [b"OFF\\n", b"\\xff" * 90]
    bad += [data[:cut] + rng.bytes(8) + data[cut + 8:] for cut in cuts[-8:]]
    target = path.with_name("bad" + path.suffix)
    for content in bad:
        target.write_bytes(content)
        try:
            read(target)
            kind = "read"
        except StretchmapError as error:
            assert str(error).strip()
            kind = "refused"
        except RuntimeWarning as error:
            kind = "refused"
        outcomes[path.suffix, kind] = outcomes.get((path.suffix, kind), 0) + 1
    target.unlink()
for (suffix, kind), count in outcomes.items():
    print(suffix, kind, count)
"""


@pytest.mark.parametrize("kind", ["surface", "solid"])
def test_damaged_files_are_refused_and_nothing_worse(kind, surface, solid, tmp_path):
    folder = tmp_path / "files"
    folder.mkdir()
    mesh, names = (surface, SURFACE) if kind == "surface" else (solid, SOLID)
    for suffix in names:
        need(suffix)
        write(folder / f"good{suffix}", mesh)
    run = subprocess.run(
        [sys.executable, "-c", _ABUSE, str(folder), "25"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    refused = {line.split()[0]: int(line.split()[2]) for line in run.stdout.splitlines()
               if line.split()[1] == "refused"}  # fmt: skip
    assert set(refused) == set(names)
    assert all(count >= 10 for count in refused.values()), run.stdout


def test_reads_the_test_meshes(mesh_dir: Path, load_surface, load_solid):
    bob = read(mesh_dir / "surfaces" / "bob.ply")
    np.testing.assert_array_equal(bob.V, load_surface("bob").V)
    np.testing.assert_array_equal(bob.F, load_surface("bob").F)
    pytest.importorskip("meshio")
    arm = read(mesh_dir / "tets" / "rocker_arm_small.vtu")
    np.testing.assert_array_equal(arm.T, load_solid("rocker_arm_small").T)
    np.testing.assert_array_equal(arm.V, load_solid("rocker_arm_small").V)


def test_compressed_files_are_read_by_numpy(tmp_path):
    """Slices smaller than an array leave the file what numpy would have written."""
    arrays = {"a": np.random.default_rng(0).normal(size=(300_000, 3)), "b": np.arange(5)[::2]}
    with open(tmp_path / "a.npz", "wb") as file:
        save_npz(file, arrays)
    with np.load(tmp_path / "a.npz") as loaded:
        assert loaded.files == ["a", "b"]
        assert all(np.array_equal(loaded[name], array) for name, array in arrays.items())


def test_readers_of_one_kind(tmp_path, surface):
    solid = TetMesh(*shapes.cubes(shapes.RING))
    write(tmp_path / "solid.npz", solid)
    write(tmp_path / "surface.npz", surface)
    assert np.array_equal(read_solid(tmp_path / "solid.npz").T, solid.T)
    assert np.array_equal(read_surface(tmp_path / "surface.npz").F, surface.F)
    with pytest.raises(KindError, match=r"solid\.npz.*\.surface"):
        read_surface(tmp_path / "solid.npz")
    with pytest.raises(KindError, match=r"surface\.npz.*tetrahedralize"):
        read_solid(tmp_path / "surface.npz")
