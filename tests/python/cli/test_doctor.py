"""The command doctor."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import pytest

import stretchmap as sm
from stretchmap.cli import main
from stretchmap.volume import map as volume

pytest.importorskip("typer")


def test_doctor_tells_versions_and_maps_a_solid(tmp_path, capsys):
    assert main(["doctor", "--json", str(tmp_path / "report.json")]) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["stretchmap"] == sm.__version__
    assert report["self-test"].startswith("passed")
    assert int(report["threads"].split()[0]) >= 1
    assert report["OpenMP"].startswith("not used") and report["BLAS of NumPy"]
    assert "typer" in report["extra cli"] and "scikit-fem" in report["extra fem"]
    assert report["self-test"] in capsys.readouterr().out


def test_doctor_knows_every_extra_that_users_install():
    from stretchmap.cli.doctor import _EXTRAS

    tomllib = pytest.importorskip("tomllib")
    project = Path(__file__).resolve().parents[3] / "pyproject.toml"
    extras = tomllib.loads(project.read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for name in extras.keys() - {"bench", "test", "docs", "all"}:
        packages = {re.match(r"[\w-]+", requirement)[0] for requirement in extras[name]}
        assert packages == set(_EXTRAS[name]), name


def test_doctor_fails_when_maps_do(monkeypatch):
    def refuse(*args, **options):
        raise sm.errors.SolverError("broken on purpose")

    monkeypatch.setattr(volume, "volume_map", refuse)
    assert main(["doctor", "--quiet"]) == 1


def test_doctor_sees_results_that_depend_on_threads(monkeypatch):
    right = volume.volume_map

    def other(solid, *, threads=None):
        result = right(solid, threads=1)
        return result if threads else dataclasses.replace(result, image=result.image + 1e-9)

    monkeypatch.setattr(volume, "volume_map", other)
    assert main(["doctor", "--quiet"]) == 1
