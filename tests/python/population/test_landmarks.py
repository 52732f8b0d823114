"""Landmarks in files: where there are none, that is said, and where they were looked for."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.errors import LandmarkError, SolverError


@pytest.fixture
def folder(tmp_path):
    """Five shapes, and before them one that is none."""
    solid = sm.samples.solid_torus(600)
    for i in range(5):
        sm.write(tmp_path / f"bone {i}.npz", solid)
    (tmp_path / "bad.npz").write_bytes(b"no bone")
    (tmp_path / "marks").mkdir()
    return tmp_path


def test_shapes_without_landmarks_are_counted(folder):
    marks = folder / "marks"
    for missing, names in (
        (6, "bad.csv, bone 0.csv, bone 1.csv, bone 2.csv, bone 3.csv, ..."),
        (5, "bad.csv, bone 0.csv, bone 1.csv, bone 2.csv, bone 3.csv"),
    ):
        with pytest.raises(LandmarkError) as caught:
            sm.population.fit(folder, landmarks=marks, folder=folder / "run")
        said = str(caught.value)
        assert said.startswith(f"{missing} of 6 shapes have no landmarks, two shapes with them")
        assert said.endswith(f"in {marks} there is no {names}")
        assert not (folder / "run").exists()
        np.savetxt(marks / "bone 4.csv", np.eye(3), delimiter=",")


def test_shapes_without_landmarks_are_told_from_those_that_cannot_be_read(folder):
    for name in ("bad", "bone 0"):
        np.savetxt(folder / "marks" / f"{name}.csv", np.eye(3), delimiter=",")
    (folder / "bone 0.npz").write_bytes(b"no bone")
    message = (
        r"no shape can be read; bad: .*bad.npz cannot be read.*; 4 of 6 have no landmarks in "
        r".*marks: bone 1, bone 2, bone 3, bone 4$"
    )
    with pytest.raises(SolverError, match=message):
        sm.population.fit(folder, landmarks=folder / "marks")
