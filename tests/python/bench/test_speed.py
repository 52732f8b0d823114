"""Two builds side by side: the table is that of the rows, and what a row is made of."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    yield importlib.import_module("speed")
    for name in ("speed", "surface_stages", "speed_page"):
        sys.modules.pop(name, None)


def test_the_page_shows_the_rows(bench: ModuleType) -> None:
    data = json.loads((ROOT / "docs" / "data" / "speed.json").read_text())
    assert bench.table(data) in (ROOT / "docs" / "speed.md").read_text()
    methods = {row["method"] for row in data["rows"]}
    assert methods == {"certified", "vsem", bench.SURFACE}


def test_workers_measure_solids_and_surfaces(bench: ModuleType) -> None:
    solid = bench.worker({"mesh": "600", "arguments": {}})
    surface = bench.surface_worker(600)
    for row, n in ((solid, 600), (surface, 600)):
        assert row["certified"] and 0.5 * n < row["elements"] < 2.0 * n
        assert row["processor_seconds"] > 0.0 and 0.0 < row["ratio_std"] < 0.05


def test_rows_that_are_there_are_kept_or_replaced(
    bench: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    told, file = [], tmp_path / "rows.json"

    def run(script: str, arguments: list[str], threads: int, package: Path) -> dict[str, float]:
        told.append((json.loads(arguments[0]), threads, package.name))
        return {"processor_seconds": float(len(told)), "elements": 1}

    monkeypatch.setattr(bench, "run_worker", run)
    monkeypatch.setattr(bench, "show", lambda *_: None)
    monkeypatch.setattr(bench, "table", lambda _: "")
    common = ["--before", "old", "--after", "new", "--json", str(file), "--meshes", str(tmp_path)]
    few = ["--threads", "1", "--cases", "100"]
    assert bench.main([*common, *few, "--methods", "vsem", "--surfaces", "200"]) == 0
    assert [job.get("surface") for job, _, _ in told] == [None, None, 200, 200]
    assert [name for _, _, name in told] == ["old", "new"] * 2
    assert bench.main([*common, *few, "--methods", "vsem", "--surfaces"]) == 0  # in their places
    rows = json.loads(file.read_text())["rows"]
    found = [(r["method"], r["build"], r["processor_seconds"]) for r in rows]
    assert found == [("vsem", "before", 5), ("vsem", "after", 6), ("area", "before", 3),
                     ("area", "after", 4)]  # fmt: skip
