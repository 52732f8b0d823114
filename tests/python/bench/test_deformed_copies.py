"""A solid and a copy of it, deformed smoothly and remeshed, are registered on each other."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import stretchmap as sm

ROOM = Path(__file__).resolve().parents[3] / "bench" / "robustness"
for package in ("manifold3d", "pyacvd", "pytetwild", "skimage", "tetgen"):
    pytest.importorskip(package)


@pytest.fixture(autouse=True)
def room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOM))


@lru_cache(maxsize=4)
def pair(name: str, seed: int) -> tuple[sm.TetMesh, sm.TetMesh]:
    from copies import pair_of

    return pair_of(name, seed, 0.3)


@pytest.mark.parametrize(
    ("name", "seed", "back"),
    [
        ("even_tubes", 3602, True),
        ("bottles", 3603, False),
        ("bottles", 3603, True),
        ("bottles", 4001, False),  # laid well enough, but stuck inside
        ("drilled_even", 4102, True),  # the deformation crosses
    ],
)
def test_where_flat_tori_mislead_space_does_not(name, seed, back):
    source, target = reversed(pair(name, seed)) if back else pair(name, seed)
    result = sm.register(source, target, options=sm.FillOptions(time_limit=3e-3))
    assert result.certificate.certified
    assert result.gauge.rule == "smooth fit"
    assert result.distortion.element_error_mean < 0.08


def test_landmarks_stay_where_they_belong():
    from copies import deformed
    from scipy.spatial import cKDTree

    solid, copy = pair("bottles", 3603)
    there = deformed(solid.surface.V, np.random.default_rng([3603, 17]))
    rows = np.arange(0, len(there), len(there) // 8)
    goals = copy.boundary_vertices[cKDTree(copy.surface.V).query(there[rows])[1]]
    marks = (goals, solid.boundary_vertices[rows])
    result = sm.register(copy, solid, marks, options=sm.FillOptions(time_limit=3e-3))
    assert result.certificate.certified and result.landmark_error == 0.0
    assert result.gauge.rule == "smooth fit"
    assert result.distortion.element_error_mean < 0.08


def test_the_run_leaves_records_and_a_table(tmp_path, capsys):
    from copies import main

    assert (
        main(["--families", "knots", "--seeds", "1", "--size", "0.1", "--out", str(tmp_path)]) == 0
    )
    assert "| knots | 2 | 2 | 2 |" in capsys.readouterr().out
    assert len(list((tmp_path / "copies").glob("knots_1_0.1*.json"))) == 2
