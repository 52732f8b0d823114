"""The run over prescribed boundaries, on a set of one small mesh made here."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from stretchmap import samples

SCRIPT = Path(__file__).resolve().parents[3] / "bench" / "volmap" / "run.py"
pytest.importorskip("rich")
pytest.importorskip("manifold3d")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A ball with a star-shaped image of its boundary, and one turned inside out."""
    solid = samples.ball(4)
    ids = solid.boundary_vertices
    at = np.array(solid.V[ids])
    wave = 1.0 + 0.3 * np.cos(4.0 * at[:, :1]) * np.cos(3.0 * at[:, 1:2])
    (tmp_path / "set").mkdir()
    np.savez(
        tmp_path / "set" / "ball.npz",
        V=solid.V, T=solid.T[:, [1, 0, 2, 3]], ids=ids, star=at * wave, cube=-at,
    )  # fmt: skip
    return tmp_path


def run(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), str(folder / "set"), "--out", str(folder / "out")]
    return subprocess.run([*command, "--threads", "1", *more], capture_output=True, text=True)


def test_a_map_counts_when_everything_holds(folder: Path) -> None:
    done = run(folder, "--only", "ball/star")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 of 1 count" in done.stdout
    record = json.loads((folder / "out" / "ball_star.json").read_text())
    assert record["certified"] and record["boundary_exact"] and record["rows_kept"]
    assert (folder / "out" / "ball_star_map.npz").exists()


def test_what_is_refused_does_not_count(folder: Path) -> None:
    done = run(folder)
    assert done.returncode == 1 and "1 of 2 count" in done.stdout
    record = json.loads((folder / "out" / "ball_cube.json").read_text())
    assert not record["certified"] and record["reason"]
