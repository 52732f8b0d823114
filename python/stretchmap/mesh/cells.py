"""Cells of all kinds, of files and of other libraries, as the triangles or tets of a mesh.

The kinds are named as in meshio.
"""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import KindError
from .exchange import Cells

__all__ = ["Block", "blocks_of_vtk", "fans", "simplices", "vertex_ids"]

_log = logging.getLogger("stretchmap")

# Of an element of any order the corners come first.
_TETS = re.compile(r"tetra\d*|VTK_\w+_TETRAHEDRON")
_TRIANGLES = re.compile(r"triangle\d*|VTK_\w+_TRIANGLE")
_POLYGONS = ("quad", "polygon")
# Cells below the surface (points and curves that mesh generators add) carry nothing we need.
_BELOW = re.compile(r"vertex|line\d*|VTK_\w+_CURVE")
# VTK's numbers of cell types; what is missing is named by its number.
_OF_VTK = {
    1: "vertex", 2: "vertex", 3: "line", 4: "line", 5: "triangle", 7: "polygon", 9: "quad",
    10: "tetra", 12: "hexahedron", 13: "wedge", 14: "pyramid", 21: "line3", 22: "triangle6",
    24: "tetra10", 34: "triangle7", 35: "line4", 68: "line", 69: "triangle", 71: "tetra",
    75: "line", 76: "triangle", 78: "tetra",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Block:
    """Cells (k, n) of one kind and their data, one row per cell."""

    kind: str
    cells: NDArray[Any]
    data: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def vertex_ids(kind: str, cells: Any) -> NDArray[Any]:
    """Vertex ids of cells as integers.

    Of polyhedra, which meshio lists by their faces, there are none; of unsigned ids it makes
    floating-point numbers, all of them whole.

    Raises
    ------
    KindError
        They are not whole.
    """
    if kind.startswith("polyhedron"):
        return np.empty((len(cells), 0), np.int64)
    ids: NDArray[Any] = np.asarray(cells)
    if ids.dtype.kind != "f":
        return ids
    with np.errstate(invalid="ignore"):
        whole = ids.astype(np.int64)
    if (whole != ids).any():
        raise KindError("cells name points by fractions")
    return whole


def blocks_of_vtk(
    n_points: int,
    types: NDArray[Any],
    cells: NDArray[Any],
    offsets: NDArray[Any],
    cell_data: Mapping[str, NDArray[Any]] | None = None,
) -> list[Block]:
    """The cells of a grid of VTK, by kind and number of corners.

    Parameters
    ----------
    n_points : int
    types : (m,) ndarray of integers
        VTK's numbers of cell types.
    cells : (c,) ndarray of integers
        Corners of all cells, one after the other.
    offsets : (m + 1,) ndarray of integers
        Where those of each cell begin and end.
    cell_data : mapping of str to (m, ...) ndarray, optional

    Raises
    ------
    KindError
        A cell names a point that is not there.
    """
    offsets = offsets.astype(np.int64)
    sizes = np.diff(offsets)
    named = np.unique(cells)
    if len(named) and not 0 <= named[0] <= named[-1] < n_points:
        raise KindError("cells name points that are not there")
    blocks = []
    for kind, size in np.unique(np.stack([types, sizes]), axis=1).T.tolist():
        rows = np.flatnonzero((types == kind) & (sizes == size))
        data = {name: array[rows] for name, array in (cell_data or {}).items()}
        ids = cells[offsets[rows, None] + np.arange(size)]
        blocks.append(Block(_OF_VTK.get(kind, f"cells of VTK's type {kind}"), ids, data))
    return blocks


def simplices(
    points: NDArray[Any],
    blocks: Sequence[Block],
    point_data: Mapping[str, NDArray[Any]] | None = None,
) -> Cells:
    """The tets where there are any, else the triangles, with what lies beside them left out.

    Elements of higher order are taken by their corners, and points that belong to nothing but their
    edges, faces and inside are dropped; quads of a surface are split. The log says so.

    Raises
    ------
    KindError
        There are neither, or cells of other kinds as well.
    """
    tets, used = _used([block for block in blocks if len(block.cells)])
    elements, data = _elements(used, 4 if tets else 3)
    kept = _without_midpoints(used, elements, len(points))
    if kept is not None:
        number = np.full(len(points), -1)
        number[kept] = np.arange(len(kept))
        points, elements = points[kept], number[elements]
        point_data = {k: np.asarray(array)[kept] for k, array in (point_data or {}).items()}
    kind = "tetra" if tets else "triangle"
    return Cells(points, kind, elements, dict(point_data or {}), data)


def _used(blocks: Sequence[Block]) -> tuple[bool, list[Block]]:
    """Whether there are tets, and the blocks of them, or of the triangles and polygons."""
    counts: Counter[str] = Counter()
    of: dict[str, list[Block]] = {"tets": [], "flat": [], "below": [], "other": []}
    for block in blocks:
        counts[block.kind] += len(block.cells)
        of[_class(block.kind)].append(block)
    found = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    if of["other"]:
        raise KindError(
            f"the cells are {found}; only triangles and tets can be used, split or convert the "
            "others"
        )
    used = of["tets"] or of["flat"]
    if not used:
        raise KindError(f"no triangles and no tets ({found or 'no cells'})")
    if left_out := counts.total() - sum(len(block.cells) for block in used):
        _log.info("%d of the cells left out (%s)", left_out, found)
    return bool(of["tets"]), used


def _class(kind: str) -> str:
    if _TETS.fullmatch(kind):
        return "tets"
    if _TRIANGLES.fullmatch(kind) or kind in _POLYGONS:
        return "flat"
    return "below" if _BELOW.fullmatch(kind) else "other"


def _elements(blocks: Sequence[Block], width: int) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    """Corners of all simplices, and the data all blocks have."""
    names = set.intersection(*(set(block.data) for block in blocks))
    rows: list[NDArray[Any]] = []
    data: dict[str, list[NDArray[Any]]] = {k: [] for k in blocks[0].data if k in names}
    for block in blocks:
        corners, count = block.cells, 1
        if block.kind in _POLYGONS:
            sizes = np.full(len(corners), corners.shape[1])
            corners, count = fans(corners.reshape(-1), sizes), corners.shape[1] - 2
        rows.append(corners[:, :width])
        for name, parts in data.items():
            parts.append(np.repeat(block.data[name], count, axis=0))
    return np.concatenate(rows), {name: np.concatenate(parts) for name, parts in data.items()}


def _without_midpoints(
    blocks: Sequence[Block], elements: NDArray[Any], n: int
) -> NDArray[np.intp] | None:
    """Ids of the points that stay; None where all elements are of first order."""
    higher = [
        block
        for block in blocks
        if block.kind not in _POLYGONS and block.cells.shape[1] > elements.shape[1]
    ]
    if not higher:
        return None
    ids = np.concatenate([block.cells.reshape(-1) for block in blocks])
    if len(ids) and (ids.min() < 0 or ids.max() >= n):
        raise KindError(f"cells name points from {ids.min()} to {ids.max()}, there are {n}")
    dropped = np.zeros(n, bool)
    dropped[ids] = True
    dropped[elements] = False
    _log.warning(
        "%d elements of higher order are taken by their corners, %d points left out",
        sum(len(block.cells) for block in higher),
        int(dropped.sum()),
    )
    return np.flatnonzero(~dropped)


def fans(corners: NDArray[Any], sizes: NDArray[Any]) -> NDArray[Any]:
    """Triangles of polygons, each a fan from its first corner; says how many were split.

    Parameters
    ----------
    corners : (c, ...) ndarray
        Corners of all polygons, one after the other: vertex ids, or rows of several ids each.
    sizes : (m,) ndarray of integers
        Number of corners of each polygon.

    Returns
    -------
    (t, 3, ...) ndarray
        No corner is added; triangles of a polygon follow each other in its place.

    Raises
    ------
    KindError
        A polygon of fewer than three corners.
    """
    if (sizes < 3).any():
        raise KindError(f"{int((sizes < 3).sum())} faces with fewer than three corners")
    count = sizes - 2
    polygon = np.repeat(np.arange(len(sizes)), count)
    first = (np.cumsum(sizes) - sizes)[polygon]
    step = np.arange(len(polygon)) - (np.cumsum(count) - count)[polygon]
    n_split = int((sizes > 3).sum())
    if n_split:
        _log.warning(
            "%d polygons were split into %d triangles", n_split, int(count[sizes > 3].sum())
        )
    ids = np.stack([first, first + step + 1, first + step + 2], axis=1)
    return np.asarray(corners[ids])
