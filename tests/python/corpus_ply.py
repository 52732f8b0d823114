"""The PLY files of the corpus."""

from __future__ import annotations

import io
from collections.abc import Iterator

import numpy as np

from corpus_cube import MIXED, POINTS, QUADS, TRIANGLES

_NUMPY = {
    "float": "f4", "double": "f8", "float64": "f8", "int": "i4", "int32": "i4", "int16": "i2",
    "uint": "u4", "uchar": "u1", "ushort": "u2",
}  # fmt: skip
_LIST = "property list uchar int vertex_indices\n"
_RED = "property uchar red\n"
_SHAPES = (("", TRIANGLES, 0), (", quads", QUADS, 6), (", quads and triangles", MIXED, 3))


def files() -> Iterator[tuple[str, str | bytes, int]]:
    """Names, contents, and how many polygons have to be split."""
    rows, faces = _rows(), _faces(TRIANGLES)
    plain = _text()
    edges = "element edge 1\nproperty int a\nproperty int b\n"
    for name, of, split in _SHAPES:
        yield f"text{name}", _text(faces=_faces(of)), split
    yield "text, CRLF", plain.replace("\n", "\r\n"), 0
    head, mark, body = plain.partition("end_header\n")
    yield "text, all in one line", head + mark + body.replace("\n", " "), 0
    yield "text, vertex_index", plain.replace("vertex_indices", "vertex_index"), 0
    yield "text, comments", _text(head="comment c\nobj_info i\n"), 0
    yield "text, an element of edges behind", _text(end=edges) + "0 1\n", 0
    yield "text, an element without rows", _text(head="element material 0\nproperty int a\n"), 0
    first = f"ply\nformat ascii 1.0\nelement face 12\n{_LIST}element vertex 8\n{_xyz()}end_header\n"
    yield "text, faces first", first + faces + rows, 0
    yield "text, colors of faces", _text(faces=_faces(TRIANGLES, " 255\n"), end=_RED), 0
    before = plain.replace(_LIST, _RED + _LIST).replace("\n3 ", "\n9 3 ")
    yield "text, colors before the corners", before, 0
    quality = plain.replace("float z\n", "float z\nproperty float quality\n")
    yield "text, a property that is nan", quality.replace(rows, rows.replace("\n", " nan\n")), 0
    uneven = "".join(f"{f} {k % 3} {'7 ' * (k % 3)}\n" for k, f in enumerate(faces.splitlines()))
    texture = "property list uchar float texcoord\n"
    yield "text, lists of several lengths behind", _text(faces=uneven, end=texture), 0
    seen = "".join(f"{k % 3} {'5 ' * (k % 3)}{row}\n" for k, row in enumerate(rows.splitlines()))
    listed = plain.replace("property float x", "property list uchar int seen\nproperty float x")
    yield "text, a list before the coordinates", listed.replace(rows, seen), 0
    for order in ("little", "big"):
        for name, of, split in _SHAPES:
            yield f"{order} endian{name}", _binary(order, of), split
    shorts = _binary("little", TRIANGLES, "double", "ushort", "uint")
    yield "doubles, short counts, unsigned ids", shorts, 0
    yield "int counts, short ids", _binary("big", MIXED, "float64", "int32", "int16"), 3
    yield "whole coordinates", _binary("little", TRIANGLES, "int"), 0
    yield "normals and colors", _binary("little", TRIANGLES, more=True), 0
    yield "lists of several lengths behind the corners", _binary("little", MIXED, lists=True), 3


def _rows() -> str:
    return "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in POINTS.tolist())


def _faces(of: list[list[int]], end: str = "\n") -> str:
    return "".join(f"{len(f)} {' '.join(map(str, f))}{end}" for f in of)


def _xyz(kind: str = "float") -> str:
    return "".join(f"property {kind} {axis}\n" for axis in "xyz")


def _text(faces: str = _faces(TRIANGLES), head: str = "", end: str = "") -> str:
    n_faces = len(faces.splitlines())
    vertex, face = f"element vertex 8\n{_xyz()}", f"element face {n_faces}\n{_LIST}{end}"
    return f"ply\nformat ascii 1.0\n{head}{vertex}{face}end_header\n{_rows()}{faces}"


def _binary(
    order: str, of: list[list[int]], kind: str = "float", count: str = "uchar",
    ids: str = "int", more: bool = False, lists: bool = False,
) -> bytes:  # fmt: skip
    sign = {"little": "<", "big": ">"}[order]
    head = f"ply\nformat binary_{order}_endian 1.0\nelement vertex 8\n{_xyz(kind)}"
    layout = [(axis, sign + _NUMPY[kind]) for axis in "xyz"]
    if more:
        head += "property float nx\nproperty uchar red\nproperty double quality\n"
        layout += [("nx", sign + "f4"), ("red", "u1"), ("quality", sign + "f8")]
    head += f"element face {len(of)}\nproperty list {count} {ids} vertex_indices\n"
    head += "property list uchar float texcoord\nproperty uchar flag\n" * lists
    vertex = np.ones(8, layout)
    for k, axis in enumerate("xyz"):
        vertex[axis] = POINTS[:, k]
    out = io.BytesIO()
    out.write((head + "end_header\n").encode() + vertex.tobytes())
    for k, face in enumerate(of):
        out.write(np.array([len(face)], sign + _NUMPY[count]).tobytes())
        out.write(np.array(face, sign + _NUMPY[ids]).tobytes())
        if lists:
            out.write(bytes([k % 3]) + np.ones(k % 3, sign + "f4").tobytes() + b"\7")
    return out.getvalue()
