"""Files of hexahedra, for viewers and finite-element programs."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import for_legacy_vtk
from ..base.files import atomic_path
from ..base.options import as_path
from ..errors import FileFormatError, MissingDependencyError

__all__ = ["HEX_SUFFIXES", "write_hexahedra"]

Fields = Mapping[str, NDArray[np.generic]]
# meshio's names; the binary variants are its defaults.
_BY_MESHIO = {".vtu": "vtu", ".vtk": "vtk", ".msh": "gmsh"}
_PER_LINE = 8


def write_hexahedra(
    path: str | os.PathLike[str],
    V: NDArray[np.float64],
    H: NDArray[np.int32],
    point_fields: Fields,
    cell_fields: Fields,
) -> None:
    """Write hexahedra with their fields.

    ``.vtu``, ``.vtk`` and ``.msh`` (gmsh 4.1) hold all fields under their names. ``.inp`` (Abaqus)
    holds scalars of points as field variables 1, 2, ... (``*INITIAL CONDITIONS, TYPE=FIELD``) and
    integers of cells as element sets ``NAME_VALUE``. ``.bdf`` (Nastran) holds scalars of points as
    ``TEMP`` sets 1, 2, ..., and of the integers of cells the first two, as the property id
    ``100 * second + first + 1``. A comment at the head of either says which is which.

    Parameters
    ----------
    path : path-like
        The suffix chooses the format.
    V : ndarray, shape (n, 3)
    H : ndarray of int32, shape (k, 8)
        Corners in the order of VTK, which is that of all these formats.
    point_fields, cell_fields : mapping of str to ndarray
        One entry per point, or per hexahedron.

    Raises
    ------
    FileFormatError
        Another suffix.
    MissingDependencyError
        meshio is not installed; ``.inp`` and ``.bdf`` do not need it.
    OSError
        If the file cannot be written.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix in _BY_MESHIO:
        _write_by_meshio(path, V, H, point_fields, cell_fields)
    elif suffix in _WRITERS:
        scalars = {k: v for k, v in point_fields.items() if v.ndim == 1}
        numbers = {k: v for k, v in cell_fields.items() if np.issubdtype(v.dtype, np.integer)}
        with atomic_path(path) as temporary, open(temporary, "w", encoding="ascii") as file:
            _WRITERS[suffix](file, V, H, scalars, numbers)
    else:
        raise FileFormatError(
            f"{path}: hexahedra are written as {', '.join(HEX_SUFFIXES[:-1])} or {HEX_SUFFIXES[-1]}"
        )


def _write_by_meshio(
    path: Path, V: NDArray[np.float64], H: NDArray[np.int32], points: Fields, cells: Fields
) -> None:
    try:
        import meshio
    except ImportError:
        raise MissingDependencyError(
            f"writing hexahedra as {path.suffix} needs meshio: pip install 'stretchmap[io]'"
        ) from None
    file_format = _BY_MESHIO[path.suffix.lower()]
    plain = for_legacy_vtk if file_format == "vtk" else np.asarray
    mesh = meshio.Mesh(
        V,
        [("hexahedron", H)],
        point_data={name: np.ascontiguousarray(plain(values)) for name, values in points.items()},
        cell_data={name: [np.ascontiguousarray(plain(values))] for name, values in cells.items()},
    )
    with atomic_path(path) as temporary:
        mesh.write(temporary, file_format=file_format)


def _write_abaqus(
    file: TextIO, V: NDArray[np.float64], H: NDArray[np.int32], points: Fields, cells: Fields
) -> None:
    names = ", ".join(f"{k} {name}" for k, name in enumerate(points, 1))
    file.write(f"*HEADING\nhexahedra; field variables: {names}\n*NODE\n")
    ids = np.arange(1, len(V) + 1)
    _rows(file, "%d, %.16e, %.16e, %.16e\n", np.column_stack([ids, V]))
    file.write("*ELEMENT, TYPE=C3D8, ELSET=ALL\n")
    _rows(file, ", ".join(["%d"] * 9) + "\n", np.column_stack([np.arange(1, len(H) + 1), H + 1]))
    for name, values in cells.items():
        for value in np.unique(values):
            file.write(f"*ELSET, ELSET={name.upper()}_{value}\n")
            members = np.flatnonzero(values == value) + 1
            for start in range(0, len(members), _PER_LINE):
                file.write(", ".join(map(str, members[start : start + _PER_LINE])) + "\n")
    for k, values in enumerate(points.values(), 1):
        file.write(f"*INITIAL CONDITIONS, TYPE=FIELD, VARIABLE={k}\n")
        _rows(file, "%d, %.16e\n", np.column_stack([ids, values]))


def _write_nastran(
    file: TextIO, V: NDArray[np.float64], H: NDArray[np.int32], points: Fields, cells: Fields
) -> None:
    names = ", ".join(f"{k} {name}" for k, name in enumerate(points, 1))
    first, second = list(cells)[:2]
    file.write(f"$ hexahedra; TEMP sets: {names}; property id: 100 {second} + {first} + 1\n")
    file.write("BEGIN BULK\n")
    ids = np.arange(1, len(V) + 1)
    # The large format: fields of sixteen characters, so that numbers keep ten digits.
    blank = " " * 16  # the basic coordinate system
    _rows(file, f"GRID*   %16d{blank}%16.9E%16.9E\n*       %16.9E\n", np.column_stack([ids, V]))
    block, layer = (np.asarray(cells[name], int) for name in (first, second))
    property_ids = 100 * layer + block + 1
    _rows(
        file,
        "CHEXA   " + "%8d" * 8 + "+\n+       " + "%8d" * 2 + "\n",
        np.column_stack([np.arange(1, len(H) + 1), property_ids, H + 1]),
    )
    for k, values in enumerate(points.values(), 1):
        _rows(file, f"TEMP*   {k:16d}%16d%16.9E\n*\n", np.column_stack([ids, values]))
    file.write("ENDDATA\n")


def _rows(file: TextIO, pattern: str, rows: NDArray[np.generic]) -> None:
    """One line per row, many at a time."""
    for start in range(0, len(rows), 10_000):
        part = rows[start : start + 10_000]
        file.write(pattern * len(part) % tuple(part.ravel().tolist()))


_WRITERS: dict[
    str,
    Callable[[TextIO, NDArray[np.float64], NDArray[np.int32], Fields, Fields], None],
] = {".inp": _write_abaqus, ".bdf": _write_nastran}
HEX_SUFFIXES = (*_BY_MESHIO, *_WRITERS)
