"""Readers and writers of the plain surface formats: OBJ, OFF, PLY and STL.

They need nothing but NumPy, read what common programs write (comments anywhere, relative indices,
texture seams, extra properties, either byte order) and stop with a reason at what is not a triangle
mesh. Parsers may raise any exception on a bad file; `stretchmap.io` turns it into a
`FileFormatError`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from .errors import FileFormatError

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """What a mesh file holds, before it is checked.

    Attributes
    ----------
    V : (n, 3) ndarray
        Points, as stored.
    F : (m, 3) ndarray of integers or None
        Triangles.
    T : (k, 4) ndarray of integers or None
        Tets.
    point_data : dict
        Arrays with one row per point, by name.
    cell_data : dict
        Arrays with one row per tet, or per triangle where there are no tets, by name.
    extra : dict
        Further arrays of an ``.npz`` file, by name.
    corner_uv : (m, 3, 2) ndarray or None
        Texture coordinates of the triangle corners of an ``.obj`` file.
    """

    V: NDArray[Any]
    F: NDArray[Any] | None = None
    T: NDArray[Any] | None = None
    point_data: dict[str, NDArray[Any]] = field(default_factory=dict)
    cell_data: dict[str, NDArray[Any]] = field(default_factory=dict)
    extra: dict[str, NDArray[Any]] = field(default_factory=dict)
    corner_uv: NDArray[np.float64] | None = None


# ------------------------------------------------------------------------------------------- OBJ

_CORNER = rb"[ \t]+(-?\d+)(?:/(-?\d*))?(?:/-?\d*)?"
_FACE = re.compile(rb"^[ \t]*f" + 3 * _CORNER + rb"[ \t]*(?:#.*)?\r?$", re.MULTILINE)
_FACE_LINE = re.compile(rb"^[ \t]*f[ \t].*$", re.MULTILINE)


def read_obj(data: bytes) -> MeshArrays:
    """Parse an OBJ file: ``v``, ``vt`` and triangular ``f`` lines; groups and the rest are skipped.

    Texture coordinates may differ at the corners that meet in a vertex (a seam).
    """
    data = re.sub(rb"\\\r?\n", b" ", data)
    points, last_point = _obj_table(data, b"v", 3)
    corners = _FACE.findall(data)
    lines = _FACE_LINE.findall(data)
    if len(corners) != len(lines):
        odd = next(line for line in lines if not _FACE.match(line))
        raise FileFormatError(f"not a triangle: {odd.decode(errors='replace').strip()!r}")
    if not corners or not len(points):
        raise FileFormatError(f"{len(points)} vertices and {len(corners)} faces")
    table = np.array(corners)
    first_face = _FACE_LINE.search(data).start()  # type: ignore[union-attr]
    in_order = last_point <= first_face
    faces = _obj_ids(table[:, 0::2], len(points), in_order)
    corner_uv = None
    if (table[:, 1::2] != b"").all():
        uv, last_uv = _obj_table(data, b"vt", 2)
        ids = _obj_ids(table[:, 1::2], len(uv), last_uv <= first_face)
        if ((ids < 0) | (ids >= len(uv))).any():
            raise FileFormatError("texture indices point outside the vt lines")
        corner_uv = uv[ids]
    return MeshArrays(points, F=faces, corner_uv=corner_uv)


def _obj_table(data: bytes, key: bytes, width: int) -> tuple[NDArray[np.float64], int]:
    """All lines of one kind as an array, and where the last of them begins."""
    pattern = re.compile(rb"^[ \t]*" + key + rb"[ \t]+(.*)$", re.MULTILINE)
    lines = pattern.findall(data)
    if not lines:
        return np.empty((0, width)), 0
    last = max(data.rfind(b"\n" + key + b" "), data.rfind(b"\n" + key + b"\t"))
    text = [line.decode("ascii") for line in lines]
    return np.loadtxt(text, usecols=range(width), ndmin=2), last


def _obj_ids(words: NDArray[np.bytes_], n: int, in_order: bool) -> NDArray[np.int64]:
    ids = words.astype(np.int64)
    if (ids < 0).any():
        if not in_order:
            raise FileFormatError("relative indices in a file whose vertices and faces alternate")
        return np.where(ids < 0, ids + n, ids - 1)
    return ids - 1


def write_obj(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write points, faces and, where given, texture coordinates, seams included."""
    faces = mesh.F + 1
    np.savetxt(file, mesh.V, fmt="v %.17g %.17g %.17g")
    if mesh.corner_uv is None:
        np.savetxt(file, faces, fmt="f %d %d %d")
        return
    uv, ids = np.unique(mesh.corner_uv.reshape(-1, 2), axis=0, return_inverse=True)
    np.savetxt(file, uv, fmt="vt %.17g %.17g")
    table = np.stack([faces, ids.reshape(faces.shape) + 1], axis=-1).reshape(-1, 6)
    np.savetxt(file, table, fmt="f %d/%d %d/%d %d/%d")


