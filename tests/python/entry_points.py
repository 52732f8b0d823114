"""Every public entry point that takes a mesh, to be run against every defect.

`ENTRIES` is the list to extend: a name, the kind of mesh, the function, and how far it looks
(``"arrays"`` at the arrays alone, ``"closed"`` also at the topology of any genus, ``"torus"`` also
at the genus). Run as a program this module goes through all defects for the entries named and
prints one line of JSON for each, so that a crash shows which one did it; of several entries, each
in a process of its own, one more line with its exit code.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import stretchmap
from defect_table import BASES, DEFECTS, Defect
from stretchmap import TetMesh, TriMesh, errors
from stretchmap.mesh.refinement import refine_overconstrained


@dataclass(frozen=True)
class Entry:
    """A function of raw arrays that is to notice every defect up to its depth."""

    name: str
    kind: str
    depth: str
    call: Callable[[Any, Any], Any]
    without: tuple[str, ...] = ()  # defects that cannot get there


NOT_IN_FILES = ("ragged points", "no points")


def through_file(points: Any, elements: Any, key: str) -> Any:
    """Write the arrays as they are and read them back."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.npz"
        np.savez(path, V=np.asarray(points), **{key: np.asarray(elements)})
        return stretchmap.read(path)


def diagnosed(mesh: Any) -> Any:
    """Raise the first defect `diagnose` lists, after its summary has been made."""
    found = mesh.diagnose()
    assert found.summary().count("\n") == max(len(found.defects), 1)
    found.require()
    return found


def every_property(mesh: Any) -> None:
    """All lazy properties: each has a value or a reason."""
    names = [n for n in dir(type(mesh)) if isinstance(getattr(type(mesh), n), property)]
    names += ["topology", "edges", "area", "volume"] if isinstance(mesh, TriMesh) else []
    names += ["surface", "edges", "tet_volumes"] if isinstance(mesh, TetMesh) else []
    for name in names:
        try:
            getattr(mesh, name)
        except errors.MeshError as error:
            assert str(error)


def homology_of(mesh: TetMesh) -> Any:
    """Homology of the boundary with labels from inside."""
    return stretchmap.homology_basis(mesh.surface, mesh)


ENTRIES = [
    Entry("TriMesh", "surface", "arrays", TriMesh),
    Entry("TriMesh orient", "surface", "arrays", lambda V, F: TriMesh(V, F, orient=True)),
    Entry("TriMesh properties", "surface", "arrays", lambda V, F: every_property(TriMesh(V, F))),
    Entry("TriMesh.compact", "surface", "arrays", lambda V, F: TriMesh(V, F).compact()),
    Entry("TriMesh.diagnose", "surface", "closed", lambda V, F: diagnosed(TriMesh(V, F))),
    Entry("require_closed", "surface", "closed", lambda V, F: TriMesh(V, F).require_closed()),
    Entry("require_genus_one", "surface", "torus", lambda V, F: TriMesh(V, F).require_genus_one()),
    Entry("TetMesh", "solid", "arrays", TetMesh),
    Entry("TetMesh orient", "solid", "arrays", lambda V, T: TetMesh(V, T, orient=True)),
    Entry("TetMesh properties", "solid", "arrays", lambda V, T: every_property(TetMesh(V, T))),
    Entry("TetMesh.compact", "solid", "arrays", lambda V, T: TetMesh(V, T).compact()),
    Entry("TetMesh.diagnose", "solid", "closed", lambda V, T: diagnosed(TetMesh(V, T))),
    Entry(
        "require_solid_torus", "solid", "torus", lambda V, T: TetMesh(V, T).require_solid_torus()
    ),
    Entry("read surface", "surface", "arrays", lambda V, F: through_file(V, F, "F"), NOT_IN_FILES),
    Entry("read solid", "solid", "arrays", lambda V, T: through_file(V, T, "T"), NOT_IN_FILES),
    Entry(
        "homology_basis",
        "surface",
        "closed",
        lambda V, F: stretchmap.homology_basis(TriMesh(V, F)),
    ),
    Entry(
        "holomorphic_forms",
        "surface",
        "closed",
        lambda V, F: stretchmap.holomorphic_forms(TriMesh(V, F)),
    ),
    Entry(
        "conformal_map", "surface", "torus", lambda V, F: stretchmap.conformal_map(TriMesh(V, F))
    ),
    Entry(
        "area_map",
        "surface",
        "torus",
        lambda V, F: stretchmap.area_map(TriMesh(V, F), phase=0.0, sem_iter=2),
    ),
    Entry(
        "distortion of a surface",
        "surface",
        "arrays",
        lambda V, F: stretchmap.distortion(TriMesh(V, F), 2 * TriMesh(V, F).V),
    ),
    Entry(
        "distortion of a solid",
        "solid",
        "arrays",
        lambda V, T: stretchmap.distortion(TetMesh(V, T), 2 * TetMesh(V, T).V),
    ),
    Entry(
        "volume_map",
        "solid",
        "torus",
        lambda V, T: stretchmap.volume_map(TetMesh(V, T), c=0.0, max_iter=1),
    ),
    Entry(
        "register",
        "solid",
        "torus",
        lambda V, T: stretchmap.register(TetMesh(V, T), stretchmap.samples.solid_torus(400)),
    ),
    Entry(
        "certify a surface",
        "surface",
        "arrays",
        lambda V, F: stretchmap.certify(TriMesh(V, F), TriMesh(V, F).V),
    ),
    Entry(
        "certify a solid",
        "solid",
        "arrays",
        lambda V, T: stretchmap.certify(TetMesh(V, T), TetMesh(V, T).V),
    ),
    Entry(
        "refine_overconstrained",
        "solid",
        "arrays",
        lambda V, T: refine_overconstrained(TetMesh(V, T)),
    ),
    Entry(
        "homology_basis of a solid",
        "solid",
        "arrays",
        lambda V, T: homology_of(TetMesh(V, T)),
    ),
]


def expected(entry: Entry) -> list[Defect]:
    """The defects that can reach an entry point."""
    return [d for d in DEFECTS[entry.kind] if d.name not in entry.without]


def run(entry: Entry) -> None:
    """Print what each defect, and the sound mesh, leads to."""
    cases = [("sound", BASES[entry.kind])]
    cases += [(defect.name, defect.arrays) for defect in expected(entry)]
    for name, arrays in cases:
        print(json.dumps({"at": name}), flush=True)
        points, elements = arrays()
        outcome: dict[str, Any] = {"name": name, "error": None, "ids": [], "mro": []}
        try:
            entry.call(points, elements)
        except Exception as error:
            outcome = {
                "name": name,
                "error": type(error).__name__,
                "message": str(error),
                "ids": list(getattr(error, "ids", [])),
                "mro": [kind.__name__ for kind in type(error).__mro__],
            }
        print(json.dumps(outcome), flush=True)


def run_apart(entry: Entry) -> int:
    """`run` in a process of its own: a fork, which is quick, or this program once more."""
    if not hasattr(os, "fork"):
        return subprocess.run([sys.executable, __file__, entry.name], check=False).returncode
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    try:
        run(entry)
        os._exit(0)
    except BaseException:
        traceback.print_exc()
        os._exit(1)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    names = sys.argv[1:]
    for entry in ENTRIES:
        if names == [entry.name]:
            run(entry)
        elif entry.name in names:
            print(json.dumps({"entry": entry.name, "code": run_apart(entry)}), flush=True)
