"""Reader and writer of OFF."""

from __future__ import annotations

import re
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from ..mesh.cells import fans
from .arrays import MeshArrays, lines_of


def read_off(data: bytes) -> MeshArrays:
    """Parse an OFF file; polygons are split, normals and colors of the variants skipped."""
    text = re.sub(rb"#.*", b"", lines_of(data))
    header = re.match(rb"\s*((?:ST)?C?N?)OFF\b", text)
    if not header:
        raise FileFormatError("the first word is not OFF")
    rest = text[header.end() :]
    if re.match(rb"\s*BINARY\b", rest):
        raise FileFormatError("binary OFF is not supported; save it as text")
    lines = [line for line in rest.decode("ascii").split("\n") if line.strip()]
    n, m = (int(word) for word in lines[0].split()[:2])
    if n < 1 or m < 1:
        raise FileFormatError(f"{n} points and {m} faces")
    if len(lines) != 1 + n + m:
        if header[1]:  # what belongs to a row, only its line tells
            raise FileFormatError(f"{n} points, {m} faces announced, {len(lines) - 1} lines follow")
        return _words_alone(rest.split(), n, m)
    points = np.loadtxt(lines[1 : 1 + n], usecols=(0, 1, 2), ndmin=2)
    return MeshArrays(points, F=_faces(lines[1 + n : 1 + n + m]))


def _faces(faces: list[str]) -> NDArray[np.int64]:
    """Triangles (m, 3) from lines of corners with their number first."""
    sizes = np.loadtxt(faces, usecols=0, dtype=np.int64, ndmin=1)
    if (sizes == 3).all():
        return np.loadtxt(faces, usecols=(1, 2, 3), dtype=np.int64, ndmin=2)
    rows = [line.split()[1 : 1 + size] for line, size in zip(faces, sizes, strict=True)]
    if any(len(row) != size for row, size in zip(rows, sizes, strict=True)):
        raise FileFormatError("a face has fewer corners than it announces")
    corners = np.array([int(word) for row in rows for word in row], dtype=np.int64)
    return fans(corners, sizes)


def _words_alone(words: list[bytes], n: int, m: int) -> MeshArrays:
    """A file whose rows are not its lines: counts, coordinates and faces, and nothing else."""
    at = 3 + 3 * n
    fault = FileFormatError(f"{n} points and {m} faces are announced, and something else follows")
    sizes, corners = [], []
    for _ in range(m):
        if at >= len(words):
            raise fault
        sizes.append(int(words[at]))
        corners += words[at + 1 : at + 1 + sizes[-1]]
        at += 1 + max(sizes[-1], 0)
    if at != len(words):
        raise fault
    points = np.array(words[3 : 3 + 3 * n]).astype(np.float64).reshape(n, 3)
    return MeshArrays(points, F=fans(np.array(corners).astype(np.int64), np.array(sizes)))


def write_off(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write points and faces."""
    file.write(f"OFF\n{len(mesh.V)} {len(mesh.elements)} 0\n".encode())
    np.savetxt(file, mesh.V, fmt="%.17g %.17g %.17g")
    np.savetxt(file, mesh.elements, fmt="3 %d %d %d")
