"""Morphs, and the commands register, partition, resample and morph."""

from __future__ import annotations

import errno
import inspect
import json
import os
from pathlib import Path

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import FileFormatError, KindError, OptionError
from stretchmap.plot.morphing import morph

RNG = np.random.default_rng(4)


@pytest.fixture(scope="module")
def bumpy_map():
    return sm.volume_map(samples.bumpy_torus(3000))


@pytest.fixture(scope="module")
def folder(tmp_path_factory, bumpy_map):
    """A folder with two solids, their landmarks and a map file."""
    folder = tmp_path_factory.mktemp("applications")
    pair = samples.vertebra_pair(n_landmarks=20, n_tets=(3000, 4000))
    sm.write(folder / "a.npz", pair.source)
    sm.write(folder / "b.npz", pair.target)
    rows = zip(pair.source_landmarks, pair.target_landmarks, strict=True)
    (folder / "marks.csv").write_text("\n".join(f"{a},{b}" for a, b in rows))
    bumpy_map.save(folder / "map.npz")
    return folder


def run(*arguments):
    pytest.importorskip("typer")
    from stretchmap.cli import main

    return main([str(argument) for argument in arguments])


def test_morph_is_linear_between_source_and_image(bumpy_map):
    result = morph(bumpy_map, 5, align=False)
    assert np.array_equal(result.frame(0), bumpy_map.mesh.V)
    assert np.allclose(result.frame(4), bumpy_map.image)
    assert np.allclose(result.frame(2), 0.5 * (bumpy_map.mesh.V + bumpy_map.image))
    assert result.flips[0] == result.flips[-1] == 0


def test_alignment_undoes_a_similarity():
    solid = samples.vertebra_like(3000)
    from shapes import a_map

    Q = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    result = morph(a_map(solid, 2.0 * solid.V @ Q + 5.0), 4)
    assert np.allclose(result.image, solid.V, atol=1e-12) and not result.flips.any()


def test_morph_files(bumpy_map, tmp_path):
    pytest.importorskip("meshio")
    result = morph(bumpy_map, 3)
    written = result.save(tmp_path / "m.pvd")
    assert [path.name for path in written] == ["m_000.vtu", "m_001.vtu", "m_002.vtu", "m.pvd"]
    assert np.allclose(sm.read(written[1]).V, result.frame(1))
    assert all(path.name in written[-1].read_text() for path in written[:-1])
    with pytest.raises(FileFormatError):
        result.save(tmp_path / "m.mp4")
    with pytest.raises(OptionError):
        morph(bumpy_map, 1)
    with pytest.raises(KindError, match="map of a solid"):
        morph(sm.area_map(bumpy_map.mesh.surface))


def test_frames_without_what_names_them_do_not_stay(bumpy_map, tmp_path, monkeypatch):
    pytest.importorskip("meshio")

    def full(self, *arguments, **options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match=r"m\.pvd"):
        morph(bumpy_map, 2).save(tmp_path / "m.pvd")
    assert not list(tmp_path.iterdir())


def test_morph_picture(bumpy_map, tmp_path):
    pytest.importorskip("matplotlib")
    pillow = pytest.importorskip("PIL.Image")
    result = morph(bumpy_map, 3)
    result.save(tmp_path / "m.gif")
    with pillow.open(tmp_path / "m.gif") as picture:
        assert picture.n_frames == 4
    assert [axes.get_title() for axes in result.picture(2).axes] == ["t = 0.00", "t = 1.00"]
    for count in (1, 4):
        with pytest.raises(OptionError):
            result.picture(count)


def test_register_command(folder, capsys):
    out = folder / "r.npz"
    code = run("register", folder / "a.npz", folder / "b.npz", "--landmarks", folder / "marks.csv",
               "-o", out, "--json", folder / "r.json")  # fmt: skip
    assert code == 0
    report = json.loads((folder / "r.json").read_text())
    assert report["certified"] and report["landmarks"] == 20 and report["landmark_error"] < 1e-6
    assert sm.load_map(out).title == "registration"
    assert "landmark error" in capsys.readouterr().out
    pytest.importorskip("matplotlib")
    assert run("plot", out, "-o", folder / "pair.png", "--kind", "registration") == 0
    assert run("plot", out, "-o", folder / "no.png", "--kind", "levels") == 2
    assert "no torus" in capsys.readouterr().err and not (folder / "no.png").exists()
    assert run("report", out, "-o", folder / "r.html") == 0
    page = (folder / "r.html").read_text()
    assert page.count("<img ") == 5 and "landmark error" in page and "Not drawn" not in page


