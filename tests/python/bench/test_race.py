"""The race of four methods, on a small solid: one energy, one start, one minimum."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from stretchmap import samples

RACE = Path(__file__).resolve().parents[3] / "bench" / "race"


MODULES = ("problem", "newton", "first_order", "draw", "cholmod", "run")  # others have a run, too


@pytest.fixture
def problems(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    pytest.importorskip("matplotlib")
    monkeypatch.syspath_prepend(str(RACE))
    for name in MODULES:
        sys.modules.pop(name, None)
    yield importlib.import_module("problem")
    for name in MODULES:
        sys.modules.pop(name, None)


def test_all_methods_reach_the_same_minimum_without_a_fold(problems: ModuleType) -> None:
    problem, begin = problems.make_problem(samples.bumpy_torus(600))
    rows = importlib.import_module("run").race(problem, limit=30.0)
    assert begin == "harmonic start" and len(rows) == 4
    start = problem.energy.value(problem.start)
    least = min(found[-1]["energy"] for found in rows.values())
    assert least < start
    for found in rows.values():
        energies = np.array([row["energy"] for row in found])
        assert energies[0] == start and np.isfinite(energies).all()
        assert energies[-1] == pytest.approx(least, rel=1e-6)


def test_a_method_is_stopped_at_its_limit(problems: ModuleType) -> None:
    problem, _ = problems.make_problem(samples.bumpy_torus(600))
    rows = importlib.import_module("run").race(problem, limit=0.0)
    assert all(len(found) <= 2 for found in rows.values())


def test_the_picture_is_drawn_from_the_rows(problems: ModuleType, tmp_path: Path) -> None:
    rows = {"solid": {"method": [{"seconds": s, "energy": 2.0 - s, "worst": 3.0} for s in (0, 1)]}}
    draw = importlib.import_module("draw")
    draw.draw(rows, tmp_path / "race.png")
    assert (tmp_path / "race.png").stat().st_size > 1000
    assert "| method | 1.00 | 1 |" in draw.table(rows)
