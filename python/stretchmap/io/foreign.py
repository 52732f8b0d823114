"""Formats that other optional packages read: ``.glb``, ``.gltf``, ``.3mf`` by trimesh, VTK's own by
PyVista."""

from __future__ import annotations

import importlib.util
import logging
import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.options import shown
from ..errors import FileFormatError, MissingDependencyError
from ..mesh.cells import blocks_of_vtk, simplices
from .arrays import MeshArrays
from .npz import read_archive

__all__ = ["VTK_SCRIPT", "for_vtk_alone", "read_pyvista", "read_trimesh", "run_vtk"]

_log = logging.getLogger("stretchmap")

# What a .vtk file holds that meshio does not know, or passes over, by the file's version.
_HEADER = rb"^(?:(?:SCALARS|VECTORS|TENSORS)[ \t]+\S+|POINTS[ \t]+\d+|\S+[ \t]+\d+[ \t]+\d+)[ \t]+"
_IN_VTK = {
    modern: re.compile(
        rb"^DATASET[ \t]+POLYDATA\b"
        rb"|^(?:COLOR_SCALARS|NORMALS|TEXTURE_COORDINATES|GLOBAL_IDS|PEDIGREE_IDS)[ \t].*$"
        rb"|^LOOKUP_TABLE[ \t]+\S+[ \t]+\d+|"
        + _HEADER
        + rb"(?:bit|signed_char|(?:unsigned_)?long|vtkIdType|string|variant|"
        + further
        + rb")(?:[ \t]+\d+)?[ \t]*\r?$",
        re.MULTILINE,
    )
    for modern, further in (
        (True, rb"(?:unsigned_)?(?:char|short)|unsigned_int"),
        (False, rb"vtktype\w+"),
    )
}
# The same of a .vtu file: text, with which PyVista marks truth values and complex numbers, other
# versions and compressors.
_IN_VTU = re.compile(
    rb"<Array\b[^>]*>|<DataArray\b[^>]*\btype=.(?:String|Bit|vtkIdType)\b[^>]*>"
    rb"|<VTKFile\b[^>]*\b(?:version=.2|compressor=.vtkLZ4)[^>]*>"
)
# VTK's readers abort on some files, write past arrays on others and do not come to an end on a few:
# they get a process of their own, and processor time by the length of the file.
VTK_SCRIPT = """
import math, os, sys, time, numpy, pyvista
try:
    import resource
    most = math.ceil(time.process_time() + 5.0 + 1e-6 * os.path.getsize(sys.argv[1]))
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 5))
except ImportError:  # not on Windows
    pass
grid = pyvista.read(sys.argv[1])
if isinstance(grid, pyvista.MultiBlock):
    grid = grid.combine()
grid = grid.cast_to_unstructured_grid()
arrays = {"points": grid.points, "types": grid.celltypes, "cells": grid.cell_connectivity,
          "offsets": grid.cell_offsets if hasattr(grid, "cell_offsets") else grid.offset}
left_out = []
for prefix, data in (("p:", grid.point_data), ("c:", grid.cell_data)):
    for name in data.keys():
        if numpy.asarray(data[name]).dtype.kind in "biuf":
            arrays[prefix + name] = numpy.asarray(data[name])
        else:
            left_out.append(name)
arrays["left_out"] = numpy.array(left_out, str)
numpy.savez(sys.argv[2], **arrays)
"""


def for_vtk_alone(path: Path) -> str | None:
    """What of a ``.vtk`` or ``.vtu`` file meshio does not know, as it stands there, if anything."""
    data = path.read_bytes()
    if path.suffix.lower() == ".vtu":
        found = _IN_VTU.search(data)
    else:
        found = _IN_VTK[data[:26] == b"# vtk DataFile Version 5.1"].search(data)
    return None if found is None else found[0].decode("ascii", "replace").strip()


def read_pyvista(path: Path, found: str | None = None) -> MeshArrays:
    """Read a file by VTK: ``.vtp``, and others that hold what meshio does not know.

    Arrays of text and of complex numbers are left out; the log says so.

    Raises
    ------
    FileFormatError
        VTK complains, or the cells are of other kinds than triangles, polygons and tets.
    MissingDependencyError
        PyVista is not installed.
    """
    if importlib.util.find_spec("pyvista") is None:
        if found is None:
            raise MissingDependencyError(
                f"reading {path.suffix} files needs pyvista: pip install 'stretchmap[viz]'"
            )
        raise MissingDependencyError(
            f"{path} holds what only VTK reads, {shown(found)}: pip install 'stretchmap[viz]', or "
            "save it without"
        )
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "grid.npz")
        code, stderr = run_vtk(path, out)
        said = [line for line in stderr.splitlines() if line.strip()]
        if code < 0 and signal.Signals(-code).name == "SIGXCPU":
            raise FileFormatError("VTK does not come to an end with it")
        if code or not out.exists() or any("ERR" in line for line in said):
            raise FileFormatError(f"VTK cannot read it: {said[-1] if said else 'no reason given'}")
        with open(out, "rb") as file:
            arrays = read_archive(file)
    if len(arrays["left_out"]):
        _log.info("%s: arrays of no real numbers left out: %s", path, ", ".join(arrays["left_out"]))
    point_data = {name[2:]: array for name, array in arrays.items() if name[:2] == "p:"}
    cell_data = {name[2:]: array for name, array in arrays.items() if name[:2] == "c:"}
    points = arrays["points"]
    blocks = blocks_of_vtk(
        len(points), arrays["types"], arrays["cells"], arrays["offsets"], cell_data
    )
    return MeshArrays.of(simplices(points, blocks, point_data))


def run_vtk(path: Path, out: Path) -> tuple[int, str]:
    """Have VTK read a file and write its arrays to another; exit code and what it complained of."""
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", VTK_SCRIPT, str(path.resolve()), str(out)],
        capture_output=True, text=True, errors="replace", cwd=out.parent, check=False,
    )  # fmt: skip
    return run.returncode, run.stderr


def _and_trimesh(missing: str | None) -> str:
    return "trimesh" if missing in (None, "trimesh") else f"trimesh and {missing}"


def read_trimesh(path: Path) -> MeshArrays:
    """Read a scene by trimesh: all its parts, placed; equal corners become one vertex.

    Raises
    ------
    FileFormatError
        It cannot be read or holds no triangles.
    MissingDependencyError
        trimesh, or what it needs for the format, is not installed.
    """
    try:
        import trimesh

        scene = trimesh.load_scene(str(path), process=False)
        mesh: Any = scene.to_mesh()
    except ImportError as error:
        raise MissingDependencyError(
            f"reading {path.suffix} files needs {_and_trimesh(error.name)}: "
            "pip install 'stretchmap[interop]' networkx lxml"
        ) from error
    if not len(mesh.faces):
        raise FileFormatError("it holds no triangles")
    corners: NDArray[Any] = np.asarray(mesh.vertices, float)
    points, ids = np.unique(corners + 0.0, axis=0, return_inverse=True)
    return MeshArrays(points, F=ids.reshape(-1)[np.asarray(mesh.faces)])
