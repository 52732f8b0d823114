"""Data of points and cells come back from every format as they were, or are refused beforehand."""

from __future__ import annotations

import logging

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.errors import ArrayError
from stretchmap.io import read_arrays, write
from stretchmap.io.storable import medit_refs, storable

TYPES = "? i1 u1 i2 u2 i4 u4 i8 u8 f2 f4 f8".split()
NAMES = ["a label", "50%", "h%C3", 'T<300 & "x"', "höhe", "METADATA", "it's"]
BY_MESHIO = [".vtu", ".vtk", ".xdmf", ".msh"]


@pytest.fixture(scope="module")
def solid():
    return sm.TetMesh(
        np.vstack([np.zeros(3), np.eye(3), [[1, 1, 1]]]), [[0, 1, 2, 3], [4, 3, 2, 1]]
    )


@pytest.mark.parametrize("suffix", [*BY_MESHIO, ".ply"])
def test_numbers_of_every_type_keep_their_values(suffix, solid, tmp_path):
    mesh = solid.surface if suffix == ".ply" else solid
    if suffix != ".ply":
        pytest.importorskip("meshio")
    rows = len(mesh.F if suffix == ".ply" else mesh.T)
    data = {f"of_{kind}": (np.arange(rows) / 3).astype(kind) for kind in TYPES}
    data |= {"pi": np.full((rows, 3), np.float32(np.pi)), "least": np.full(rows, 5e-324)}
    write(tmp_path / f"t{suffix}", mesh, cell_data=data)
    found = read_arrays(tmp_path / f"t{suffix}").cell_data
    if suffix == ".ply":
        found["pi"] = np.stack([found[f"pi_{k}"] for k in range(3)], axis=1)
    for name, array in data.items():
        np.testing.assert_array_equal(found[name], array, err_msg=name)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".xdmf"])
