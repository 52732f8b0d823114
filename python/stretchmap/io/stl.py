"""Reader and writer of STL, text and binary."""

from __future__ import annotations

import re
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from .arrays import MeshArrays, lines_of

# Of a facet: nothing for the line that opens it, the rest of the line for each corner.
_LINE = re.compile(rb"^[ \t]*(?:facet\b|vertex[ \t]+(\S.*)$)", re.MULTILINE | re.IGNORECASE)
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes) -> MeshArrays:
    """Parse an STL file, text or binary; corners with equal coordinates become one vertex."""
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    behind = len(data) - 84 - count * _FACET.itemsize
    text = lines_of(data).lstrip() if behind else b""
    if text[:5].lower() == b"solid":
        if b"endsolid" not in text.lower():
            raise FileFormatError("endsolid is missing, the file is cut off")
        corners = _text_corners(text)
    elif count > 0 and 0 <= behind < _FACET.itemsize:  # some programs pad their files
        corners = np.frombuffer(data, _FACET, count, offset=84)["corners"].reshape(-1, 3)
    else:
        raise FileFormatError(
            f"{len(data)} bytes, but the header announces {max(count, 0)} triangles"
        )
    if not len(corners) or len(corners) % 3:
        raise FileFormatError(f"{len(corners)} triangle corners")
    points, faces = np.unique(corners + 0.0, axis=0, return_inverse=True)
    return MeshArrays(points, F=faces.reshape(-1, 3))


def _text_corners(data: bytes) -> NDArray[np.float64]:
    """Corners of all facets of a text file, which must have three each."""
    lines = _LINE.findall(data)
    opens = np.array([not corner for corner in lines], bool)
    if len(opens) % 4 or (np.flatnonzero(opens) != np.arange(0, len(opens), 4)).any():
        raise FileFormatError(f"{int(opens.sum())} facets, not all with three corners")
    return np.array([corner.split() for corner in lines if corner]).astype(np.float64)


def write_stl(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write a binary STL; coordinates are rounded to single precision."""
    corners = mesh.V[mesh.elements]
    facets = np.zeros(len(corners), _FACET)
    facets["corners"] = corners
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    facets["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    file.write(b"binary STL".ljust(80))
    file.write(np.uint32(len(facets)).astype("<u4").tobytes())
    file.write(facets.tobytes())
