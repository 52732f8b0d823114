"""Fields of the input go with a map into its files and its frames, and maps come back from files
for viewers."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import shapes
import stretchmap as sm
from stretchmap.cli import main
from stretchmap.errors import ArrayError, FileFormatError
from stretchmap.io import read_arrays
from stretchmap.maps.writing import require_storable

pytest.importorskip("meshio")

VIEWERS = [".vtu", ".vtk", ".xdmf"]


@pytest.fixture(scope="module")
def coarse() -> sm.VolumeMap:
    """Of a solid with interior edges that have to be split."""
    result = sm.volume_map(sm.TetMesh(*shapes.cubes(shapes.RING)), keep_best=True)
    assert result.refinement is not None and result.refinement.n_split > 0
    return result


def given(result: sm.VolumeMap) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    n = result.mesh.n_vertices - result.refinement.n_split
    k = int(result.refinement.parent_tet[-1]) + 1
    V = result.mesh.V[:n]
    return (
        {"height": V[:, 2], "label": np.arange(n), "load": 2.0 * V},
        {"gmsh:physical": np.arange(k) % 3, "density": np.linspace(0.0, 1.0, k)},
    )


def test_fields_named_like_those_of_a_map_are_left_out_aloud(coarse, caplog):
    carried = coarse.with_fields({"u": coarse.mesh.V[:, 0], "load": coarse.mesh.V[:, 1]})
    assert set(carried.point_fields) == {"load"}
    assert "left out: u; give them other names" in caplog.text


def test_names_with_slashes_are_those_with_underscores(coarse, caplog):
    x = coarse.mesh.V[:, 0]
    carried = coarse.with_fields({"a/b": x}, {"a_b": x[coarse.mesh.T[:, 0]]})
    assert set(carried.point_fields) == set(carried.cell_fields) == {"a_b"}
    for names in (("a/b", "a_b"), ("a_b", "a/b"), ("point:a", "a")):
        with pytest.raises(ArrayError, match=f"{names[0]!r} and {names[1]!r} would both be a"):
            coarse.with_fields(dict.fromkeys(names, x))
    assert not coarse.with_fields({"grad/u": x}).point_fields
    assert "left out: grad_u; give them other names" in caplog.text


def test_fields_are_added_to_those_there_as_copies(coarse):
    x, y = coarse.mesh.V[:, 0].copy(), np.arange(coarse.mesh.n_tets)
    carried = coarse.with_fields({"x": x, "load": x}).with_fields({"load": 2.0 * x}, {"y": y})
    assert set(carried.point_fields) == {"x", "load"} and set(carried.cell_fields) == {"y"}
    x[:], y[:] = 7.0, 7
    np.testing.assert_array_equal(carried.point_fields["x"], coarse.mesh.V[:, 0])
    np.testing.assert_array_equal(carried.point_fields["load"], 2.0 * coarse.mesh.V[:, 0])
    np.testing.assert_array_equal(carried.cell_fields["y"], np.arange(coarse.mesh.n_tets))
    assert not carried.point_fields["load"].flags.writeable


@pytest.mark.parametrize(
    "again", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))], ids=["copied", "pickled"]
)
def test_copies_of_results_are_as_read_only_as_they_are(coarse, again):
    result = again(coarse.with_fields({"x": coarse.mesh.V[:, 0]}))
    np.testing.assert_array_equal(result.image, coarse.image)
    inside = (result.image, result.mesh.V, result.point_fields["x"], result.refinement.parent_tet)
    distortion = again(coarse.distortion)  # results have arrays beside maps, too
    for array in (*inside, result.boundary_map.image, result.distortion.ratios, distortion.ratios):
        assert not array.flags.writeable


def test_added_vertices_and_tets_inherit(coarse):
    points, cells = given(coarse)
    carried = coarse.with_fields(points, cells)
    np.testing.assert_allclose(carried.point_fields["load"], 2.0 * coarse.mesh.V, atol=1e-12)
    np.testing.assert_array_equal(
        carried.cell_fields["gmsh:physical"], coarse.refinement.parent_tet % 3
    )
    labels = carried.point_fields["label"]
    assert labels.dtype.kind == "i"
    ends = coarse.refinement.parents
    n = len(points["label"])
    np.testing.assert_array_equal(labels[n : n + len(ends)], ends[:, 0])
    assert coarse.point_fields == {}


@pytest.mark.parametrize("suffix", [".npz", *VIEWERS])
def test_fields_come_back_from_files(suffix, coarse, tmp_path):
    if suffix == ".xdmf":
        pytest.importorskip("h5py")
    carried = coarse.with_fields(*given(coarse))
    path = tmp_path / f"map{suffix}"
    carried.save(path)
    loaded = sm.load_map(path)
    exact = dict(rtol=0, atol=0) if suffix != ".xdmf" else dict(rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(loaded.image, coarse.image, **exact)
    assert loaded.torus == coarse.torus
    for ours, theirs in (
        (carried.point_fields, loaded.point_fields),
        (carried.cell_fields, loaded.cell_fields),
    ):
        assert set(ours) == set(theirs)
        for name in ours:
            np.testing.assert_allclose(theirs[name], ours[name], **exact)
    np.testing.assert_array_equal(loaded.arrays["parent_tet"], coarse.refinement.parent_tet)
    assert sm.certify_file(path).certified == coarse.certificate.certified
    again = tmp_path / "again.vtu"
    loaded.save(again)
    assert set(read_arrays(again).point_data) == set(carried.as_cells().point_data)


def test_files_of_the_image_have_the_fields_of_the_input(coarse, tmp_path, caplog):
    points, cells = given(coarse)
    carried = coarse.with_fields(points, cells)
    fields, groups = carried.point_fields, carried.cell_fields["gmsh:physical"]
    carried.save(tmp_path / "a.msh")
    found = read_arrays(tmp_path / "a.msh")
    np.testing.assert_array_equal(found.V, coarse.image)
    np.testing.assert_array_equal(found.point_data["load"], fields["load"])
    np.testing.assert_array_equal(found.cell_data["ratio"], coarse.distortion.ratios)
    np.testing.assert_array_equal(found.cell_data["gmsh:physical"], groups)
    assert not caplog.records
    left_out = {
        ".mesh": "hold one array of regions; left out: 'height', 'load', 'density'",
        ".ply": "hold no tets; left out: 'gmsh:physical', 'density'",
    }
    for suffix, said in left_out.items():
        caplog.clear()
        carried.save(tmp_path / f"a{suffix}")
        assert [r.getMessage().partition("files ")[2] for r in caplog.records] == [said]
    np.testing.assert_array_equal(read_arrays(tmp_path / "a.mesh").cell_data["medit:ref"], groups)
    ids = coarse.mesh.boundary_vertices
    found = read_arrays(tmp_path / "a.ply")
    np.testing.assert_array_equal(found.point_data["height"], fields["height"][ids])
    caplog.clear()
    for suffix in (".mesh", ".ply", ".stl"):
        coarse.save(tmp_path / f"b{suffix}")
    assert not caplog.records


def test_names_that_ply_does_not_take_are_refused_beforehand(coarse, tmp_path):
    solid, surface = coarse.mesh, coarse.mesh.surface
    for mesh, points, cells in ((solid, {"x": 1}, {}), (surface, {}, {"höhe": 1})):
        with pytest.raises(ArrayError, match="rename it"):
            require_storable(tmp_path / "a.ply", mesh, *map(rows, (points, cells)))
    require_storable(tmp_path / "a.ply", solid, {}, rows({"höhe": 1}))  # its tets are not written


def rows(data: dict[str, int]) -> dict[str, np.ndarray]:
    return {name: np.array([value]) for name, value in data.items()}


@pytest.mark.parametrize("suffix", VIEWERS[:2])
def test_every_command_takes_maps_of_viewers(suffix, coarse, tmp_path):
    path = tmp_path / f"map{suffix}"
    coarse.save(path)
    for command in (
        ["certify", path],
        ["coordinates", path, "-o", tmp_path / "c.csv"],
        ["plot", path, "-o", tmp_path / "p.png"],
        ["report", path, "-o", tmp_path / "r.html"],
        ["morph", path, "-o", tmp_path / "m.pvd", "--frames", "3"],
        ["partition", path, "-o", tmp_path / "parts.vtu", "--fractions", "2"],
    ):
        assert main([*map(str, command)]) in (0, 1), command
    assert len(list(tmp_path.glob("m_*.vtu"))) == 3


def test_the_command_carries_groups_into_map_and_frames(tmp_path):
    solid = sm.TetMesh(*shapes.cubes(shapes.RING))
    groups = np.arange(solid.n_tets) % 4
    sm.write(
        tmp_path / "in.vtu", solid, {"t": solid.V[:, 0]}, {"gmsh:physical": groups, "u": groups}
    )
    arguments = ["volume", str(tmp_path / "in.vtu"), "-o"]
    for name in ("map.vtu", "map.npz"):
        assert main([*arguments, str(tmp_path / name), "-q", "--keep-best", "--max-iter", "2"]) < 2
    found = read_arrays(tmp_path / "map.vtu")
    parent = found.cell_data.get("parent_tet", np.arange(len(found.T)))
    np.testing.assert_array_equal(found.cell_data["gmsh:physical"], groups[parent])
    np.testing.assert_array_equal(found.point_data["t"][: solid.n_vertices], solid.V[:, 0])
    assert found.point_data["u"].dtype.kind == "f" and "u" not in found.cell_data
    out = tmp_path / "frames.pvd"
    assert main(["morph", str(tmp_path / "map.npz"), "-o", str(out), "--frames", "2"]) == 0
    frame = read_arrays(tmp_path / "frames_001.vtu")
    np.testing.assert_array_equal(frame.cell_data["gmsh:physical"], groups[parent])


def test_a_map_file_as_input_hands_its_fields_on(tmp_path):
    solid = sm.TetMesh(*shapes.cubes(shapes.RING))
    sm.write(tmp_path / "in.npz", solid, {"t": solid.V[:, 0]})
    for source, goal in (("in.npz", "map.npz"), ("map.npz", "again.npz")):
        arguments = ["volume", str(tmp_path / source), "-o", str(tmp_path / goal)]
        assert main([*arguments, "-q", "--keep-best", "--max-iter", "2"]) < 2
    found = sm.load_map(tmp_path / "again.npz")
    assert set(found.point_fields) == {"t"}
    np.testing.assert_array_equal(found.point_fields["t"][: solid.n_vertices], solid.V[:, 0])


def test_fields_that_do_not_fit(coarse, tmp_path):
    with pytest.raises(ArrayError, match="point_data"):
        coarse.with_fields({"a": np.zeros(3)})
    with pytest.raises(ArrayError, match="rows"):
        coarse.with_fields(None, {"a": np.zeros(3), "b": np.zeros(4)})
    solid = coarse.mesh
    data = {"image": coarse.image, "torus": np.random.default_rng(0).random((len(solid.V), 2))}
    sm.write(tmp_path / "a.vtu", solid, data)
    with pytest.raises(FileFormatError, match="differ from row to row"):
        sm.load_map(tmp_path / "a.vtu")
    sm.write(tmp_path / "b.vtu", solid)
    with pytest.raises(FileFormatError, match="has to be mapped first"):
        sm.load_map(tmp_path / "b.vtu")
