"""Data of points and cells as a format can hold them: all values kept, or refused beforehand; in
Medit files, which have no place for arrays, regions alone."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.options import shown
from ..errors import ArrayError

__all__ = ["GMSH_TAGS", "medit_refs", "storable"]

_log = logging.getLogger("stretchmap")

# Regions of Gmsh's: of a cell, the first physical group and the entity.
GMSH_TAGS = ("gmsh:physical", "gmsh:geometrical")
# What a cell belongs to, by the names readers and partitions give it; the first counts.
_MEDIT_REFS = "medit:ref"
_REGIONS = (_MEDIT_REFS, *GMSH_TAGS, "part")

# Types of numbers a format holds, in the order they are tried. Of single precision meshio writes a
# digit too few into .xdmf.
_VTK = ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8")
_TYPES = {
    ".ply": ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"),
    ".vtu": _VTK,
    ".vtk": _VTK,
    ".xdmf": ("i4", "u4", "i8", "u8", "f8"),
    ".msh": ("f8",),
}
# How many columns an array may have, where not any number will do.
_COLUMNS = {".xdmf": (1, 2, 3, 6, 9), ".msh": (1, 3, 9)}
# Names that stand for something else in .msh.
_TAKEN_BY_GMSH = ("cell_tags", "gmsh:dim_tags")


def storable(suffix: str, data: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The arrays as files of a format hold them.

    Truth values become 0 and 1, and numbers of types the format does not have those of the first
    that has all their values. Arrays without columns are left out, which the log says.

    Parameters
    ----------
    suffix : str
        Of the format, in lower case. Formats that hold any array, or none, take all as they are.
    data : mapping of str to (n,) or (n, c) ndarray
        Real numbers or truth values.

    Raises
    ------
    ArrayError
        The format cannot hold an array; says why, and what can be done.
    """
    if suffix not in _TYPES:
        return dict(data)
    arrays: dict[str, NDArray[Any]] = {}
    for name, array in data.items():
        if array.ndim == 2 and not array.shape[1]:
            _log.warning("%s has no columns, %s files do without it", shown(name), suffix)
            continue
        if suffix == ".msh" and ('"' in name or name in _TAKEN_BY_GMSH):
            raise ArrayError(
                f"an array named {shown(name)} cannot be written to .msh, whose names have no "
                f"quotation marks and are other than {' and '.join(_TAKEN_BY_GMSH)}; rename it"
            )
        tag = suffix == ".msh" and name in GMSH_TAGS
        columns = array.shape[1] if array.ndim == 2 else 1
        allowed = (1,) if tag else _COLUMNS.get(suffix, (columns,))
        if columns not in allowed:
            raise ArrayError(
                f"{shown(name)} has {columns} columns, in {suffix} it can have "
                f"{' or '.join(map(str, allowed))}; write its columns as arrays of their own, or "
                "the mesh as .vtu or .npz"
            )
        types = ("i4",) if tag else _TYPES[suffix]
        found = _as_one_of(array, types)
        if found is None:
            raise ArrayError(
                f"{shown(name)} holds numbers of type {array.dtype} that {suffix} has no type for, "
                f"there are {', '.join(np.dtype(kind).name for kind in types)}; convert it with "
                f".astype(numpy.{np.dtype(types[-1]).name}), or write the mesh as .npz"
            )
        arrays[name] = found
    return arrays


def medit_refs(
    data: Mapping[str, NDArray[Any]],
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """What Medit files hold of the data of points, or of cells, and the names of the rest.

    A point and a cell have one whole number each, their reference: it is ``medit:ref``,
    ``gmsh:physical``, ``gmsh:geometrical`` or ``part``, the first that is there, or else the only
    array of integers.

    Parameters
    ----------
    data : mapping of str to (n,) or (n, c) ndarray

    Returns
    -------
    refs : dict
        ``medit:ref``, (n,) of int64, or nothing.
    left_out : list of str
    """
    least, most = np.iinfo(np.int32).min, np.iinfo(np.int32).max  # those of Medit's version 2
    whole = {
        name: array.reshape(-1)
        for name, array in data.items()
        if array.dtype.kind in "iu"
        and array.shape in ((len(array),), (len(array), 1))
        and least <= array.min(initial=0) <= array.max(initial=0) <= most
    }
    chosen = next((name for name in _REGIONS if name in whole), None)
    if chosen is None and len(whole) == 1:
        (chosen,) = whole
    refs = {} if chosen is None else {_MEDIT_REFS: whole[chosen].astype(np.int64)}
    return refs, [name for name in data if name != chosen]


def _as_one_of(array: NDArray[Any], types: tuple[str, ...]) -> NDArray[Any] | None:
    """The array in its own type or the first that holds all its values, None if none does."""
    if array.dtype.str[1:] in types:
        return array
    array = array.astype(np.uint8) if array.dtype.kind == "b" else array
    for kind in types:
        if np.can_cast(array.dtype, kind) and not _rounds(array, kind):
            return array.astype(kind)
    last = types[-1]  # which may hold the values at hand, if not all of their type
    with np.errstate(all="ignore"):
        there = array.astype(last)
        same = np.array_equal(there.astype(array.dtype), array, equal_nan=array.dtype.kind == "f")
    return there if same and not _rounds(array, last) else None


def _rounds(array: NDArray[Any], kind: str) -> bool:
    """Whether integers are too large for floating-point numbers to hold every one."""
    if array.dtype.kind not in "iu" or kind[0] != "f" or not array.size:
        return False
    largest = 2 ** (int(np.finfo(kind).nmant) + 1)
    return bool(array.max() > largest or array.min() < -largest)
