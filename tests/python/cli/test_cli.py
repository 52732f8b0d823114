"""The command line: exit codes, one sentence of error, files that appear whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

import shapes
import stretchmap as sm
from command_line import failing
from stretchmap import TetMesh, TriMesh, samples
from stretchmap.cli import main
from stretchmap.errors import CertificationError

pytest.importorskip("typer")

REPORT_KEYS = set(
    """
    n_vertices n_elements flips ring_mean ring_std element_error_mean element_std ratio_min
    ratio_max total_distortion energy iterations converged stop_reason seconds torus versions
    certified reason
    """.split()
)


@pytest.mark.parametrize("command", ["conformal", "area", "volume"])
def test_map_commands_write_the_map_and_the_report(folder, capsys, solid, command):
    assert main([command, "solid.npz", "-o", "map.npz", "--json", "map.json"]) == 0
    out = capsys.readouterr().out
    report = json.loads((folder / "map.json").read_text())
    assert REPORT_KEYS <= report.keys()
    assert {"R", "r"} == report["torus"].keys()
    assert {"stretchmap", "python", "numpy", "scipy"} <= report["versions"].keys()
    total = report["seconds"].pop("total")
    assert {"read"} < report["seconds"].keys()
    assert 0.0 < sum(report["seconds"].values()) <= total
    assert "written to map.npz" in out and "ring std" in out
    assert report["flips"] == 0 and report["certified"] is True

    with np.load("map.npz") as data:
        arrays = dict(data)
    source = solid if command == "volume" else solid.surface
    assert np.array_equal(arrays["V"][: source.n_vertices], source.V)
    assert arrays["image"].shape == arrays["V"].shape
    assert ("T" in arrays) == (command == "volume")
    again = sm.distortion(
        TetMesh(arrays["V"], arrays["T"]) if "T" in arrays else TriMesh(arrays["V"], arrays["F"]),
        arrays["image"],
    )
    assert report["ring_std"] == pytest.approx(again.ring_std, rel=1e-12)
    assert report["n_elements"] == len(again.ratios)


def test_area_of_a_solid_is_that_of_its_boundary(folder, solid):
    assert main(["area", "solid.npz", "-o", "a.npz", "-q"]) == 0
    assert main(["area", "surface.ply", "-o", "b.npz", "-q"]) == 0
    with np.load("a.npz") as a, np.load("b.npz") as b:
        assert np.array_equal(a["image"], b["image"])


def test_area_takes_a_balance_as_volume_does(folder, solid, capsys):
    assert main(["area", "solid.npz", "-o", "a.npz", "--balance", "0.2", "-q"]) == 0
    expected = sm.area_map(solid.surface, balance=0.2)
    assert np.array_equal(sm.load_map("a.npz").image, expected.image)
    assert expected.distortion.angle_mean < sm.area_map(solid.surface).distortion.angle_mean
    assert main(["area", "solid.npz", "-o", "b.npz", "--balance", "1.5", "-q"]) == 2
    assert "balance must be at least 0 and at most 1" in capsys.readouterr().err


def test_quiet_prints_nothing(folder, capsys):
    assert main(["conformal", "surface.ply", "-o", "map.npz", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", [".npz", ".vtu", ".vtk", ".obj", ".ply"])
def test_every_output_format_is_read_back(folder, suffix):
    if suffix in (".vtu", ".vtk"):
        pytest.importorskip("meshio")
    vsem = ["--c", "1", "--max-iter", "2", "-q"]
    assert main(["volume", "solid.npz", "-o", f"map{suffix}", *vsem]) == 0
    mesh = sm.read(f"map{suffix}")
    assert isinstance(mesh, TetMesh if suffix in (".npz", ".vtu", ".vtk") else TriMesh)


def test_vsem_that_did_not_converge_says_so_and_succeeds(folder, capsys):
    code = main(["volume", "solid.npz", "-o", "m.npz", "--c", "0", "--max-iter", "1", "-q",
                 "--tol", "0", "--json", "m.json"])  # fmt: skip
    report = json.loads((folder / "m.json").read_text())
    err = capsys.readouterr().err
    assert code == 0
    assert report["converged"] is False and report["iterations"] == 1
    assert "not converged: most iterations done" in err


def test_a_run_goes_on_from_a_saved_map(folder):
    assert main(["volume", "solid.npz", "-o", "a.npz", "--max-iter", "3", "-q"]) == 0
    assert main(["volume", "solid.npz", "-o", "b.npz", "--start", "a.npz", "-q"]) == 0
    first, second = sm.load_map("a.npz"), sm.load_map("b.npz")
    assert second.distortion.element_std <= first.distortion.element_std
    assert np.array_equal(first.mesh.T, second.mesh.T)


def test_start_from_another_solids_map_is_refused(folder, capsys):
    sm.write("other.npz", samples.solid_torus(2500))
    assert main(["volume", "other.npz", "-o", "o.npz", "--c", "0", "--max-iter", "1", "-q"]) == 0
    capsys.readouterr()
    code, message = failing(capsys, "volume", "solid.npz", "-o", "x.npz", "--start", "o.npz")
    assert code == 2 and "not a map of this solid" in message


def defect_files():
    V, F = shapes.torus()
    bad_point = V.copy()
    bad_point[5, 1] = np.nan
    far = F.copy()
    far[7, 2] = len(V)
    ball, double = samples.ball(2), samples.solid_double_torus(1)
    tets = samples.solid_torus(600)
    turned = tets.T.copy()
    turned[3, 2:] = turned[3, :1:-1]
    return {
        "sphere": ("area", V_F(samples.sphere(2)), "genus 0"),
        "genus-two": ("area", V_F(samples.double_torus(1)), "genus 2"),
        "open": ("area", (V, F[1:]), "on a border; close the holes"),
        "NaN": ("area", (bad_point, F), "NaN or infinite coordinates at vertex 5"),
        "index": ("area", (V, far), "96"),
        "inside-out": ("area", (V, F[:, ::-1]), "inside out"),
        "solid ball": ("volume", (ball.V, ball.T), "genus 0"),
        "solid genus-two": ("volume", (double.V, double.T), "genus 2"),
        "inverted tet": ("volume", (tets.V, turned), "oriented against the solid"),
    }


def V_F(mesh):
    return mesh.V, mesh.F


@pytest.mark.parametrize("name", defect_files())
def test_defects_have_messages_of_their_own_and_exit_2(folder, capsys, name):
    command, (V, elements), expected = defect_files()[name]
    np.savez("bad.npz", V=V, **{"T" if elements.shape[1] == 4 else "F": elements})
    code, message = failing(capsys, command, "bad.npz", "-o", "x.npz", "--json", "x.json")
    assert code == 2
    assert expected in message


def test_orientation_is_repaired_on_request(folder, capsys):
    V, F = shapes.torus()
    np.savez("bad.npz", V=V, F=F[:, ::-1])
    code, message = failing(capsys, "area", "bad.npz", "-o", "x.npz")
    assert code == 2 and "--orient" in message
    assert main(["area", "bad.npz", "-o", "x.npz", "--orient", "-q"]) == 0
    assert "elements turned" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["volume", "absent.npz", "-o", "x.npz"], "absent.npz: No such file"),
        (["volume", "solid.npz", "-o", "x.foo"], "x.foo: cannot write .foo"),
        (["volume", "solid.npz", "-o", "x"], "without suffix"),
        (["volume", "solid.npz", "-o", "absent/x.npz"], "no such folder"),
        (["volume", "solid.npz", "-o", "solid.npz"], "would be replaced"),
        (["volume", "solid.npz", "-o", "x.npz", "--json", "x.npz"], "would be replaced"),
        (["volume", "solid.npz", "-o", "x.npz", "--json", "absent/x.json"], "no such folder"),
        (["volume", "solid.npz", "-o", "x.npz", "--json", "-"], "instead of '-'"),
        (["info", "solid.npz", "--json", "-"], "instead of '-'"),
        (["volume", "solid.npz"], "--output"),
        (["volume", "solid.npz", "-o", "x.npz", "--ratio", "0.5"], "above 1"),
        (["volume", "solid.npz", "-o", "x.npz", "--ratio", "wide"], "'wide'"),
        (["volume", "solid.npz", "-o", "x.npz", "--c", "-1"], "c must be at least 0"),
        (["volume", "solid.npz", "-o", "x.npz", "--c", "much"], "'--c'"),
        (["volume", "solid.npz", "-o", "x.npz", "--max-iter", "1e3"], ". Try --help."),
        (["volume", "solid.npz", "-o", "x.npz", "--method", "magic"], "magic"),
        (["volume", "solid.npz", "-o", "x.npz", "--c", "1", "--boundary", "glide"], "boundary"),
        (["volume", "surface.ply", "-o", "x.npz"], "stretchmap tet surface.ply"),
        (["tet", "solid.npz", "-o", "x.npz"], "a solid already"),
        (["tet", "surface.ply", "-o", "x.obj"], "cannot write .obj"),
        (["plot", "solid.npz", "-o", "x.png"], "image"),
        (["plot", "solid.npz", "-o", "x.gif"], "cannot write .gif"),
        (["report", "solid.npz", "-o", "x.txt"], "cannot write .txt"),
        (["certify", "surface.ply"], "no .npz archive"),
        (["certify", "solid.npz"], "image"),
        (["nothing"], "nothing"),
        (["info", "--bogus"], "--bogus"),
    ],
)  # fmt: skip
def test_misuse_is_one_sentence_and_exit_2(folder, capsys, arguments, expected):
    code, message = failing(capsys, *arguments)
    assert code == 2
    assert expected in message


def test_a_read_only_folder_is_refused_before_the_work(folder, capsys, monkeypatch):
    monkeypatch.setattr("stretchmap.cli.common._writable", lambda path: False)
    started = time.perf_counter()
    code, message = failing(capsys, "volume", "solid.npz", "-o", "x.npz")
    assert code == 2 and "x.npz: cannot be written" in message
    assert time.perf_counter() - started < 5.0


def test_what_fails_while_computing_exits_1(folder, capsys, monkeypatch):
    def give_up(*arguments, **options):
        raise CertificationError("not certified: 1 tet (7); keep_best=True returns it", [7])

    monkeypatch.setattr("stretchmap.volume.map.volume_map", give_up)
    code, message = failing(capsys, "volume", "solid.npz", "-o", "x.npz", "--json", "x.json")
    assert code == 1
    assert "1 tet (7)" in message and "--keep-best" in message


def test_no_output_without_its_report(folder, capsys, monkeypatch):
    def full(self, path):
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr("stretchmap.maps.result.MapResult.save", full)
    code, message = failing(capsys, "conformal", "surface.ply", "-o", "x.npz", "--json", "x.json")
    assert code == 1 and "No space left" in message


def test_certify_judges_any_map_file(folder, capsys, solid):
    np.savez("good.npz", V=solid.V, T=solid.T, image=2.0 * solid.V)
    assert main(["certify", "good.npz", "--json", "good.json"]) == 0
    assert "certified" in capsys.readouterr().out
    folded = np.array(solid.V)
    inner = np.flatnonzero(solid.boundary_index < 0)[0]
    folded[inner] += 10.0
    np.savez("bad.npz", V=solid.V, T=solid.T, image=folded)
    assert main(["certify", "bad.npz", "--json", "bad.json", "-q"]) == 1
    assert "image volume not positive" in capsys.readouterr().err
    good, bad = (json.loads((folder / f).read_text()) for f in ("good.json", "bad.json"))
    assert good["certified"] and not bad["certified"]
    assert bad["ids"]["image_positive"]


def test_radii_that_are_asked_for_count_more_than_those_of_the_file(folder, capsys, solid):
    np.savez("doubled.npz", V=solid.V, T=solid.T, image=2.0 * solid.V, torus=[6.0, 2.0])
    reports = [("of_file.json", []), ("of_option.json", ["--torus", "9", "1"])]
    for name, options in reports:
        main(["certify", "doubled.npz", "--json", name, "-q", *options])
    of_file, of_option = (json.loads((folder / name).read_text()) for name, _ in reports)
    assert of_file["quantities"] != of_option["quantities"]
    capsys.readouterr()
    main(["certify", "--help"])
    assert "in place of those of the file" in " ".join(capsys.readouterr().out.split())


def test_a_boundary_is_filled_from_its_file_or_refused(folder, capsys, solid):
    ids, image = solid.boundary_vertices, 2.0 * solid.surface.V
    command = ["fill", "solid.npz", "--boundary", "b.npz", "-o", "x.npz", "-q"]
    turned = np.arange(len(ids))[::-1]
    np.savez("b.npz", ids=ids[turned], image=image[turned])
    assert main(command) == 0
    np.testing.assert_array_equal(sm.load_map("x.npz").image[ids], image)
    Path("x.npz").unlink()
    for arrays, word in (
        ({"ids": ids}, "must be an .npz with ids"),
        ({"ids": ids[1:], "image": image[1:]}, "each once"),
        ({"ids": ids[1:], "image": image}, "entries"),
        ({"ids": ids.astype(float), "image": image}, "ids of b.npz must hold integers"),
        ({"ids": ids, "image": image[:, :2]}, "image of b.npz must have shape"),
    ):
        np.savez("b.npz", **arrays)
        code, message = failing(capsys, *command)
        assert code == 2 and word in message
    np.save("b.npy", image)
    code, message = failing(capsys, *command[:3], "b.npy", *command[4:])
    assert code == 2 and "b.npy" in message and "no .npz archive" in message


def test_keep_best_keeps_an_uncertified_map_and_still_exits_1(folder, capsys, monkeypatch):
    from dataclasses import replace

    from stretchmap.volume import result as volume

    real = volume.certify

    def doubt(*arguments):
        return replace(real(*arguments), certified=False, reason="for want of trust")

    monkeypatch.setattr(volume, "certify", doubt)
    code, message = failing(capsys, "volume", "solid.npz", "-o", "x.npz", "--max-iter", "1", "-q")
    assert code == 1 and "for want of trust" in message
    code = main(["volume", "solid.npz", "-o", "x.npz", "--json", "x.json", "--max-iter", "1", "-q",
                 "--keep-best"])  # fmt: skip
    assert code == 1
    assert "map kept in x.npz" in capsys.readouterr().err
    assert json.loads((folder / "x.json").read_text())["certified"] is False
    assert sm.load_map("x.npz").mesh.n_vertices > 0


@pytest.mark.parametrize(
    "arguments",
    [
        ["conformal", "coarse.npz"],
        ["area", "coarse.npz", "--finish", "none"],
        ["volume", "knot.npz", "--c", "10", "--max-iter", "1"],
    ],
)
def test_maps_that_are_proven_afterwards_are_kept_with_exit_1(
    tmp_path, monkeypatch, capsys, arguments
):
    monkeypatch.chdir(tmp_path)
    sm.write("coarse.npz", samples.torus_surface(3, 3))
    sm.write("knot.npz", samples.knot_tube(600))
    assert main([*arguments, "-o", "x.npz", "--json", "x.json", "-q"]) == 1
    report = json.loads(Path("x.json").read_text())
    assert report["certified"] is False and report["flips"] > 0
    said = f"stretchmap: error: not certified: {report['reason']}; map kept in x.npz\n"
    assert capsys.readouterr().err.endswith(said)
    assert sm.load_map("x.npz").distortion.flips == report["flips"]


def test_what_cannot_be_printed_leaves_the_map_written(folder, capsys, monkeypatch):
    def full(text):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("typer.echo", full)
    assert main(["conformal", "surface.ply", "-o", "x.npz"]) == 1
    assert os.strerror(errno.ENOSPC) in capsys.readouterr().err
    assert sm.load_map("x.npz").distortion.flips == 0


def test_info_lists_every_defect_and_reads_what_cannot_be_mapped(folder, capsys):
    V, F = shapes.torus()
    np.savez("bad.npz", V=np.vstack([V, [[9.0, 9.0, 9.0]]]), F=F[1:])
    assert main(["info", "bad.npz", "--json", "bad.json"]) == 0
    out = capsys.readouterr().out
    report = json.loads((folder / "bad.json").read_text())
    assert {d["name"] for d in report["defects"]} == {"border_edges", "unreferenced"}
    assert report["usable"] is False and report["reason"]
    assert "can be mapped to the torus: no" in out
    assert main(["info", "solid.npz"]) == 0
    assert "can be mapped to the torus: yes" in capsys.readouterr().out
    angle = 2.0 * np.arctan2(V[:, 1], V[:, 0])
    far = np.hypot(V[:, 0], V[:, 1])
    np.savez(
        "twice.npz", V=np.column_stack([far * np.cos(angle), far * np.sin(angle), V[:, 2]]), F=F
    )
    assert main(["info", "twice.npz", "--orient"]) == 0
    assert "to the torus: no, the surface touches or crosses itself at" in capsys.readouterr().out


def test_homology_of_any_genus(folder, capsys):
    sm.write("two.npz", samples.solid_double_torus(1))
    assert main(["homology", "two.npz", "-o", "loops.npz", "--json", "loops.json"]) == 0
    report = json.loads((folder / "loops.json").read_text())
    assert report["genus"] == 2 and len(report["handle_lengths"]) == 2
    with np.load("loops.npz") as data:
        assert {"handle_0", "handle_1", "tunnel_0", "tunnel_1"} <= set(data.files)
    assert "genus" in capsys.readouterr().out


def test_tet_fills_a_surface(folder, solid):
    pytest.importorskip("tetgen")
    assert main(["tet", "surface.ply", "-o", "filled.npz", "-q"]) == 0
    filled = sm.read("filled.npz")
    assert isinstance(filled, TetMesh)
    assert filled.volume == pytest.approx(solid.volume, rel=1e-6)
    filled.require_solid_torus()


def test_plot_and_report_of_a_map(folder):
    pytest.importorskip("matplotlib")
    assert main(["volume", "solid.npz", "-o", "m.npz", "--max-iter", "2", "-q"]) == 0
    assert main(["plot", "m.npz", "-o", "p.png", "--kind", "convergence"]) == 0
    assert (folder / "p.png").read_bytes().startswith(b"\x89PNG")
    assert main(["report", "m.npz", "-o", "r.html"]) == 0
    page = (folder / "r.html").read_text()
    assert page.count("data:image/png;base64,") == 7
    assert "Certified" in page
    assert "://" not in page and 'src="data:' in page
    assert "spread of the ratios per vertex" in page


def test_plot_options_belong_to_their_kinds(folder, capsys):
    pytest.importorskip("matplotlib")
    assert main(["volume", "solid.npz", "-o", "m.npz", "--c", "1", "--max-iter", "1", "-q"]) == 0
    assert main(["plot", "m.npz", "-o", "u.png", "--kind", "levels", "--by", "u"]) == 0
    assert main(["plot", "m.npz", "-o", "c.svg", "--kind", "cutaway", "--color", "ratio"]) == 0
    capsys.readouterr()
    assert main(["plot", "m.npz", "-o", "x.png", "--kind", "loops", "--by", "u"]) == 2
    assert "has no option 'by'" in capsys.readouterr().err
    assert main(["plot", "m.npz", "-o", "x.png", "--kind", "registration"]) == 2
    assert "needs a registration" in capsys.readouterr().err
    assert not (folder / "x.png").exists()


def test_demo_needs_no_data(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    out, report = tmp_path / "out", tmp_path / "demo.json"
    assert main(["demo", "-o", str(out), "--json", str(report)]) == 0
    assert {p.name for p in out.iterdir()} == {"map.npz", "ratios.png", "torus.png"}
    assert "ring std" in capsys.readouterr().out
    figures = json.loads(report.read_text())
    assert figures["certified"] and figures["flips"] == 0


def test_a_demo_that_cannot_be_written_leaves_no_file(tmp_path, capsys, monkeypatch):
    figure = pytest.importorskip("matplotlib.figure").Figure
    save, saved = figure.savefig, []

    def full(self, path, **options):
        if saved:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        saved.append(path)
        save(self, path, **options)

    monkeypatch.setattr(figure, "savefig", full)
    out, report = tmp_path / "out", tmp_path / "demo.json"
    arguments = ["demo", "-o", str(out), "--sample", "torus", "--n-tets", "300", "-q"]
    assert main([*arguments, "--json", str(report)]) == 1
    assert f"torus.png: {os.strerror(errno.EFBIG)}" in capsys.readouterr().err
    assert not list(out.iterdir()) and not report.exists()
