"""Filling with tets by the optional package pytetwild (fTetWild, MPL 2.0).

Hu, Schneider, Wang, Zorin, Panozzo (ACM TOG 39(4), 2020): the surface is kept within an envelope
and need not be clean. What comes back has a boundary of its own, which does not cross itself.
"""

from __future__ import annotations

import importlib.util
import math
import re
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.child import run_script
from ..errors import MeshError, MissingDependencyError, SolverError
from ..mesh.meshes import TetMesh, TriMesh
from .soup import labels

__all__ = ["chosen_filler", "fill_within_envelope", "has_ftetwild", "run_ftetwild"]

_ENVELOPE = 5e-4  # of the diagonal of the bounding box
_SECONDS = 60.0  # given to any surface, and
_SECONDS_PER_FACE = 0.05  # twenty-five times what even ones take
_SCRIPT = """
import json, sys, numpy, pytetwild
data = numpy.load("surface.npz")
V, T = pytetwild.tetrahedralize(
    data["V"], data["F"], num_threads=1, **json.loads(sys.argv[1]))
numpy.savez("solid.npz", V=V, T=T)
"""


def has_ftetwild() -> bool:
    """Whether pytetwild is installed."""
    return importlib.util.find_spec("pytetwild") is not None


def chosen_filler(wanted: str) -> str:
    """What fills: as wanted, or the one that is installed.

    Raises
    ------
    MissingDependencyError
        Neither is, or not the one wanted.
    """
    there = {
        "tetgen": importlib.util.find_spec("tetgen") is not None,
        "ftetwild": has_ftetwild(),
    }
    if wanted == "auto" and any(there.values()):
        return next(name for name, installed in there.items() if installed)
    if not there.get(wanted, False):
        raise MissingDependencyError(
            "filling with tets needs pytetwild, pip install 'stretchmap[prepare]', or tetgen, pip "
            "install 'stretchmap[mesh]'"
        )
    return wanted


def fill_within_envelope(surface: TriMesh, edge: float) -> TetMesh:
    """Tets with edges of about this length, the boundary within 1 / 2000 of the size.

    Parameters
    ----------
    surface : TriMesh
        It may cross itself; then what it winds round once or more is inside.
    edge : float

    Returns
    -------
    TetMesh
        One piece, the largest. fTetWild makes other tets of the same surface each time.

    Raises
    ------
    MissingDependencyError
        If ``pytetwild`` is not installed.
    SolverError
        If it gives up, or nothing is inside, or it takes longer than a minute and a twentieth
        of a second per boundary face aimed at: among long, thin triangles it may go on for hours.
    """
    if not has_ftetwild():
        raise MissingDependencyError(
            "filling a surface within an envelope needs pytetwild: "
            "pip install 'stretchmap[prepare]'"
        )
    options = {"edge_length_abs": edge, "epsilon": _ENVELOPE, "simplify": False}
    aimed = surface.area / (math.sqrt(3.0) / 4.0 * edge**2)
    V, T = run_ftetwild(surface, options, _SECONDS + _SECONDS_PER_FACE * aimed)
    try:
        return _largest(TetMesh(V, T, orient=True))
    except MeshError as error:
        raise SolverError(f"fTetWild found no solid inside the surface ({error})") from error


def run_ftetwild(
    surface: TriMesh, options: dict[str, Any], seconds: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Points and tets as pytetwild makes them of a surface, on one thread.

    In a process and a folder of its own: what it meets on the way may abort it, and it leaves files
    where it runs. It ends with the call, on an interrupt too.

    Raises
    ------
    SolverError
        If it gives up, or is not done after so many seconds.
    MissingDependencyError
        If something it needs is not installed.
    """
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder, "surface.npz"), V=surface.V, F=surface.F)
        try:
            run = run_script(_SCRIPT, options, folder, timeout=seconds)
        except subprocess.TimeoutExpired as error:
            raise SolverError(
                f"fTetWild was not done with {surface.n_faces} faces after {seconds:.0f} seconds; "
                "ask for fewer faces, split long, thin triangles, or fill with tetgen"
            ) from error
        out = Path(folder, "solid.npz")
        if run.returncode or not out.exists():
            said = run.stderr.strip().splitlines() or ["no reason given"]
            if missing := re.fullmatch(r"ModuleNotFoundError: No module named '(\w+)'.*", said[-1]):
                raise MissingDependencyError(
                    f"fTetWild needs {missing[1]}: pip install 'stretchmap[prepare]'"
                )
            raise SolverError(f"fTetWild gives up on the surface ({said[-1]})")
        with np.load(out) as found:
            return found["V"], found["T"]


def _largest(solid: TetMesh) -> TetMesh:
    """The component with the largest volume, without unused vertices."""
    label = labels(solid.n_vertices, np.repeat(solid.T[:, 0], 3), solid.T[:, 1:].ravel())
    of_tets = label[solid.T[:, 0]]
    volumes = np.bincount(of_tets, solid.tet_volumes)
    return TetMesh(solid.V, solid.T[of_tets == int(volumes.argmax())]).compact()[0]
