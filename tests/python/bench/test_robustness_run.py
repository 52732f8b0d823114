"""The run over random solids: limits, records, resumption and tables."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stretchmap import FillOptions, TetMesh, samples, write

ROOM = Path(__file__).resolve().parents[3] / "bench" / "robustness"
for package in ("manifold3d", "pyacvd", "pytetwild", "rich"):
    pytest.importorskip(package)


@pytest.fixture(autouse=True)
def room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOM))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two solids in files: a torus, and a ball, which is refused."""
    (tmp_path / "set").mkdir()
    for name, solid in (("a", samples.solid_torus(1_500)), ("b", samples.ball(6))):
        np.savez(tmp_path / "set" / f"{name}.npz", V=solid.V, T=solid.T)
    return tmp_path


def test_a_run_records_success_and_refusal_and_is_not_run_twice(folder, capsys) -> None:
    import run

    asked = ["--files", str(folder / "set"), "--out", str(folder / "out"), "--threads", "1"]
    assert run.main(asked) == 1
    good, bad = (
        json.loads((folder / "out" / "volume" / f"set_{name}.json").read_text()) for name in "ab"
    )
    assert good["certified"] and good["converged"] and good["rows_kept"]
    assert 0.0 < good["ratio_min"] <= 1.0 <= good["ratio_max"] and good["cpu_seconds"] > 0.0
    assert (folder / "out" / "volume" / "set_a_map.npz").exists()
    assert not bad["certified"] and "GenusError" in bad["reason"]
    good["reason"] = "from the file"
    (folder / "out" / "volume" / "set_a.json").write_text(json.dumps(good | {"certified": False}))
    assert run.main(asked) == 1
    assert "from the file" in capsys.readouterr().out


def test_surfaces_are_mapped_too(folder, capsys) -> None:
    import run

    write(folder / "ring.ply", samples.torus_surface())
    run.main(["--surfaces", "--files", str(folder / "ring.ply"), "--out", str(folder)])
    [path] = (folder / "area").glob("*.json")
    record = json.loads(path.read_text())
    assert record["certified"] and record["elements"] == samples.torus_surface().n_faces
    assert record["sd"] < 0.01


def test_registrations_with_landmarks_are_guided_by_those_without(tmp_path, monkeypatch) -> None:
    import registrations

    names = ("one", "other")
    monkeypatch.setattr(registrations, "NAMES", names)
    (tmp_path / "meshes").mkdir()
    for seed, name in enumerate(names):
        solid = samples.vertebra_like(3_000, seed=seed)
        np.savez(tmp_path / "meshes" / f"{name}.npz", V=solid.V, T=solid.T)
    asked = [str(tmp_path), "--out", str(tmp_path), "--threads", "1", "--limit", "2"]
    assert registrations.main([*asked, "--only", "one to other"]) == 0
    plain, marked = (
        json.loads((tmp_path / "register" / f"one-other{suffix}.json").read_text())
        for suffix in ("", "-landmarks")
    )
    assert plain["certified"] and plain["landmarks"] == 0
    assert marked["certified"] and marked["landmarks"] == registrations.LANDMARKS
    assert marked["landmark_error"] < 1e-6


def test_registrations_are_told_their_limit(monkeypatch) -> None:
    import register_task
    import task

    class Told(Exception):
        pass

    def register(*given: Any, options: FillOptions, **more: Any) -> None:
        raise Told(options.time_limit)

    monkeypatch.setattr(register_task.sm, "register", register)
    monkeypatch.setattr(task, "load", lambda path: None)
    with pytest.raises(Told, match=r"^0\.25$"):
        register_task.map_registration(
            samples.ball(), {"target": "", "guide": "", "per_element": 0.25}
        )


def test_who_exceeds_the_limit_is_killed_and_recorded(folder: Path) -> None:
    import pool
    from cases import Case

    script = folder / "spin.py"
    script.write_text(
        f"import sys; sys.path.insert(0, {str(ROOM)!r})\n"
        "import task\n"
        "task.limit_processor_time(0.5)\n"
        "while True: pass\n"
    )
    case = Case("set", "a", folder / "set" / "a.npz")
    job: dict[str, Any] = {"kind": "volume", "group": "set", "name": "a", "seed": None, "size": 1.0}
    job |= {"mesh": str(case.path), "record": str(folder / "a.json"), "per_element": 1e-3}
    [record] = pool.run_all([case], [job], processes=1, threads=1, script=script)
    assert record["killed"] and not record["certified"] and "1 ms" in record["reason"]


def test_a_crash_is_recorded_by_its_exception(folder: Path) -> None:
    import pool
    from cases import Case

    script = folder / "crash.py"
    script.write_text("raise ValueError('no\\n  [1, 2]')\n")
    case = Case("set", "a", folder / "set" / "a.npz")
    job: dict[str, Any] = {"kind": "volume", "group": "set", "name": "a", "seed": None, "size": 1.0}
    job |= {"mesh": str(case.path), "record": str(folder / "a.json"), "per_element": 1e-3}
    [record] = pool.run_all([case], [job], processes=1, threads=1, script=script)
    assert not record["killed"] and record["reason"] == "ended with 1: ValueError: no"
    absent = Case("set", "b", folder / "absent.npz")
    [record] = pool.run_all(
        [absent], [job | {"record": str(folder / "b.json")}], processes=1, threads=1
    )
    assert record["reason"] == "there is no such file"


def test_the_quasi_isometry_constant_of_a_linear_map() -> None:
    from figures import quasi_isometry

    solid = samples.solid_torus(1_500)
    stretched = np.array(solid.V) * [3.0, 1.0, 1.0 / 3.0] * 7.0
    assert np.allclose(quasi_isometry(solid, stretched), 3.0)
    turned = np.array(stretched)
    turned[:, 0] *= -1.0
    assert np.isinf(quasi_isometry(solid, turned)).all()
    assert np.isinf(quasi_isometry(TetMesh(solid.V, solid.T), np.zeros_like(solid.V))).all()


def test_seeds() -> None:
    from cases import seeds_of

    assert seeds_of("tune") == list(range(0, 40, 2)) and seeds_of("report") == seeds_of("all")[1::2]
    assert seeds_of("3:6") == [3, 4, 5] and seeds_of("7,1") == [7, 1]
    with pytest.raises(ValueError):
        seeds_of("some")


def test_tables_count_and_name_what_failed(tmp_path: Path) -> None:
    import report

    base = {"kind": "volume", "group": "g", "converged": True, "elements": 10}
    records = [
        {**base, "name": str(k), "certified": k < 3, "mean": 0.01 * k, "reason": f"because {k}"}
        for k in range(4)
    ]
    row = report.table(records).splitlines()[2].strip("| ").split(" | ")
    assert row[:3] == ["g", "4", "3"]
    assert "0.015 / 0.0285" in row
    assert report.reasons(records[3:]).splitlines()[2:] == ["| g | 3 | because 3 |"]
    assert math.isnan(report.quantile(records, "sd", 0.5))
    document = tmp_path / "d.md"
    document.write_text("a\n<!-- t -->\nold\n<!-- end of t -->\nb\n")
    report.put(document, "t", "new")
    report.put(document, "t", "newer")
    text = document.read_text()
    assert "newer" in text and "old" not in text and text.startswith("a\n") and text.endswith("b\n")
    with pytest.raises(ValueError):
        report.put(document, "absent", "x")
