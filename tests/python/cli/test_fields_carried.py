"""Fields of a mesh that its map has, too: carried along, left out with a word, or refused."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from command_line import failing
from stretchmap.cli import main
from stretchmap.cli.common import read_with_fields
from stretchmap.io import read_arrays

pytest.importorskip("typer")


@pytest.mark.parametrize("suffix", [".vtu", ".npz"])
def test_fields_of_a_saved_map_are_not_carried_along(suffix, folder, capsys):
    pytest.importorskip("meshio")
    assert main(["conformal", "surface.ply", "-o", f"map{suffix}", "-q"]) == 0
    own = "u" if suffix == ".vtu" else "angles"
    assert own in sm.io.read_arrays(f"map{suffix}").point_data
    assert main(["conformal", f"map{suffix}", "-o", "again.vtu", "-q"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", [".vtu", ".npz"])
def test_an_image_alone_makes_no_saved_map(suffix, folder, capsys):
    pytest.importorskip("meshio")
    surface = sm.read("surface.ply")
    x = surface.V[:, 0]
    sm.write(f"flow{suffix}", surface, {"image": x, "u": x}, {"ratio": surface.face_areas})
    assert main(["conformal", f"flow{suffix}", "-o", "map.vtu", "-q"]) == 0
    said = capsys.readouterr().err
    assert "left out: image, u;" in said and "left out: ratio;" in said


def test_fields_of_parts_of_a_map_are_not_carried_along(tmp_path):
    ring = sm.samples.solid_torus(600)
    np.savez(tmp_path / "map.npz", V=ring.V, T=ring.T, image=ring.V, torus=[2.0, 1.0])
    sm.partition(sm.load_map(tmp_path / "map.npz"), 2).save(tmp_path / "parts.npz")
    _, (points, cells) = read_with_fields(tmp_path / "parts.npz", orient=False, compact=False)
    assert not points and list(cells) == ["part"]


def test_fields_named_like_those_of_maps_are_left_out_with_a_word(folder, capsys):
    pytest.importorskip("meshio")
    surface = sm.read("surface.ply")
    sm.write("flow.vtu", surface, point_data={"u": surface.V[:, 0], "load": surface.V[:, 1]})
    assert main(["conformal", "flow.vtu", "-o", "map.vtu"]) == 0
    said = capsys.readouterr().err
    assert "left out: u;" in said and "load" not in said
    assert "load" in sm.io.read_arrays("map.vtu").point_data


@pytest.mark.parametrize(
    ("command", "work"),
    [("conformal", "conformal.map.conformal_map"), ("area", "area.map.area_map")],
)
def test_fields_of_tets_are_left_out_with_a_word_where_the_boundary_is_mapped(
    command, work, folder, capsys, monkeypatch
):
    solid = sm.read("solid.npz")
    done = sm.conformal_map(solid.surface)
    monkeypatch.setattr(f"stretchmap.{work}", lambda *_, **__: done)
    sm.write("load.npz", solid, {"load": solid.V[:, 1]}, {"density": solid.tet_volumes})
    assert main([command, "load.npz", "-o", "map.npz", "-q"]) == 0
    said = capsys.readouterr().err
    assert "load.npz: the boundary is mapped, which has no tets; left out: 'density'" in said
    loaded = sm.load_map("map.npz")
    assert set(loaded.point_fields) == {"load"} and not loaded.cell_fields
    assert main([command, "solid.npz", "-o", "map.npz", "-q"]) == 0
    assert capsys.readouterr().err == ""


def test_fields_the_output_has_other_types_for_are_carried(folder, capsys):
    pytest.importorskip("meshio")
    surface = sm.read("surface.ply")
    labels = np.arange(surface.n_faces, dtype=np.uint8)
    sm.write("labels.vtu", surface, cell_data={"my labels": labels})
    for suffix in (".xdmf", ".vtk"):
        assert main(["conformal", "labels.vtu", "-o", f"map{suffix}", "-q"]) == 0
        np.testing.assert_array_equal(read_arrays(f"map{suffix}").cell_data["my labels"], labels)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("command", "work"),
    [
        ("conformal", "conformal.map.conformal_map"),
        ("area", "area.map.area_map"),
        ("volume", "volume.map.volume_map"),
        ("fill", "volume.fill.fill"),
        ("register", "registration.map.register"),
    ],
)
def test_what_the_output_cannot_hold_is_refused_before_the_work(
    command, work, folder, capsys, monkeypatch
):
    pytest.importorskip("meshio")
    solid = sm.read("solid.npz")
    sm.write("four.npz", solid, point_data={"four": np.ones((solid.n_vertices, 4))})
    np.savez("image.npz", ids=solid.boundary_vertices, image=solid.V[solid.boundary_vertices])
    further = {"fill": ["--boundary", "image.npz"], "register": ["solid.npz"]}.get(command, [])
    monkeypatch.setattr(f"stretchmap.{work}", lambda *_, **__: pytest.fail("work was begun"))
    code, error = failing(capsys, command, "four.npz", *further, "-o", "map.xdmf", "-q")
    assert code == 2 and error.startswith("map.xdmf: 'four' has 4 columns")
    assert ".vtu or .npz" in error
