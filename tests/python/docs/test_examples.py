"""Every example runs, in a process of its own, and writes what it says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[3]
_OUTPUT = {
    "01_map_a_solid": "map.npz",
    "02_partition_into_fifths": "parts.vtu",
    "03_coordinates_and_grid": "grid.vtu",
    "04_register_vertebrae": "registration.npz",
    "05_morph_and_transfer": "morph.pvd",
    "06_compare_methods": "comparison.png",
    "07_population": "population.npz",
    "08_finite_elements": "energies.png",
}


@pytest.mark.parametrize(
    "path", sorted((_ROOT / "examples").glob("[0-9]*.py")), ids=lambda p: p.stem
)
def test_example(path, tmp_path):
    output = _OUTPUT.get(path.stem)
    run = subprocess.run(
        [sys.executable, str(path), *([output] if output else [])],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip()
    if output:
        assert (tmp_path / output).stat().st_size > 0
