"""Reader and writer of PLY files, text and binary, in either byte order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from .arrays import MeshArrays, triangles_only

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_NAMES = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint",
    "f4": "float", "f8": "double",
}  # fmt: skip
_ORDERS = {b"binary_little_endian": "<", b"binary_big_endian": ">", b"ascii": ""}


@dataclass(frozen=True)
class _Property:
    name: str
    type: str
    count_type: str | None  # of a list, else None


@dataclass(frozen=True)
class _Element:
    name: str
    rows: int
    properties: list[_Property]


def read_ply(data: bytes) -> MeshArrays:
    """Parse a PLY file of points and triangles; scalar properties become point and cell data."""
    order, elements, body = _header(data)
    tables: dict[str, NDArray[Any]] = {}
    words = None if order else body.split()
    position = 0
    for element in elements:
        if {"vertex", "face"} <= tables.keys():
            break
        if words is None:
            table, position = _binary_table(element, body, position, order)
        else:
            table, position = _text_table(element, words, position)
        tables[element.name] = table
    for name in ("vertex", "face"):
        if name not in tables or not len(tables[name]):
            raise FileFormatError(f"no element named {name}")
    vertex, face = tables["vertex"], tables["face"]
    key = next(
        (k for k in ("vertex_indices", "vertex_index") if k in (face.dtype.names or ())), None
    )
    if key is None:
        raise FileFormatError("the faces have no list vertex_indices")
    points = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    return MeshArrays(
        points,
        F=face[key],
        point_data=_scalars(vertex, {"x", "y", "z"}),
        cell_data=_scalars(face, {key}),
    )


def _scalars(table: NDArray[Any], without: set[str]) -> dict[str, NDArray[Any]]:
    names = [name for name in table.dtype.names or () if name not in without]
    return {name: table[name] for name in names if table[name].ndim == 1 and name[:1] != "#"}


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    head, mark, body = data.partition(b"end_header")
    lines = head.split(b"\n")
    if lines[0].strip() != b"ply" or not mark:
        raise FileFormatError("no complete PLY header")
    order: str | None = None
    elements: list[_Element] = []
    for line in lines[1:]:
        words = line.split()
        if not words or words[0] in (b"comment", b"obj_info"):
            continue
        if words[0] == b"format" and words[1] in _ORDERS:
            order = _ORDERS[words[1]]
        elif words[0] == b"element":
            elements.append(_Element(words[1].decode(), int(words[2]), []))
        elif words[0] == b"property" and elements:
            *types, name = (word.decode() for word in words[1:])
            count = _TYPES[types[1]] if types[0] == "list" else None
            elements[-1].properties.append(_Property(name, _TYPES[types[-1]], count))
        else:
            raise FileFormatError(f"unknown header line {line.decode(errors='replace')!r}")
    if order is None:
        raise FileFormatError("unknown PLY format")
    return order, elements, body.split(b"\n", 1)[1]


def _binary_table(
    element: _Element, body: bytes, position: int, order: str
) -> tuple[NDArray[Any], int]:
    """All rows of an element; a list must be as long in every row as in the first."""
    fields: list[tuple[Any, ...]] = []
    lists: list[tuple[str, int]] = []
    for prop in element.properties:
        if prop.count_type is None:
            fields.append((prop.name, order + prop.type))
            continue
        start = position + np.dtype(fields).itemsize if fields else position
        size = (
            int(np.frombuffer(body, order + prop.count_type, 1, offset=start)[0])
            if element.rows
            else 3
        )
        if size * np.dtype(prop.type).itemsize > len(body):
            raise FileFormatError(f"a list of {size} entries does not fit into the file")
        lists.append((prop.name, size))
        fields.append((f"#{prop.name}", order + prop.count_type))
        fields.append((prop.name, order + prop.type, (size,)))
    dtype = np.dtype(fields)
    table = np.frombuffer(body, dtype, element.rows, offset=position)
    _check_lists(element, table, lists)
    return table, position + element.rows * dtype.itemsize


def _text_table(element: _Element, words: list[bytes], position: int) -> tuple[NDArray[Any], int]:
    fields: list[tuple[Any, ...]] = []
    columns: list[tuple[str, int, int]] = []
    lists: list[tuple[str, int]] = []
    width = 0
    for prop in element.properties:
        if prop.count_type is None:
            fields.append((prop.name, prop.type))
            columns.append((prop.name, width, 0))
            width += 1
            continue
        size = int(words[position + width]) if element.rows else 3
        lists.append((prop.name, size))
        fields += [(f"#{prop.name}", prop.count_type), (prop.name, prop.type, (size,))]
        columns += [(f"#{prop.name}", width, 0), (prop.name, width + 1, size)]
        width += 1 + size
    end = position + element.rows * width
    if end > len(words):
        raise FileFormatError(f"the file ends within the rows of {element.name}")
    values = np.array(words[position:end], dtype=np.bytes_).reshape(element.rows, width)
    table = np.empty(element.rows, np.dtype(fields))
    for name, start, size in columns:
        part = values[:, start : start + size] if size else values[:, start]
        table[name] = part.astype(table.dtype[name].base)
    _check_lists(element, table, lists)
    return table, end


def _check_lists(element: _Element, table: NDArray[Any], lists: list[tuple[str, int]]) -> None:
    for name, size in lists:
        sizes = table[f"#{name}"]
        if element.name == "face" and name in ("vertex_indices", "vertex_index"):
            # Once a row has another length, all that follows is out of step.
            wrong = np.flatnonzero(sizes != 3)
            triangles_only(sizes[wrong[:1]])
        elif (sizes != size).any():
            raise FileFormatError(f"lists of several lengths in {element.name}.{name}")


def write_ply(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write a binary PLY with every point and cell array as scalar properties."""
    points = {axis: mesh.V[:, k] for k, axis in enumerate("xyz")} | _columns(mesh.point_data)
    cells = _columns(mesh.cell_data)
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.V)}"]
    lines += [f"property {_NAMES[a.dtype.str[1:]]} {name}" for name, a in points.items()]
    lines += [f"element face {len(mesh.elements)}", "property list uchar int vertex_indices"]
    lines += [f"property {_NAMES[a.dtype.str[1:]]} {name}" for name, a in cells.items()]
    file.write(("\n".join([*lines, "end_header"]) + "\n").encode("ascii"))
    vertex = np.empty(len(mesh.V), [(k, "<" + a.dtype.str[1:]) for k, a in points.items()])
    for name, column in points.items():
        vertex[name] = column
    layout = [("#", "u1"), ("vertex_indices", "<i4", 3)]
    face = np.empty(
        len(mesh.elements), layout + [(k, "<" + a.dtype.str[1:]) for k, a in cells.items()]
    )
    face["#"] = 3
    face["vertex_indices"] = mesh.elements
    for name, column in cells.items():
        face[name] = column
    file.write(vertex.tobytes())
    file.write(face.tobytes())


def _columns(data: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """One entry per column, of a type PLY knows; column k of a vector gets the suffix ``_k``."""
    columns: dict[str, NDArray[Any]] = {}
    for name, array in data.items():
        word = "_".join(name.split())
        if array.dtype.str[1:] not in _NAMES:
            array = array.astype(np.uint8 if array.dtype.kind == "b" else np.float64)
        if array.ndim == 1:
            columns[word] = array
        else:
            columns |= {f"{word}_{k}": array[:, k] for k in range(array.shape[1])}
    return columns
