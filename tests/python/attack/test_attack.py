"""The scripts of tests/attack, as far as there is time for here."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ATTACK = Path(__file__).resolve().parents[2] / "attack"


def test_every_public_argument_is_in_the_table():
    assert last_line("calls.py", "--only", "no function")[0] == "0"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("only", "least"),
    [
        ("samples.", 700),
        ("Torus.", 250),
        ("stretchmap.partition", 100),
        ("stretchmap.load_map", 20),
        ("stretchmap.prepare", 140),
        ("Options", 1000),
        ("population.", 600),
        ("energies.", 250),
        ("Population.", 150),
    ],
)
def test_no_hostile_argument_gets_through(only, least):
    calls, rest = last_line("calls.py", "--only", only)
    assert int(calls) > least
    assert rest == "calls, 0 deaths, 0 hangs, 0 foreign errors, 0 silent changes"


@pytest.mark.slow
def test_damaged_files_are_read_for_what_they_say_or_refused():
    for package in ("meshio", "h5py", "skimage"):
        pytest.importorskip(package)
    files, rest = last_line("files.py", "--count", "200")
    assert int(files) > 5000
    assert rest == "files, 0 deaths, 0 hangs, 0 foreign errors, 0 silent changes"


def last_line(script: str, *arguments: str) -> list[str]:
    run = subprocess.run(
        [sys.executable, ATTACK / script, *arguments],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    lines = run.stdout.splitlines() or [run.stderr]
    assert run.returncode == 0, "\n".join(lines[-20:])
    return lines[-1].split(" ", 1)
