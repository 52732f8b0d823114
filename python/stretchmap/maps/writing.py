"""Files of maps.

A map file is an ``.npz`` with ``V``, ``F`` or ``T``, ``image`` (n, 3), ``torus`` (2,) with R and r
where there is one, further named arrays, and ``meta``, a JSON text of all scalars, the history and
the versions. Every writer here writes to a temporary file first and renames it, so a failure leaves
no file behind.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import io
from ..base.files import atomic_path
from ..base.options import shown
from ..base.torus import TWO_PI, Torus
from ..io.formats import WITHOUT_ARRAYS
from ..io.npz import save_npz
from ..io.ply import require_names
from ..io.storable import storable
from ..mesh.exchange import Cells
from ..mesh.meshes import TetMesh, TriMesh
from .fields import OF_MAPS
from .frames import coordinate_field, periodic

__all__ = ["all_fields", "corner_turns", "elements", "require_storable", "save_arrays", "write_map"]

_log = logging.getLogger("stretchmap")

# Formats whose files of maps hold the source with all fields, beside those of ours. Others hold the
# image with the fields of the input.
_WITH_FIELDS = (".vtu", ".vtk", ".xdmf")


def write_map(
    path: Path,
    given: Cells,
    mesh: TriMesh | TetMesh,
    image: NDArray[np.float64],
    angles: NDArray[np.float64] | None,
) -> None:
    """Write a map to a file that is none of ours, see `MapResult.save`."""
    suffix = path.suffix.lower()
    if suffix in _WITH_FIELDS:
        io.write(path, mesh, point_data=given.point_data, cell_data=given.cell_data)
        return
    points, cells = (
        {name: array for name, array in data.items() if name not in OF_MAPS}
        for data in (given.point_data, given.cell_data)
    )
    ratios = {} if suffix in WITHOUT_ARRAYS else {"ratio": given.cell_data["ratio"]}
    if isinstance(mesh, TetMesh):
        if suffix in io.suffixes(solid=True):
            io.write(path, TetMesh(image, mesh.T), points, cells | ratios)
            return
        ids = mesh.boundary_vertices
        if cells:
            names = ", ".join(map(shown, cells))
            _log.warning("%s: %s files hold no tets; left out: %s", path, suffix, names)
        points = {name: array[ids] for name, array in points.items()}
        io.write(path, TriMesh(image[ids], mesh.surface.F), points)
    elif suffix == ".obj" and angles is not None:
        io.write(path, mesh, points, cells, corner_turns(mesh.F, angles))
    else:
        io.write(path, TriMesh(image, mesh.F), points, cells | ratios)


def require_storable(
    path: Path,
    mesh: TriMesh | TetMesh,
    points: Mapping[str, NDArray[Any]],
    cells: Mapping[str, NDArray[Any]],
) -> None:
    """Refuse fields of the source that the file of its map could not hold.

    Raises
    ------
    ArrayError
        Says what can be done.
    """
    suffix = path.suffix.lower()
    if isinstance(mesh, TetMesh) and suffix not in io.suffixes(solid=True):
        cells = {}  # its surface is written
    points, cells = storable(suffix, points), storable(suffix, cells)
    if suffix == ".ply":
        require_names(points, cells)


def save_arrays(
    path: Path,
    mesh: TriMesh | TetMesh,
    torus: Torus | None,
    arrays: dict[str, NDArray[Any]],
    fields: dict[str, Mapping[str, NDArray[Any]]],
    meta: dict[str, Any],
) -> None:
    """Write a map file."""
    name = "T" if isinstance(mesh, TetMesh) else "F"
    arrays = {"V": mesh.V, name: elements(mesh), **arrays}
    for kind, named in fields.items():
        arrays |= {f"{kind}:{name}": array for name, array in named.items()}
    if torus is not None:
        arrays["torus"] = np.array([torus.R, torus.r])
    arrays["meta"] = np.array(json.dumps(meta, allow_nan=False))
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        save_npz(file, arrays)


def all_fields(
    mesh: TriMesh | TetMesh,
    torus: Torus | None,
    points: dict[str, NDArray[Any]],
    ratios: dict[str, NDArray[Any]],
    extra: dict[str, NDArray[Any]],
) -> Cells:
    """The source with the fields given, further arrays of as many rows, and coordinates."""
    cells = elements(mesh)
    for name, array in extra.items():
        if array.ndim in (1, 2) and array.dtype.kind in "biuf" and name not in points:
            if len(array) == len(mesh.V):
                points[name] = array
            elif len(array) == len(cells):
                ratios[name] = array
    if torus is not None:
        u, v, s = torus.coordinates(points["image"])
        points |= {"u": u, "v": v, "s": s, **periodic(u, v)}
        if isinstance(mesh, TetMesh):
            ratios |= _per_tet(mesh, torus, points["image"], u, v)
        points["torus"] = np.tile([torus.R, torus.r], (len(mesh.V), 1))
    kind = "tetra" if isinstance(mesh, TetMesh) else "triangle"
    return Cells(mesh.V, kind, cells, points, ratios)


def _per_tet(
    mesh: TetMesh,
    torus: Torus,
    image: NDArray[np.float64],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
) -> dict[str, NDArray[Any]]:
    """Gradients and frames of the tets, and which of them a seam of u or v cuts."""
    field = coordinate_field(mesh, image, torus)
    names = ("grad_u", "grad_v", "grad_s", "along", "around", "radial")
    rows = np.concatenate([field.gradients, field.frames], axis=1)
    rows[~np.isfinite(rows)] = 0.0  # on the core; files with NaN are refused by some readers
    fields: dict[str, NDArray[Any]] = {
        name: np.ascontiguousarray(rows[:, i]) for i, name in enumerate(names)
    }
    for name, angle in (("seam_u", u), ("seam_v", v)):
        fields[name] = (np.ptp(angle[mesh.T], axis=1) >= np.pi).astype(np.int32)
    return fields


def corner_turns(faces: NDArray[np.int32], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3, 2) chart coordinates of the corners of each face in turns, each face in one piece."""
    turns = angles[faces] / TWO_PI
    first = turns[:, :1] % 1.0
    step = turns - turns[:, :1]
    return first + step - np.round(step)


def elements(mesh: TriMesh | TetMesh) -> NDArray[np.int32]:
    """``T`` of a tet mesh, ``F`` of a triangle mesh."""
    return mesh.T if isinstance(mesh, TetMesh) else mesh.F
