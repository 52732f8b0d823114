"""No mesh, however damaged, crashes the process, and each gets its own clear exception.

Every entry point runs in a process of its own, so that a crash is a failed test with the name of
the defect and not the end of the test run.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import defect_table
import entry_points

HERE = Path(__file__).parents[1]
ENTRIES = {entry.name: entry for entry in entry_points.ENTRIES}


@pytest.fixture(scope="module")
def runs():
    """Exit code and lines of every entry."""
    process = subprocess.run(
        [sys.executable, "-X", "faulthandler", str(HERE / "entry_points.py"), *ENTRIES],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    found, lines = {}, []
    for line in map(json.loads, process.stdout.splitlines()):
        if "entry" in line:
            found[line["entry"]] = line["code"], lines
            lines = []
        else:
            lines.append(line)
    assert found.keys() == ENTRIES.keys(), process.stderr[-3000:]
    return found, process.stderr


@pytest.mark.parametrize("name", ENTRIES)
def test_entry_point_against_every_defect(name, runs):
    entry, (found, errors) = ENTRIES[name], runs
    code, lines = found[name]
    assert code == 0, f"died at {lines[-1:]}: {errors[-3000:]}"
    outcomes = {line["name"]: line for line in lines if "name" in line}
    assert outcomes["sound"]["error"] is None, outcomes["sound"]
    depth = defect_table.DEPTHS.index(entry.depth)
    for defect in entry_points.expected(entry):
        outcome = outcomes[defect.name]
        said = f"{name} on {defect.name}: {outcome}"
        if defect_table.DEPTHS.index(defect.depth) > depth:
            # Not this entry's business: it may work, or refuse for a reason of its own.
            assert outcome["error"] is None or "StretchmapError" in outcome["mro"], said
            continue
        assert outcome["error"] == defect.error.__name__, said
        if defect.ids is not None:
            assert sorted(outcome["ids"]) == sorted(defect.ids), said
        else:
            assert outcome["ids"], said
        assert 20 < len(outcome["message"]) < 400 and "\n" not in outcome["message"], said


def test_messages_tell_the_faults_apart():
    """Mis-oriented, non-manifold, wrong genus, disconnected, open: five different messages."""
    said = {}
    for defect in defect_table.surface_defects():
        points, faces = defect.arrays()
        with pytest.raises(defect.error) as caught:
            entry_points.TriMesh(points, faces).require_genus_one()
        said.setdefault(defect.error.__name__, set()).add(
            re.sub(r"\d+|\(.*?\)", "", str(caught.value))
        )
    kinds = {"OrientationError", "NonManifoldError", "GenusError", "ConnectivityError"}
    assert kinds | {"OpenSurfaceError", "DegenerateError"} == said.keys()
    sentences = [sentence for group in said.values() for sentence in group]
    assert len(set(sentences)) == len(sentences)


def test_the_table_is_about_one_defect_each():
    """A defect of the table has the defect it names and no other, or the table proves little."""
    several = {"edge of three faces", "face of many tets", "one point"}
    for kind, mesh in (("surface", entry_points.TriMesh), ("solid", entry_points.TetMesh)):
        for defect in defect_table.DEFECTS[kind]:
            if defect.depth == "closed" and defect.name not in several:
                found = mesh(*defect.arrays()).diagnose().defects
                assert len(found) == 1, (defect.name, [d.message for d in found])
