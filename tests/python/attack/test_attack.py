"""The scripts of tests/attack, as far as there is time for here."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ATTACK = Path(__file__).resolve().parents[2] / "attack"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("only", "least"),
    [
        ("samples.", 700),
        ("Torus.", 250),
        ("stretchmap.partition", 100),
        ("stretchmap.load_map", 20),
    ],
)
def test_no_hostile_argument_gets_through(only, least):
    run = subprocess.run(
        [sys.executable, ATTACK / "calls.py", "--only", only],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    lines = run.stdout.splitlines() or [run.stderr]
    assert run.returncode == 0, "\n".join(lines[-20:])
    calls, rest = lines[-1].split(" ", 1)
    assert int(calls) > least
    assert rest == "calls, 0 deaths, 0 hangs, 0 foreign errors, 0 silent changes"
