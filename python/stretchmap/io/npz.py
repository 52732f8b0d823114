"""Compressed ``.npz`` files, written in small slices so that Ctrl-C is heard meanwhile."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import replace
from typing import IO, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..base.options import installed_memory
from ..errors import ArrayError, FileFormatError
from .arrays import MeshArrays

__all__ = ["read_archive", "read_array", "read_npz", "save_npz", "write_npz"]

_MESH_KEYS = ("V", "F", "T")
_SLICE = 1 << 20  # bytes
_LEVEL = 1  # coordinates hardly shrink, and indices about as much as at higher levels


class _Slices:
    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        view = memoryview(data)
        for start in range(0, len(view), _SLICE):
            self._file.write(view[start : start + _SLICE])
        return len(view)


def save_npz(file: BinaryIO, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays as `numpy.savez_compressed` does, at the fastest level of compression.

    Parameters
    ----------
    file : file open for writing bytes
    arrays : mapping of name to array
        No object arrays.

    Raises
    ------
    OSError
        The file cannot be written.
    ValueError
        An array of objects.
    """
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(_Slices(member), np.asanyarray(array), allow_pickle=False)


def read_archive(file: BinaryIO) -> dict[str, NDArray[Any]]:
    """All arrays of an archive by name.

    Raises
    ------
    FileFormatError
        It is none, or holds more than there is memory for.
    Exception
        What NumPy and zipfile raise where it is damaged; see `base.files.parsing`.
    """
    if not zipfile.is_zipfile(file):
        raise FileFormatError("it is no .npz archive")
    file.seek(0)
    with zipfile.ZipFile(file) as archive:
        size = sum(member.file_size for member in archive.infolist())
        if size > installed_memory():
            raise FileFormatError(
                f"its arrays take {size / 2**30:.3g} GiB, more than there is memory"
            )
        names = [name for name in archive.namelist() if name.endswith(".npy")]
        if len(set(names)) < len(names):
            raise FileFormatError("it holds two arrays of one name")
        arrays = {}
        for name in names:
            with archive.open(name) as member:
                arrays[name.removesuffix(".npy")] = read_array(member)
        return arrays


def read_array(file: IO[bytes]) -> NDArray[Any]:
    """The one array of a ``.npy`` file.

    Raises
    ------
    FileFormatError
        Something follows it: its header says less than there is.
    Exception
        As `read_archive`.
    """
    array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
    if file.read(1):
        raise FileFormatError(f"more follows an array said to have shape {array.shape}")
    return array


def read_npz(file: BinaryIO) -> MeshArrays:
    """The mesh ``V`` with ``F`` or ``T`` and all other arrays of an archive."""
    arrays = read_archive(file)
    if "V" not in arrays or not {"F", "T"} & arrays.keys():
        raise FileFormatError(
            f"V and F or T are needed, it holds {', '.join(sorted(arrays)) or 'nothing'}"
        )
    mesh = MeshArrays(arrays["V"], arrays.get("F"), arrays.get("T"))
    n, m = (len(a) if a.ndim else 0 for a in (mesh.V, mesh.elements))
    point_data: dict[str, NDArray[Any]] = {}
    cell_data: dict[str, NDArray[Any]] = {}
    extra: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        if name in _MESH_KEYS:
            continue
        rows = len(array) if array.ndim else -1
        target = point_data if rows == n else cell_data if rows == m else extra
        target[name] = array
    return replace(mesh, point_data=point_data, cell_data=cell_data, extra=extra)


def write_npz(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write mesh and data as one archive."""
    clash = mesh.point_data.keys() & mesh.cell_data.keys()
    clash |= (mesh.point_data.keys() | mesh.cell_data.keys()) & {*_MESH_KEYS, "file"}
    if clash:
        raise ArrayError(f"an .npz file cannot hold two arrays named {', '.join(sorted(clash))}")
    key = "F" if mesh.T is None else "T"
    save_npz(file, {"V": mesh.V, key: mesh.elements, **mesh.point_data, **mesh.cell_data})
