"""Stages of surface maps against the number of faces: the table is that of the rows."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import stretchmap as sm

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    yield importlib.import_module("surface_stages")
    for name in ("surface_stages", "speed_page"):
        sys.modules.pop(name, None)


def test_generated_and_divided_surfaces_are_tori(bench: ModuleType) -> None:
    surface = bench.generated(2000)
    fine = bench.divided(surface)
    assert fine.n_faces == 4 * surface.n_faces
    assert fine.area == pytest.approx(surface.area)
    for mesh in (surface, fine):
        diagnosis = mesh.diagnose()
        assert diagnosis.ok
        assert list(diagnosis.genus) == [1]
    assert sm.certify(surface, surface.V).certified  # it does not cross itself


def test_the_page_shows_the_rows(bench: ModuleType) -> None:
    rows = json.loads((ROOT / "docs" / "data" / "surfaces.json").read_text())
    assert bench.table(rows) in (ROOT / "docs" / "speed.md").read_text()


def test_growth_is_the_exponent(bench: ModuleType) -> None:
    rows = [{"faces": n, "seconds": {"area": 1e-6 * n**1.5}} for n in (100, 1000, 10_000)]
    assert bench.growth(rows, "area") == pytest.approx(1.5)