def test_register_command_names_bad_landmarks(folder, capsys):
    (folder / "bad.csv").write_text("0,0\n1,x\n")
    code = run("register", folder / "a.npz", folder / "b.npz", "--landmarks", folder / "bad.csv",
               "-o", folder / "bad.npz")  # fmt: skip
    assert code == 2 and not (folder / "bad.npz").exists()
    assert "bad.csv, line 2: 'x' is not a finite number" in capsys.readouterr().err


def test_register_command_takes_how_far_landmarks_may_be_off(folder, capsys):
    a, b = sm.read(folder / "a.npz"), sm.read(folder / "b.npz")
    at = np.hstack([a.surface.V[:1] + 0.3 * np.ptp(a.V, axis=0), b.surface.V[:1]])
    np.savetxt(folder / "far.csv", at, delimiter=",")
    arguments = ("register", folder / "a.npz", folder / "b.npz", "--landmarks", folder / "far.csv",
                 "-o", folder / "far.npz")  # fmt: skip
    assert run(*arguments) == 2
    assert "within" in capsys.readouterr().err
    assert run(*arguments, "--within", "0") == 2
    assert "within must be above 0" in capsys.readouterr().err
    assert len(sm.read_landmarks(folder / "far.csv", a, b, within=0.9)) == 1
    assert inspect.signature(sm.read_landmarks).parameters["within"].default == 0.1
    assert run(*arguments, "--within", "0.9", "--keep-best") in (0, 1)
    assert (folder / "far.npz").exists()


@pytest.mark.parametrize(
    "text, expected",
    [
        ("", "holds no numbers"),
        ("source,target\n", "holds no numbers"),
        ("1,2,3\n", "line 1: 3 entries"),
        ("# ids\na,b\n\n1,2\n3,4,5,6,7,8\n", "line 5: 6 entries, but 2 before"),
        ("1,nan\n", "line 1: 'nan' is not a finite number"),
        ("1,1e400\n", "line 1: '1e400' is not a finite number"),
        ("1,2_0\n", "line 1: '2_0' is not a finite number"),
        ("1.5,2\n", "whole numbers"),
        ("99999999,0\n", "names no vertex"),
        ("\xff", "not a readable CSV file"),
    ],
)
def test_a_bad_table_of_landmarks_is_told_by_its_line(folder, capsys, text, expected):
    (folder / "bad.csv").write_bytes(text.encode("latin-1"))
    code = run("register", folder / "a.npz", folder / "b.npz", "--landmarks", folder / "bad.csv",
               "-o", folder / "bad.npz")  # fmt: skip
    assert code == 2 and expected in capsys.readouterr().err
    assert not (folder / "bad.npz").exists()


def test_coordinates_command(folder, bumpy_map, capsys):
    out = folder / "coordinates.csv"
    assert run("coordinates", folder / "map.npz", "-o", out) == 0
    rows = np.loadtxt(out, delimiter=",", skiprows=1)
    solid = bumpy_map.mesh
    assert np.array_equal(rows[:, :3], solid.V) and np.array_equal(rows[:, 3:6], bumpy_map.image)
    assert np.allclose(bumpy_map.torus.xi(*rows[:, 6:].T), bumpy_map.image, atol=1e-12)
    assert out.read_text().startswith("x,y,z,image_x,image_y,image_z,u,v,s\n")

    inside = solid.V[solid.T[:4]].mean(axis=1)
    np.savetxt(folder / "p.csv", [*inside, [99.0, 0.0, 0.0]], delimiter=",", header="x,y,z")
    assert run("coordinates", folder / "map.npz", "--points", folder / "p.csv", "-o", out) == 0
    assert "1 of 5 points lie outside the source" in capsys.readouterr().err
    rows = np.loadtxt(out, delimiter=",", skiprows=1)
    assert np.allclose(rows[:4, 3:6], bumpy_map.forward(inside), atol=1e-12)
    assert np.isnan(rows[4, 3:]).all() and rows[4, 0] == 99.0

    np.savetxt(folder / "q.csv", rows[:4, 3:6], delimiter=",")
    arguments = ("coordinates", folder / "map.npz", "--inverse", "-o", out)
    assert run(*arguments, "--points", folder / "q.csv") == 0
    assert np.allclose(np.loadtxt(out, delimiter=",", skiprows=1)[:, :3], inside, atol=1e-9)
    out.unlink()
    assert run(*arguments) == 2 and "--points" in capsys.readouterr().err
    (folder / "bad.csv").write_text("1,2,nan\n")
    assert run(*arguments, "--points", folder / "bad.csv") == 2
    assert "line 1: 'nan'" in capsys.readouterr().err and not out.exists()


