"""The scripts of tests/attack, as far as there is time for here."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ATTACK = Path(__file__).resolve().parents[2] / "attack"


LEAST_CALLS = {
    "samples.": 700,
    "Torus.": 250,
    "stretchmap.partition": 100,
    "stretchmap.load_map": 20,
    "stretchmap.prepare": 140,
    "Options": 1000,
    "population.": 600,
    "energies.": 250,
    "Population.": 150,
}


# The table is made anew by every run of the script, hence one for all.
@pytest.mark.slow
def test_every_argument_is_in_the_table_and_no_hostile_one_gets_through():
    *_, last = rooms = lines("calls.py", "--only", *LEAST_CALLS)
    calls = dict(line.rsplit(": ", 1) for line in rooms[:-1])
    assert calls.keys() == LEAST_CALLS.keys()
    assert {room for room, least in LEAST_CALLS.items() if int(calls[room]) <= least} == set()
    assert last.endswith(" calls, 0 deaths, 0 hangs, 0 foreign errors, 0 silent changes")


@pytest.mark.slow
def test_damaged_files_are_read_for_what_they_say_or_refused():
    for package in ("meshio", "h5py", "skimage"):
        pytest.importorskip(package)
    files, rest = lines("files.py", "--count", "60")[-1].split(" ", 1)
    assert int(files) > 1500
    assert rest == "files, 0 deaths, 0 hangs, 0 foreign errors, 0 silent changes"


def lines(script: str, *arguments: str) -> list[str]:
    run = subprocess.run(
        [sys.executable, ATTACK / script, *arguments],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    printed = run.stdout.splitlines() or [run.stderr]
    assert run.returncode == 0, "\n".join(printed[-20:])
    return printed
