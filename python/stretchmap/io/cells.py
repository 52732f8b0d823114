"""Cells of all kinds as the triangles or tets of a mesh; the kinds are named as in meshio."""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from .arrays import MeshArrays, fans

__all__ = ["Block", "simplices"]

_log = logging.getLogger("stretchmap")

# Of an element of any order the corners come first.
_TETS = re.compile(r"tetra\d*")
_TRIANGLES = re.compile(r"triangle\d*")
_POLYGONS = ("quad", "polygon")
# Cells below the surface (points and curves that mesh generators add) carry nothing we need.
_BELOW = re.compile(r"vertex|line\d*")


@dataclass(frozen=True, eq=False)
class Block:
    """Cells (k, n) of one kind and their data, one row per cell."""

    kind: str
    cells: NDArray[Any]
    data: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def simplices(
    points: NDArray[Any], blocks: Sequence[Block], point_data: Mapping[str, NDArray[Any]]
) -> MeshArrays:
    """The tets where there are any, else the triangles, with what lies beside them left out.

    Elements of higher order are taken by their corners, and points that belong to nothing but their
    edges, faces and inside are dropped; quads of a surface are split. The log says so.

    Raises
    ------
    FileFormatError
        There are neither, or cells of other kinds as well.
    """
    tets, used = _used([block for block in blocks if len(block.cells)])
    elements, data = _elements(used, 4 if tets else 3)
    kept = _without_midpoints(used, elements, len(points))
    if kept is not None:
        number = np.full(len(points), -1)
        number[kept] = np.arange(len(kept))
        points, elements = points[kept], number[elements]
        point_data = {name: np.asarray(array)[kept] for name, array in point_data.items()}
    F, T = (None, elements) if tets else (elements, None)
    return MeshArrays(points, F=F, T=T, point_data=dict(point_data), cell_data=data)


def _used(blocks: Sequence[Block]) -> tuple[bool, list[Block]]:
    """Whether there are tets, and the blocks of them, or of the triangles and polygons."""
    counts: Counter[str] = Counter()
    of: dict[str, list[Block]] = {"tets": [], "flat": [], "below": [], "other": []}
    for block in blocks:
        counts[block.kind] += len(block.cells)
        of[_class(block.kind)].append(block)
    found = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    if of["other"]:
        raise FileFormatError(
            f"the cells are {found}; only triangles and tets can be used, split or convert the "
            "others"
        )
    used = of["tets"] or of["flat"]
    if not used:
        raise FileFormatError(f"no triangles and no tets ({found or 'no cells'})")
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
        raise FileFormatError(f"cells name points from {ids.min()} to {ids.max()}, there are {n}")
    dropped = np.zeros(n, bool)
    dropped[ids] = True
    dropped[elements] = False
    _log.warning(
        "%d elements of higher order are taken by their corners, %d points left out",
        sum(len(block.cells) for block in higher),
        int(dropped.sum()),
    )
    return np.flatnonzero(~dropped)
