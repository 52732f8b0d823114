"""The script that flags regressions of the benchmark executable."""

from __future__ import annotations

import copy
import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

_BENCH = Path(__file__).resolve().parents[3] / "bench"


@pytest.fixture(scope="module")
def regression() -> ModuleType:
    spec = importlib.util.spec_from_file_location("regression", _BENCH / "regression.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def row(name: str, milliseconds: float) -> dict[str, Any]:
    return {"name": f"{name}/threads:1", "cpu_time": milliseconds}


def rows(factor: float = 1.0, slow: float = 1.0, flips: int = 0) -> list[dict[str, Any]]:
    """A made-up run, copies at 1 GB/s: everything ``factor`` slower, one stage ``slow`` besides."""
    return [
        {**row("bandwidth/copy", 1.0), "real_time": 2.0, "bytes_per_second": 0.5e9 / factor},
        row("sample/9", 7.0),
        {**row("volume.assemble/9", 2.0 * factor), "bytes": 1e6},
        {**row("volume.vsem/9", 8.0 * factor * slow), "flips": flips},
    ]


def test_a_ratio_is_what_it_says(regression: ModuleType) -> None:
    summary = regression.summarize([rows(), rows(slow=3.0)])
    # Geometric mean of 2 and 8 ms; copying 1e6 bytes takes 1 ms.
    assert summary["overall"] == pytest.approx(4.0)
    assert summary["stages"]["volume.vsem/9/threads:1"] == pytest.approx(2.0)
    assert not any("sample" in name for name in summary["stages"])


def test_a_slower_machine_is_no_regression(regression: ModuleType) -> None:
    base = regression.summarize([rows()])
    assert regression.regressions(regression.summarize([rows(factor=5.0)]), base, 1.01) == []


def test_a_slower_stage_and_a_wrong_result_are(regression: ModuleType) -> None:
    base = regression.summarize([rows()])
    found = regression.regressions(regression.summarize([rows(slow=4.0)]), base, 1.6)
    assert [line.split(":")[0] for line in found] == ["volume.vsem/9/threads"]
    found = regression.regressions(regression.summarize([rows(flips=1)]), base, 1.6)
    assert found == ["volume.vsem/9/threads:1 flips: 1 instead of 0"]


def test_everything_slower_is(regression: ModuleType) -> None:
    base = regression.summarize([rows()])
    slower = copy.deepcopy(rows())
    for stage in slower[1:]:
        stage["cpu_time"] *= 3.0
    found = regression.regressions(regression.summarize([slower]), base, 1.6)
    assert found == ["all stages: 3.00 times the baseline"]


def test_the_executable_itself(
    regression: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if regression.find_executable() is None:
        pytest.skip("stretchmap_bench is not built")
    stored = tmp_path / "baseline.json"
    common = ["--baseline", str(stored), "--size", "3000", "--repeat", "1"]
    assert regression.main([*common, "--update"]) == 0
    # Tiny stages on a busy machine: only the exact figures are asked for here.
    assert regression.main([*common, "--margin", "1e6"]) == 0
    assert "no regression" in capsys.readouterr().out
    base = stored.read_text()
    stored.write_text(base.replace('genus": 1', 'genus": 2'))
    assert regression.main([*common, "--margin", "1e6"]) == 1
    assert "genus: 1 instead of 2" in capsys.readouterr().out


def test_another_processor_needs_a_baseline_of_its_own(
    regression: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored = tmp_path / "baseline.json"
    stored.write_text('{"a slide rule": {}}')
    executable = tmp_path / "stretchmap_bench"
    executable.touch()
    assert regression.main(["--baseline", str(stored), "--executable", str(executable)]) == 2
    assert "--update" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timing
def test_nothing_got_slower_than_the_baseline(
    regression: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    code = regression.main([])
    printed = capsys.readouterr()
    if code == 2:
        pytest.skip(printed.err.strip())
    assert code == 0, printed.out


@pytest.mark.slow
@pytest.mark.timing
def test_a_stage_slowed_on_purpose_is_found(
    regression: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if regression.find_executable() is None:
        pytest.skip("stretchmap_bench is not built")
    common = ["--baseline", str(tmp_path / "baseline.json"), "--size", "3000"]
    assert regression.main([*common, "--update"]) == 0
    area_map = regression.sm.area_map
    monkeypatch.setattr(regression.sm, "area_map", lambda s: [area_map(s) for _ in range(4)][-1])
    assert regression.main(common) == 1
    assert "REGRESSION map.area/3000" in capsys.readouterr().out
