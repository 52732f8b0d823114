"""The command population: files, exit codes, the report."""

from __future__ import annotations

import json

import numpy as np
import pytest

import stretchmap as sm

pytest.importorskip("typer")
pytest.importorskip("matplotlib")
from stretchmap.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("bones")
    for i, solid in enumerate(sm.samples.vertebra_population(6, seed=2, n_tets=1000).solids[:3]):
        sm.write(place / f"bone{i}.npz", solid)
    return place


def run(*arguments):
    return main([str(argument) for argument in arguments])


def test_a_folder_of_bones(folder, tmp_path, capsys):
    out = tmp_path / "run"
    few = ("--max-rounds", 1, "--tol", 1)
    assert run("population", folder, "-o", out, *few, "--json", tmp_path / "a.json") == 0
    said = capsys.readouterr().out
    assert "compactness" in said and "bone2" in said
    figures = json.loads((tmp_path / "a.json").read_text())
    assert figures["n_shapes"] == 3 and figures["all_certified"] and figures["skipped"] == {}
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 3 and "bone1" in page
    with np.load(out / "population.npz") as data:
        assert data["correspondences"].shape[0] == 3
    assert np.allclose(sm.read(out / "mean.npz").V, data_of(out)["V"])

    (folder / "broken.npz").write_bytes(b"broken")
    try:
        assert run("population", folder, "-o", out, *few, "-q") == 1
    finally:
        (folder / "broken.npz").unlink()
    assert "broken was skipped" in capsys.readouterr().err
    assert "skipped" in (out / "report.html").read_text(encoding="utf-8")
    assert run("population", folder, "-o", out, *few, "-q", "--along", "area") == 2
    assert "other settings" in capsys.readouterr().err


def test_a_finer_result_is_not_replaced_in_silence(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("stretchmap.plot.population_report.write_population_report", lambda *_: 0)
    bones, marks = tmp_path / "bones", tmp_path / "marks"
    bones.mkdir()
    marks.mkdir()
    population = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    for i in range(2):  # by landmarks no pose is searched for
        sm.write(bones / f"bone{i}.npz", population.solids[i])
        np.savetxt(marks / f"bone{i}.csv", population.landmarks[i], delimiter=",")
    out = tmp_path / "run"

    def result(*stop):
        run("population", bones, "-o", out, "-q", "--landmarks", marks, *stop)
        lines = capsys.readouterr().err.splitlines()
        return data_of(out), [line for line in lines if "held the result" in line]

    finer, told = result("--tol", 0, "--max-rounds", 2)
    assert not told
    maps = {path: path.stat().st_mtime_ns for path in (out / "maps").iterdir()}
    coarser, (line,) = result("--tol", 1)
    assert "held the result of 2 rounds" in line and "replaced by that of 1," in line
    assert not np.array_equal(coarser["correspondences"], finer["correspondences"])
    back, told = result("--tol", 0, "--max-rounds", 2)
    assert not told
    np.testing.assert_array_equal(back["correspondences"], finer["correspondences"])
    assert maps == {path: path.stat().st_mtime_ns for path in (out / "maps").iterdir()}
    (out / "population.npz").write_bytes(b"damaged")
    assert not result("--tol", 1)[1]


def data_of(out):
    with np.load(out / "population.npz") as data:
        return dict(data)


def test_bad_usage(folder, tmp_path, capsys):
    assert run("population", tmp_path / "nowhere", "-o", tmp_path / "run") == 2
    assert run("population", folder, "-o", tmp_path / "run", "--executor", "cloud") == 2
    assert "dask://" in capsys.readouterr().err
