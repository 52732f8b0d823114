"""Landmarks of vertebrae by rule: they go with the bone, and carried by the truth they stay."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import stretchmap as sm

ROOM = Path(__file__).resolve().parents[3] / "bench" / "population"


@pytest.fixture(scope="module")
def rule():
    if not ROOM.exists():
        pytest.skip("bench/ is not part of this tree")
    sys.path.insert(0, str(ROOM))
    yield importlib.import_module("landmarks")
    sys.path.remove(str(ROOM))


@pytest.fixture(scope="module")
def bone():
    return sm.samples.vertebra_population(1, 5, n_tets=1500).solids[0]


def test_landmarks_go_with_the_bone(rule, bone):
    random = np.random.default_rng(3)
    Q = np.linalg.qr(random.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    marks = rule.landmarks(bone)
    there = rule.landmarks(sm.TetMesh(bone.V @ Q.T + 3.0, bone.T))
    assert there == pytest.approx(marks @ Q.T + 3.0, abs=1e-6)
    frame = rule.anatomy(bone)
    x, y, z = frame.coordinates(marks).T
    names = list(rule.NAMES)
    for name, side in (("left", 1.0), ("right", -1.0)):
        assert all(side * x[k] > 0.0 for k, full in enumerate(names) if full.endswith(name))
    assert y[names.index("spinous")] == y.min()
    assert z[names.index("superior left")] > z[names.index("inferior left")]


def test_the_truth_carries_landmarks_where_they_are(rule, bone):
    grown = sm.TetMesh(1.25 * bone.V, bone.T)
    marks = [rule.landmarks(bone), rule.landmarks(grown)]
    errors = rule.carried(np.stack([bone.V, grown.V]), bone, marks)
    assert np.isnan(errors[0, 0]).all() and errors.shape == (2, 2, 7)
    reach = rule.TIP * np.linalg.norm(np.ptp(grown.V, axis=0))
    assert np.nanmax(errors) < 2.0 * reach  # tips lie inside, their places on the surface
