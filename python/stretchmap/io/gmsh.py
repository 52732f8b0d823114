"""Reader of Gmsh's ``.msh`` files of versions 2 and 4.1, text and binary.

meshio's makes room for whatever a header announces, takes tables as long as the largest tag, and
fails where some entities belong to physical groups and others do not.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from ..mesh.cells import Block, simplices
from .arrays import MeshArrays
from .gmsh_sources import Binary, Source, Text

__all__ = ["is_gmsh", "read_gmsh"]

_FORMAT = re.compile(rb"\s*\$MeshFormat\s+(4\.1|2(?:\.\d)?)\s+([01])\s+8\s*\n")
_SECTION = re.compile(rb"^\$(\w+)[ \t]*\r?\n", re.MULTILINE)
# Number of an element type: its name and its nodes.
_TYPES = {
    1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8),
    6: ("wedge", 6), 7: ("pyramid", 5), 8: ("line3", 3), 9: ("triangle6", 6), 10: ("quad9", 9),
    11: ("tetra10", 10), 15: ("vertex", 1), 16: ("quad8", 8), 21: ("triangle10", 10),
    23: ("triangle15", 15), 26: ("line4", 4), 27: ("line5", 5), 29: ("tetra20", 20),
    30: ("tetra35", 35),
}  # fmt: skip


def is_gmsh(data: bytes) -> bool:
    """Whether it is such a file; the others are meshio's."""
    return _FORMAT.match(data) is not None


def read_gmsh(data: bytes) -> MeshArrays:
    """Parse a file: points, triangles or tets, their groups, and data by node and by element.

    Cell data ``gmsh:physical`` is the first physical group of each element's entity, 0 where it has
    none, and ``gmsh:geometrical`` the entity.

    Raises
    ------
    FileFormatError
        Other nodes than announced, tags that occur twice or nowhere, cells of other kinds.
    Exception
        What NumPy raises where the file ends too early.
    """
    header = _FORMAT.match(data)
    if header is None:
        raise FileFormatError("it is no .msh file of version 2 or 4.1")
    take: type[Text] | type[Binary] = Binary if header[2] == b"1" else Text
    if take is Binary and data[header.end() : header.end() + 4] != b"\1\0\0\0":
        raise FileFormatError("its bytes are in the order of another kind of machine")
    readers = _READERS if header[1] == b"4.1" else _READERS_OF_2
    found = _Found()
    at = _after(data, b"$EndMeshFormat", header.end())
    while section := _SECTION.search(data, at):
        name = section[1].decode()
        mark, at = b"$End" + section[1], section.end()
        if name in readers:
            count = 0
            if readers is _READERS_OF_2:  # text in every file
                end = data.find(b"\n", at) + 1
                count, at = int(data[at:end]), end
            source = take(data, at, mark)
            readers[name](found, source, count)
            at = source.end
        elif name in ("NodeData", "ElementData"):
            label, width, rows, at = _data_header(data, at)
            source = take(data, at, mark)
            ids, values = source.rows(rows, width)
            at = source.end
            (found.node_data if name == "NodeData" else found.element_data)[label] = ids, values
        at = _after(data, mark, at)
    return found.mesh()


def _after(data: bytes, mark: bytes, at: int) -> int:
    end = data.find(mark, at)
    if end < 0:
        raise FileFormatError(f"{mark.decode()} is missing")
    return end + len(mark)


def _data_header(data: bytes, at: int) -> tuple[str, int, int, int]:
    """Name, columns and rows of data, which are text in every file, and where the rows begin."""
    tags: list[list[str]] = []
    for _ in range(3):  # words, real numbers, whole numbers
        lines = []
        end = data.find(b"\n", at) + 1
        for _ in range(int(data[at:end])):
            at, end = end, data.find(b"\n", end) + 1
            lines.append(data[at:end].decode().strip().strip('"'))
            if not end:
                raise FileFormatError("the file ends within data")
        tags.append(lines)
        at = end
    names, _, (_, width, rows, *_) = tags
    return names[0], int(width), int(rows), at


_Rows = tuple[NDArray[Any], NDArray[Any]]


@dataclass
class _Found:
    physical: dict[tuple[int, int], int] = field(default_factory=dict)
    tags: NDArray[Any] | None = None
    points: NDArray[Any] | None = None
    blocks: list[Block] = field(default_factory=list)
    element_tags: list[NDArray[Any]] = field(default_factory=list)
    node_data: dict[str, _Rows] = field(default_factory=dict)
    element_data: dict[str, _Rows] = field(default_factory=dict)

    def mesh(self) -> MeshArrays:
        """What was found, elements by rows of points."""
        if self.points is None or self.tags is None:
            raise FileFormatError("it has no nodes")
        order = np.argsort(self.tags, kind="stable")
        tags = self.tags[order]
        if len(tags) and (np.diff(tags) == 0).any():
            raise FileFormatError("two nodes have one tag")
        blocks = []
        for block, elements in zip(self.blocks, self.element_tags, strict=True):
            place = np.minimum(np.searchsorted(tags, block.cells), len(tags) - 1)
            if (tags[place] != block.cells).any():
                raise FileFormatError("an element names a node that is not there")
            data = {k: _by_tag(elements, rows) for k, rows in self.element_data.items()}
            blocks.append(Block(block.kind, order[place], {**block.data, **data}))
        data = {name: _by_tag(self.tags, rows) for name, rows in self.node_data.items()}
        return MeshArrays.of(simplices(self.points, blocks, data))


