"""Reader and writer of PLY files, text and binary, in either byte order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..base.options import shown
from ..errors import ArrayError, FileFormatError
from ..mesh.cells import fans
from .arrays import MeshArrays
from .ply_rows import Bytes, Words

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
_AXES = ("x", "y", "z")
# Of a list of property names, the corners of faces.
_CORNERS = ("vertex_indices", "vertex_index")


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


@dataclass(frozen=True, eq=False)
class _Lists:
    """A list in every row: all entries one after the other, and how many each row has."""

    entries: NDArray[Any]
    sizes: NDArray[np.int64]


_Table = dict[str, "NDArray[Any] | _Lists"]


def read_ply(data: bytes) -> MeshArrays:
    """Parse a PLY file of points and faces; scalar properties become point and cell data.

    Polygons become triangles, each with the data of its polygon.
    """
    vertex, face = _vertices_and_faces(*_header(data))
    corners = next((face[key] for key in _CORNERS if key in face), None)
    if not isinstance(corners, _Lists):
        raise FileFormatError("the faces have no list vertex_indices")
    points = np.stack([_scalar(vertex, axis) for axis in "xyz"], axis=1)
    cell_data = _scalars(face)
    if (corners.sizes == 3).all():
        faces = corners.entries.reshape(-1, 3)
    else:
        faces = fans(corners.entries, corners.sizes)
        cell_data = {k: np.repeat(a, corners.sizes - 2, axis=0) for k, a in cell_data.items()}
    point_data = {k: a for k, a in _scalars(vertex).items() if k not in _AXES}
    return MeshArrays(points, F=faces, point_data=point_data, cell_data=cell_data)


def _vertices_and_faces(order: str, elements: list[_Element], body: bytes) -> tuple[_Table, _Table]:
    """The two tables every mesh has; others are read and left."""
    tables: dict[str, _Table] = {}
    source = Bytes(body, order) if order else Words(body)
    at = 0
    for element in elements:
        if element.name in tables:
            raise FileFormatError(f"two elements are named {element.name}")
        tables[element.name], at = _table(element, source, at)
    if source.follows(at):
        raise FileFormatError("more follows the last row announced")
    rows = {element.name: element.rows for element in elements}
    for name in ("vertex", "face"):
        if not rows.get(name):
            raise FileFormatError(f"no element named {name}")
    return tables["vertex"], tables["face"]


def _scalar(table: _Table, name: str) -> NDArray[Any]:
    values = table.get(name)
    if not isinstance(values, np.ndarray):
        raise FileFormatError(f"the vertices have no property {name}")
    return values


def _scalars(table: _Table) -> dict[str, NDArray[Any]]:
    return {name: values for name, values in table.items() if isinstance(values, np.ndarray)}


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


def _table(element: _Element, source: Words | Bytes, at: int) -> tuple[_Table, int]:
    """All rows of an element, and where they end."""
    if not element.rows:
        return {}, at
    found = _even_table(element, source, at)
    return _uneven_table(element, source, at) if found is None else found


def _even_table(element: _Element, source: Words | Bytes, at: int) -> tuple[_Table, int] | None:
    """The rows at once where every list is as long as in the first row, else None."""
    columns: list[tuple[_Property, int, int]] = []  # where the entries begin, and how many
    width = 0
    for prop in element.properties:
        size = 1
        if prop.count_type is not None:
            size = source.count(prop.count_type, at + width)
            width += source.size(prop.count_type)
        if size < 0:
            raise FileFormatError(f"a list of {size} entries in {element.name}.{prop.name}")
        columns.append((prop, width, size))
        width += size * source.size(prop.type)
    end = at + element.rows * width
    if end > len(source):
        return None
    block = source.block(element.rows, at, width)
    table: _Table = {}
    for prop, start, size in columns:
        each = source.size(prop.type)
        units = block[:, start : start + size * each].reshape(-1, each)
        entries = source.numbers(units, prop.type)
        if prop.count_type is None:
            table[prop.name] = entries
            continue
        counts = block[:, start - source.size(prop.count_type) : start]
        sizes = source.numbers(counts, prop.count_type).astype(np.int64)
        if (sizes != size).any():
            return None
        table[prop.name] = _Lists(entries, sizes)
    return table, end


def _uneven_table(element: _Element, source: Words | Bytes, at: int) -> tuple[_Table, int]:
    """The rows one by one, since where one begins the one before it says."""
    starts: list[list[int]] = [[] for _ in element.properties]
    sizes: list[list[int]] = [[] for _ in element.properties]
    for _ in range(element.rows):
        for prop, start, size in zip(element.properties, starts, sizes, strict=True):
            count = 1
            if prop.count_type is not None:
                count = source.count(prop.count_type, at)
                at += source.size(prop.count_type)
            start.append(at)
            size.append(count)
            at += count * source.size(prop.type)
        if at > len(source) or min(size[-1] for size in sizes) < 0:
            raise FileFormatError(f"the file ends within the rows of {element.name}")
    table: _Table = {}
    for prop, start, size in zip(element.properties, starts, sizes, strict=True):
        counts = np.array(size, np.int64)
        row = np.repeat(np.arange(element.rows), counts)
        within = np.arange(len(row)) - (np.cumsum(counts) - counts)[row]
        places = np.array(start, np.int64)[row] + within * source.size(prop.type)
        entries = source.numbers(source.gathered(prop.type, places), prop.type)
        table[prop.name] = entries if prop.count_type is None else _Lists(entries, counts)
    return table, at


def write_ply(file: BinaryIO, mesh: MeshArrays) -> None:
    """Write a binary PLY with every point and cell array as scalar properties.

    Raises
    ------
    ArrayError
        As `require_names`.
    """
    columns, cells = require_names(mesh.point_data, mesh.cell_data)
    points = {axis: mesh.V[:, k] for k, axis in enumerate(_AXES)} | columns
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


def require_names(
    point_data: Mapping[str, NDArray[Any]], cell_data: Mapping[str, NDArray[Any]]
) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """The columns of all arrays, (n,) each, by the names they have in a file.

    Raises
    ------
    ArrayError
        The name of an array is one that PLY has for the mesh, that of another array once spaces
        are underscores and columns have numbers, or not of ASCII characters.
    """
    columns, cells = _columns(point_data), _columns(cell_data)
    of_points, of_faces = set(_AXES), {"#", *_CORNERS}
    for name in (*columns, *cells):
        taken = (name in columns and name in of_points) or (name in cells and name in of_faces)
        if taken or not name.isascii():
            raise ArrayError(
                f"an array named {shown(name)} cannot be written to .ply, whose names are of ASCII "
                f"characters and other than {', '.join((*_AXES, *_CORNERS))}; rename it"
            )
    return columns, cells


def _columns(data: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """One entry per column; column k of a vector gets the suffix ``_k``, and spaces underscores."""
    columns: dict[str, NDArray[Any]] = {}
    whose: dict[str, str] = {}
    for name, array in data.items():
        word = "_".join(name.split())
        if array.ndim == 1:
            own = {word: array}
        else:
            own = {f"{word}_{k}": array[:, k] for k in range(array.shape[1])}
        for column in own:
            if column in columns:
                raise ArrayError(
                    f"the arrays {shown(whose[column])} and {shown(name)} would both be {column} "
                    "in .ply; rename one"
                )
            whose[column] = name
        columns |= own
    return columns
