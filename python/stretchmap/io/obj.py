"""Reader and writer of OBJ."""

from __future__ import annotations

import logging
import re
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from ..mesh.cells import fans
from .arrays import MeshArrays, lines_of

_log = logging.getLogger("stretchmap")

_CORNER = rb"[ \t]+(-?\d+)(?:/(-?\d*))?(?:/-?\d*)?"
_FACE = re.compile(rb"^[ \t]*f" + 3 * _CORNER + rb"[ \t]*(?:#.*)?\r?$", re.MULTILINE)
_POLYGON = re.compile(rb"[ \t]*f(?:" + _CORNER + rb"){3,}[ \t]*(?:#.*)?\r?$")
_FACE_LINE = re.compile(rb"^[ \t]*f[ \t].*$", re.MULTILINE)


def read_obj(data: bytes) -> MeshArrays:
    """Parse an OBJ file: ``v``, ``vt`` and ``f`` lines; groups and the rest are skipped.

    Polygons become triangles. Texture coordinates may differ at the corners that meet in a vertex
    (a seam); where an index of theirs points nowhere all are left out, which the log says.
    """
    data = lines_of(data).replace(b"\\\n", b" ")
    points, last_point = _obj_table(data, b"v", 3)
    corners = _FACE.findall(data)
    lines = _FACE_LINE.findall(data)
    if not lines or not len(points):
        raise FileFormatError(f"{len(points)} vertices and {len(lines)} faces")
    table = np.array(corners) if len(corners) == len(lines) else _split_polygons(lines)
    first_face = _FACE_LINE.search(data).start()  # type: ignore[union-attr]
    words = table[:, 0::2]
    if last_point > first_face and (np.char.startswith(words, b"-")).any():
        faces = _relative_ids(data, lines, words)
    else:
        faces = _obj_ids(words, len(points), True)
    corner_uv = None
    if (table[:, 1::2] != b"").all():
        uv, last_uv = _obj_table(data, b"vt", 2)
        ids = _obj_ids(table[:, 1::2], len(uv), last_uv <= first_face)
        if ((ids < 0) | (ids >= len(uv))).any():
            _log.warning("texture indices point outside the vt lines; texture left out")
        else:
            corner_uv = uv[ids]
    return MeshArrays(points, F=faces, corner_uv=corner_uv)


def _split_polygons(lines: list[bytes]) -> NDArray[np.bytes_]:
    """(t, 6) vertex and texture words of the corners of all triangles."""
    odd = next((line for line in lines if not _POLYGON.match(line)), None)
    if odd is not None:
        raise FileFormatError(f"not a face: {odd.decode(errors='replace').strip()!r}")
    rows = [re.findall(_CORNER, line.split(b"#")[0]) for line in lines]
    words = np.array([corner for row in rows for corner in row])
    return fans(words, np.array([len(row) for row in rows])).reshape(-1, 6)


def _obj_table(data: bytes, key: bytes, width: int) -> tuple[NDArray[np.float64], int]:
    """All lines of one kind as an array, and where the last of them begins."""
    pattern = re.compile(rb"^[ \t]*" + key + rb"[ \t]+(.*)$", re.MULTILINE)
    lines = pattern.findall(data)
    if not lines:
        return np.empty((0, width)), 0
    last = max(data.rfind(b"\n" + key + b" "), data.rfind(b"\n" + key + b"\t"))
    text = [line.decode("ascii") for line in lines]
    table = np.loadtxt(text, usecols=range(width), ndmin=2)
    if len(table) != len(lines):
        raise FileFormatError(f"a line '{key.decode()}' without numbers")
    return table, last


def _obj_ids(words: NDArray[np.bytes_], n: int, in_order: bool) -> NDArray[np.int64]:
    ids = words.astype(np.int64)
    if (ids < 0).any():
        if not in_order:
            raise FileFormatError("relative indices in a file whose vertices and faces alternate")
        return np.where(ids < 0, ids + n, ids - 1)
    return ids - 1


def _relative_ids(data: bytes, lines: list[bytes], words: NDArray[np.bytes_]) -> NDArray[np.int64]:
    """Ids of triangles in a file whose vertices and faces alternate: -1 is the vertex before."""
    vertices = np.array([m.start() for m in re.finditer(rb"^[ \t]*v[ \t]", data, re.MULTILINE)])
    places = np.array([m.start() for m in _FACE_LINE.finditer(data)])
    corners = np.array([len(line.split(b"#")[0].split()) - 1 for line in lines])
    before = np.repeat(np.searchsorted(vertices, places), corners - 2)[:, None]
    ids = words.astype(np.int64)
    ids = np.where(ids < 0, ids + before, ids - 1)
    if (ids < 0).any():
        raise FileFormatError("a relative index points before the first vertex")
    return ids


def write_obj(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write points, faces and, where given, texture coordinates, seams included."""
    faces = mesh.elements + 1
    np.savetxt(file, mesh.V, fmt="v %.17g %.17g %.17g")
    if mesh.corner_uv is None:
        np.savetxt(file, faces, fmt="f %d %d %d")
        return
    uv, ids = np.unique(mesh.corner_uv.reshape(-1, 2), axis=0, return_inverse=True)
    np.savetxt(file, uv, fmt="vt %.17g %.17g")
    table = np.stack([faces, ids.reshape(faces.shape) + 1], axis=-1).reshape(-1, 6)
    np.savetxt(file, table, fmt="f %d/%d %d/%d %d/%d")