# ------------------------------------------------------------------------------------------- OFF


def read_off(data: bytes) -> MeshArrays:
    """Parse an OFF file of triangles; normals and colours of the variants are skipped."""
    text = re.sub(rb"#.*", b"", data)
    header = re.match(rb"\s*((?:ST)?C?N?)OFF\b", text)
    if not header:
        raise FileFormatError("the first word is not OFF")
    if re.match(rb"\s*BINARY\b", text[header.end() :]):
        raise FileFormatError("binary OFF is not supported; save it as text")
    lines = [line for line in text[header.end() :].decode("ascii").splitlines() if line.strip()]
    n, m = (int(word) for word in lines[0].split()[:2])
    if len(lines) < 1 + n + m:
        raise FileFormatError(f"{n} points and {m} faces announced, {len(lines) - 1} lines follow")
    if n == 0 or m == 0:
        raise FileFormatError(f"{n} points and {m} faces")
    points = np.loadtxt(lines[1 : 1 + n], usecols=(0, 1, 2), ndmin=2)
    faces = lines[1 + n : 1 + n + m]
    sizes = np.loadtxt(faces, usecols=0, dtype=np.int64, ndmin=1)
    _triangles_only(sizes)
    return MeshArrays(points, F=np.loadtxt(faces, usecols=(1, 2, 3), dtype=np.int64, ndmin=2))


def write_off(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write points and faces."""
    file.write(f"OFF\n{len(mesh.V)} {len(mesh.F)} 0\n".encode())
    np.savetxt(file, mesh.V, fmt="%.17g %.17g %.17g")
    np.savetxt(file, mesh.F, fmt="3 %d %d %d")


# ------------------------------------------------------------------------------------------- STL

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes) -> MeshArrays:
    """Parse an STL file, text or binary; corners with equal coordinates become one vertex."""
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) == 84 + count * _FACET.itemsize:
        corners = np.frombuffer(data, _FACET, count, offset=84)["corners"].reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid":
        if b"endsolid" not in data:
            raise FileFormatError("endsolid is missing, the file is cut off")
        lines = re.findall(rb"^\s*vertex\s+(.*)$", data, re.MULTILINE)
        corners = np.array([line.split() for line in lines]).astype(np.float64)
    else:
        raise FileFormatError(
            f"{len(data)} bytes, but the header announces {max(count, 0)} triangles"
        )
    if not len(corners) or len(corners) % 3:
        raise FileFormatError(f"{len(corners)} triangle corners")
    points, faces = np.unique(corners + 0.0, axis=0, return_inverse=True)
    return MeshArrays(points, F=faces.reshape(-1, 3))


def write_stl(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write a binary STL; coordinates are rounded to single precision."""
    facets = np.zeros(len(mesh.F), _FACET)
    facets["corners"] = mesh.V[mesh.F]
    a, b, c = np.moveaxis(mesh.V[mesh.F], 1, 0)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    facets["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    file.write(b"binary STL".ljust(80))
    file.write(np.uint32(len(facets)).astype("<u4").tobytes())
    file.write(facets.tobytes())


def _triangles_only(sizes: NDArray[Any]) -> None:
    odd = np.unique(sizes[sizes != 3])
    if len(odd):
        raise FileFormatError(
            f"faces with {', '.join(map(str, odd[:5].tolist()))} corners; split them into triangles"
        )