def test_partition_command(folder):
    out = folder / "parts.npz"
    arguments = ("partition", folder / "map.npz", "-o", out, "-q", "--json", folder / "p.json")
    assert run(*arguments, "--by", "u", "--fractions", "0.2,0.3,0.5") == 0
    report = json.loads((folder / "p.json").read_text())
    assert np.abs(report["errors"]).max() < 1e-12 and len(report["volumes"]) == 3
    assert run(*arguments, "--by", "u,s", "--fractions", "4:2") == 0
    assert len(json.loads((folder / "p.json").read_text())["volumes"]) == 8
    for wrong in ("many", "nan", "inf", "0.2,nan", "1", "2.5", "0.5:0.5"):
        assert run(*arguments, "--fractions", wrong) == 2
    assert run(*arguments, "--by", "x") == 2


def test_resample_and_morph_commands(folder):
    pytest.importorskip("meshio")
    few = ("--sections", 24, "--block", 2, "--rings", 1)
    assert run("resample", folder / "map.npz", "-o", folder / "grid.vtu", *few) == 0
    assert run("resample", folder / "map.npz", "-o", folder / "grid.stl") == 2
    assert run("morph", folder / "map.npz", "-o", folder / "m.pvd", "--frames", 3) == 0
    assert (folder / "m_002.vtu").exists()


def test_a_grid_as_it_was_pulled_back_is_kept(folder, capsys):
    pytest.importorskip("meshio")
    pulled = folder / "pulled.vtu"
    assert run("resample", folder / "map.npz", "-o", pulled, "--no-optimize", "--sections", 3) == 1
    assert f"not valid; grid kept in {pulled}" in capsys.readouterr().err and pulled.exists()


def test_frames_appear_together_or_not_at_all(bumpy_map, tmp_path, monkeypatch):
    pytest.importorskip("meshio")
    write = sm.io.write

    written = []

    def full(path, mesh, *fields):
        if len(written) == 2:
            raise OSError(28, "No space left on device", str(path))
        write(path, mesh, *fields)
        written.append(path)

    monkeypatch.setattr("stretchmap.io.write", full)
    with pytest.raises(OSError):
        morph(bumpy_map, 3).save(tmp_path / "m.pvd")
    assert len(written) == 2 and not list(tmp_path.iterdir())


def test_frames_of_a_morph_are_not_taken_for_leftovers(bumpy_map, tmp_path, monkeypatch):
    """However long they take: what another writer may delete has to be older than a minute."""
    pytest.importorskip("meshio")
    monkeypatch.setattr("stretchmap.base.files._LEFT_OVER", -1.0)
    written = morph(bumpy_map, 4).save(tmp_path / "m.pvd")
    assert sorted(tmp_path.iterdir()) == sorted(written) and len(written) == 5


def test_register_command_names_the_mesh_at_fault(folder, capsys):
    sm.write(folder / "ball.npz", samples.ball(3))
    assert run("register", folder / "a.npz", folder / "ball.npz", "-o", folder / "x.npz") == 2
    assert "ball.npz: the boundary of the solid has genus 0" in capsys.readouterr().err


@pytest.mark.parametrize("damage", ["nan", "point"])
def test_commands_refuse_broken_images(folder, capsys, damage):
    with np.load(folder / "map.npz") as file:
        arrays = dict(file)
    arrays["image"][3:] = np.nan if damage == "nan" else arrays["image"][0]
    arrays["image"][:3] = arrays["image"][3]
    np.savez(folder / "broken.npz", **arrays)
    for command, output, code in (
        ("partition", "x.npz", 1), ("resample", "x.vtu", 1), ("morph", "x.pvd", 2),
        ("plot", "x.png", 2), ("report", "x.html", 2), ("certify", None, 1),
    ):  # fmt: skip
        rest = () if output is None else ("-o", folder / output)
        assert run(command, folder / "broken.npz", *rest) == (2 if damage == "nan" else code)
        err = capsys.readouterr().err
        assert err.startswith("stretchmap: error: ") and "internal" not in err, command
        assert err.count("\n") == 1 and (output is None or not (folder / output).exists())


def test_a_mesh_is_no_map(folder, capsys):
    assert run("plot", folder / "a.npz", "-o", folder / "x.png") == 2
    assert "holds a mesh and no image of it" in capsys.readouterr().err


def test_commands_refuse_maps_of_surfaces(folder, bumpy_map, capsys):
    sm.area_map(bumpy_map.mesh.surface).save(folder / "surface.npz")
    for command, output in (
        ("partition", "x.npz"), ("resample", "x.vtu"), ("morph", "x.pvd"), ("coordinates", "x.csv"),
    ):  # fmt: skip
        assert run(command, folder / "surface.npz", "-o", folder / output) == 2
        assert "map of a surface" in capsys.readouterr().err
