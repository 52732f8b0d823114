"""Every example runs, in a process of its own, and writes what it says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

try:
    import resource
except ImportError:  # no such thing on Windows
    resource = None

_ROOT = Path(__file__).resolve().parents[3]
_SECONDS = 120  # of processor time: beside other work the clock tells nothing of an example
_HANGS = 1800
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


def _spent() -> float:
    if resource is None:
        return 0.0
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@pytest.mark.parametrize(
    "path", sorted((_ROOT / "examples").glob("[0-9]*.py")), ids=lambda p: p.stem
)
def test_example(path, tmp_path):
    output, before = _OUTPUT.get(path.stem), _spent()
    run = subprocess.run(
        [sys.executable, str(path), *([output] if output else [])],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        timeout=_HANGS if resource else _SECONDS,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert _spent() - before < _SECONDS
    assert run.stdout.strip()
    if output:
        assert (tmp_path / output).stat().st_size > 0
