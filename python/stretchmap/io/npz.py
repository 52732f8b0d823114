"""Compressed ``.npz`` files, written in small slices so that Ctrl-C is heard meanwhile."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from typing import IO, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

__all__ = ["save_npz"]

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