def test_names_come_back(suffix, solid, tmp_path):
    pytest.importorskip("meshio")
    data = {name: np.array([k, k + 0.5]) for k, name in enumerate(NAMES)}
    write(tmp_path / f"t{suffix}", solid, cell_data=data)
    found = read_arrays(tmp_path / f"t{suffix}").cell_data
    assert list(found) == NAMES
    for name, array in data.items():
        np.testing.assert_array_equal(found[name], array)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_vtk_reads_the_same_names(suffix, solid, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    pytest.importorskip("meshio")
    write(tmp_path / f"t{suffix}", solid, cell_data=dict.fromkeys(NAMES, np.ones(2)))
    assert set(pyvista.read(tmp_path / f"t{suffix}").cell_data) == set(NAMES)


@pytest.mark.parametrize("suffix", [*BY_MESHIO, ".ply"])
def test_arrays_without_columns_are_left_out_with_a_word(suffix, solid, tmp_path, caplog):
    if suffix != ".ply":
        pytest.importorskip("meshio")
    mesh = solid.surface if suffix == ".ply" else solid
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        write(tmp_path / f"t{suffix}", mesh, {"none": np.ones((len(mesh.V), 0))})
    assert f"'none' has no columns, {suffix} files do without it" in caplog.text
    assert "none" not in read_arrays(tmp_path / f"t{suffix}").point_data


@pytest.mark.parametrize(
    ("suffix", "name", "array", "message"),
    [
        (".msh", "x", np.full(2, 2**60 + 1), "type int64 that .msh has no type for"),
        (".ply", "x", np.full(2, -(2**60) - 1), r"astype\(numpy.float64\)"),
        (".msh", "x", np.full(2, 2**64 - 1, np.uint64), "no type for"),
        (".msh", "x", np.ones((2, 2)), "2 columns, in .msh it can have 1 or 3 or 9"),
        (".xdmf", "x", np.ones((2, 4)), "4 columns"),
        (".msh", 'of "x"', np.ones(2), "rename it"),
        (".msh", "cell_tags", np.ones(2), "rename it"),
        (".msh", "gmsh:physical", np.array([0.5, 1.0]), "there are int32"),
        (".msh", "gmsh:physical", np.ones((2, 3)), "it can have 1;"),
    ],
)
def test_what_a_format_cannot_hold_is_refused(suffix, name, array, message, solid, tmp_path):
    with pytest.raises(ArrayError, match=message):
        storable(suffix, {name: array})
    if suffix == ".msh":
        with pytest.raises(ArrayError, match=message):
            write(tmp_path / "t.msh", solid, cell_data={name: array})
        assert not list(tmp_path.iterdir())


def test_numbers_of_a_wider_type_are_written_where_they_fit():
    longer = np.longdouble([0.5, np.nan])
    if longer.dtype.itemsize == 8:
        pytest.skip("no longer type here")
    assert storable(".vtu", {"x": longer})["x"].dtype == np.float64
    with pytest.raises(ArrayError, match="no type for"):
        storable(".vtu", {"x": longer + np.finfo(np.longdouble).eps})


@pytest.mark.parametrize(
    "names", [("my label", "my_label"), ("a b", "a  b"), ("v", "v_1"), ("v_1", "v")]
)
def test_two_arrays_of_one_name_in_ply_are_refused(names, solid, tmp_path):
    mesh = solid.surface
    data = {name: np.ones((len(mesh.V), 2) if name == "v" else len(mesh.V)) for name in names}
    with pytest.raises(ArrayError, match="rename one"):
        write(tmp_path / "t.ply", mesh, data)
    assert not list(tmp_path.iterdir())


REGIONS = {
    "both": {"gmsh:physical": [7, 8], "gmsh:geometrical": [1, 2]},
    "groups": {"gmsh:physical": [7, 8]},
    "entities": {"gmsh:geometrical": [3, 4]},
}


@pytest.mark.parametrize("given", REGIONS)
def test_regions_go_into_msh_and_come_back(given, solid, tmp_path):
    pytest.importorskip("meshio")
    labels = {name: np.array(values) for name, values in REGIONS[given].items()}
    write(tmp_path / "a.msh", solid, cell_data={**labels, "heat": np.array([0.5, 1.5])})
    first = read_arrays(tmp_path / "a.msh")
    again = sm.TetMesh(first.V, first.T)
    write(tmp_path / "b.msh", again, first.point_data, first.cell_data)
    found = read_arrays(tmp_path / "b.msh").cell_data
    for name, values in labels.items():
        np.testing.assert_array_equal(found[name], values)
    assert len(np.unique(found["gmsh:geometrical"])) == 2  # else Gmsh takes both for one
    np.testing.assert_array_equal(found["heat"], [0.5, 1.5])
    np.testing.assert_array_equal(again.T, solid.T)


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (["label", "gmsh:geometrical", "gmsh:physical", "medit:ref"], "medit:ref"),
        (["label", "gmsh:geometrical", "gmsh:physical"], "gmsh:physical"),
        (["parent_tet", "part"], "part"),
        (["label"], "label"),
        (["label", "other label"], None),
    ],
)
@pytest.mark.parametrize("kind", ["i8", "u1"])
def test_regions_go_into_medit_files_and_come_back(names, chosen, kind, solid, tmp_path, caplog):
    pytest.importorskip("meshio")
    regions = {name: np.array([7, 9 + k], kind) for k, name in enumerate(names)}
    data = {"heat": np.array([0.5, 1.5]), **regions}
    write(tmp_path / "a.mesh", solid, {"medit:ref": np.arange(5)}, data)
    found = read_arrays(tmp_path / "a.mesh")
    wanted = [1, 1] if chosen is None else regions[chosen]
    np.testing.assert_array_equal(found.cell_data["medit:ref"], wanted)
    np.testing.assert_array_equal(found.point_data["medit:ref"], np.arange(5))
    rest = ", ".join(repr(name) for name in data if name != chosen)
    (told,) = [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]
    assert told.endswith(f"a.mesh: .mesh files hold one array of regions; left out: {rest}")


def test_what_is_no_reference_is_left_out():
    for array in ([0.0, 1.0], [True, False], [2**31, 0], [-(2**31) - 1, 0], [[1, 2], [3, 4]]):
        assert medit_refs({"medit:ref": np.array(array)}) == ({}, ["medit:ref"])
    refs, left_out = medit_refs({"label": np.array([[-(2**31)], [2**31 - 1]])})
    np.testing.assert_array_equal(refs["medit:ref"], [-(2**31), 2**31 - 1])
    assert not left_out


@pytest.mark.parametrize("suffix", [".obj", ".off", ".stl"])
def test_formats_without_arrays_name_what_they_leave_out(suffix, solid, tmp_path, caplog):
    surface = solid.surface
    write(tmp_path / f"t{suffix}", surface)
    assert not caplog.records
    write(tmp_path / f"t{suffix}", surface, {"a": surface.V}, {"a": surface.F, "b": surface.F})
    (told,) = [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]
    assert told.endswith(f"t{suffix}: {suffix} files hold no arrays; left out: 'a', 'b'")