def _by_tag(tags: NDArray[Any], rows: _Rows) -> NDArray[np.float64]:
    """Values in the order of some tags, NaN where there are none."""
    ids, values = rows
    out = np.full((len(tags), values.shape[1]), np.nan)
    if len(ids):
        order = np.argsort(ids, kind="stable")
        place = order[np.minimum(np.searchsorted(ids[order], tags), len(ids) - 1)]
        known = ids[place] == tags
        out[known] = values[place[known]]
    return out[:, 0] if out.shape[1] == 1 else out


def _entities(found: _Found, source: Source, _: int) -> None:
    for dim, count in enumerate(source.take("<i8", 4).tolist()):
        for _ in range(count):
            tag = int(source.take("<i4", 1)[0])
            source.take("<f8", 6 if dim else 3)  # a box, a point
            groups = source.take("<i4", int(source.take("<i8", 1)[0]))
            if dim:
                source.take("<i4", int(source.take("<i8", 1)[0]))  # what bounds it
            found.physical[dim, tag] = int(groups[0]) if len(groups) else 0


def _nodes(found: _Found, source: Source, _: int) -> None:
    if found.tags is not None:
        raise FileFormatError("it holds two lists of nodes")
    n_blocks, announced, _, _ = source.take("<i8", 4).tolist()
    tags, points = [np.empty(0, np.int64)], [np.empty((0, 3))]
    for _ in range(n_blocks):  # ends where the file does
        dim, _, parametric = source.take("<i4", 3).tolist()
        count = int(source.take("<i8", 1)[0])
        tags.append(source.take("<i8", count))
        width = 3 + (dim if parametric else 0)
        points.append(source.take("<f8", count * width).reshape(count, width)[:, :3])
    found.tags, found.points = np.concatenate(tags), np.concatenate(points)
    if len(found.tags) != announced:
        raise FileFormatError(f"{announced} nodes are announced, {len(found.tags)} follow")


def _elements(found: _Found, source: Source, _: int) -> None:
    n_blocks, announced, _, _ = source.take("<i8", 4).tolist()
    total = 0
    for _ in range(n_blocks):
        dim, entity, kind = source.take("<i4", 3).tolist()
        count = int(source.take("<i8", 1)[0])
        if kind not in _TYPES:
            raise FileFormatError(f"elements of type {kind} are not known")
        name, width = _TYPES[kind]
        rows = source.take("<i8", count * (1 + width)).reshape(count, 1 + width)
        data = {
            "gmsh:physical": np.full(count, found.physical.get((dim, entity), 0)),
            "gmsh:geometrical": np.full(count, entity),
        }
        found.blocks.append(Block(name, rows[:, 1:], data))
        found.element_tags.append(rows[:, 0])
        total += count
    if total != announced:
        raise FileFormatError(f"{announced} elements are announced, {total} follow")


def _nodes_of_2(found: _Found, source: Source, count: int) -> None:
    if found.tags is not None:
        raise FileFormatError("it holds two lists of nodes")
    found.tags, found.points = source.rows(count, 3)


def _elements_of_2(found: _Found, source: Source, count: int) -> None:
    """Runs of elements of one type with one number of tags."""
    while count:
        kind, n_tags, most = source.run(count)
        if kind not in _TYPES or n_tags < 0:
            raise FileFormatError(f"elements of type {kind} with {n_tags} tags are not known")
        name, width = _TYPES[kind]
        rows = source.run_rows(kind, n_tags, most, width)
        if not len(rows):
            raise FileFormatError("the file ends within its elements")
        tags, nothing = rows[:, 1 : 1 + n_tags], np.zeros(len(rows), int)
        data = {
            "gmsh:physical": tags[:, 0] if n_tags > 0 else nothing,
            "gmsh:geometrical": tags[:, 1] if n_tags > 1 else nothing,
        }
        found.blocks.append(Block(name, rows[:, 1 + n_tags :], data))
        found.element_tags.append(rows[:, 0])
        count -= len(rows)


_READERS = {"Entities": _entities, "Nodes": _nodes, "Elements": _elements}
_READERS_OF_2 = {"Nodes": _nodes_of_2, "Elements": _elements_of_2}
