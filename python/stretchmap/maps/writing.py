"""Files of maps.

A map file is an ``.npz`` with ``V``, ``F`` or ``T``, ``image`` (n, 3), ``torus`` (2,) with R and r
where there is one, further named arrays, and ``meta``, a JSON text of all scalars, the history and
the versions. Every writer here writes to a temporary file first and renames it, so a failure leaves
no file behind.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import io
from ..base.files import atomic_path
from ..base.options import as_path
from ..base.torus import TWO_PI
from ..io.npz import save_npz
from ..mesh.meshes import TetMesh, TriMesh

if TYPE_CHECKING:
    from .result import MapResult

__all__ = ["corner_turns", "elements", "save_map"]


def save_map(result: MapResult, path: str | os.PathLike[str]) -> None:
    """As `MapResult.save`."""
    path = as_path(path)
    suffix = path.suffix.lower()
    mesh, d = result.mesh, result.distortion
    if suffix == ".npz":
        _save_npz(result, path)
    elif suffix in (".vtu", ".vtk", ".xdmf"):
        given = result.as_cells()
        io.write(path, mesh, point_data=given.point_data, cell_data=given.cell_data)
    elif isinstance(mesh, TetMesh):
        if suffix in io.suffixes(solid=True):
            io.write(path, TetMesh(result.image, mesh.T), cell_data={"ratio": d.ratios})
        else:
            io.write(path, TriMesh(result.image[mesh.boundary_vertices], mesh.surface.F))
    elif suffix == ".obj" and result.angles is not None:
        io.write(path, mesh, corner_uv=corner_turns(mesh.F, result.angles))
    else:
        io.write(path, TriMesh(result.image, mesh.F), cell_data={"ratio": d.ratios})


def _save_npz(result: MapResult, path: Path) -> None:
    mesh = result.mesh
    arrays: dict[str, NDArray[Any]] = {
        "V": mesh.V,
        "T" if isinstance(mesh, TetMesh) else "F": elements(mesh),
        "image": result.image,
        "ratios": result.distortion.ratios,
        "ring_ratios": result.distortion.ring_ratios,
        **result.extra_arrays(),
    }
    if result.torus is not None:
        arrays["torus"] = np.array([result.torus.R, result.torus.r])
    arrays["meta"] = np.array(json.dumps(result.to_dict(history=True), allow_nan=False))
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        save_npz(file, arrays)


def corner_turns(faces: NDArray[np.int32], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3, 2) chart coordinates of the corners of each face in turns, each face in one piece."""
    turns = angles[faces] / TWO_PI
    first = turns[:, :1] % 1.0
    step = turns - turns[:, :1]
    return first + step - np.round(step)


def elements(mesh: TriMesh | TetMesh) -> NDArray[np.int32]:
    """``T`` of a tet mesh, ``F`` of a triangle mesh."""
    return mesh.T if isinstance(mesh, TetMesh) else mesh.F
