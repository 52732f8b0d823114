"""The scripts on populations run to their end, on small shapes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOM = Path(__file__).resolve().parents[3] / "bench" / "population"


@pytest.mark.parametrize(
    ("script", "arguments", "said"),
    [
        ("coordinates.py", ("--shapes", "2", "--tets", "1000"), "s: "),
        ("gliding.py", ("--seeds", "51", "--tets", "1000"), "ended glide"),
    ],
)
def test_scripts(script: str, arguments: tuple[str, ...], said: str) -> None:
    if not ROOM.exists():
        pytest.skip("bench/ is not part of this tree")
    done = subprocess.run(
        [sys.executable, str(ROOM / script), *arguments],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert said in done.stdout
