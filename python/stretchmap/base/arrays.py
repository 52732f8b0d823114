"""Conversion of user arrays at the edge: accepted once, checked once, read-only afterwards."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArrayError, IndexRangeError, NonFiniteError

INT32_MAX = np.iinfo(np.int32).max
# Of coordinates: the square of a volume is still a number.
LARGEST = 1e45


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return ``array`` itself, marked as not writable."""
    array.flags.writeable = False
    return array


def freeze(value: Any) -> None:
    """Mark all arrays as not writable that a value is made of: containers and data classes."""
    if isinstance(value, np.ndarray):
        read_only(value)
    elif isinstance(value, Mapping):
        freeze(list(value.values()))
    elif isinstance(value, (tuple, list)):
        for entry in value:
            freeze(entry)
    elif is_dataclass(value):
        freeze(vars(value))


def for_legacy_vtk(array: NDArray[Any]) -> NDArray[Any]:
    """Integers as those of 64 bits: VTK reads none of the shorter ones under the names meshio gives
    them, and no field after them."""
    return array.astype(np.int64) if array.dtype.kind in "biu" else array


def as_points(
    points: ArrayLike, name: str = "V", *, or_none: bool = False, or_lost: bool = False
) -> NDArray[np.float64]:
    """Convert points to a read-only C-ordered copy.

    Parameters
    ----------
    points : (n, 3) array_like of real numbers
    name : str
        What the caller names the array, for messages.
    or_none : bool
        Whether there may be no point at all, as in a list of queries.
    or_lost : bool
        Whether rows may be NaN, all three, which stands for a point outside.

    Returns
    -------
    (n, 3) ndarray of float64

    Raises
    ------
    ArrayError
        Not a real (n, 3) array, no row where there must be one, or coordinates beyond `LARGEST`.
    NonFiniteError
        A NaN or an infinity; ``ids`` are the rows.
    """
    raw = _as_array(points, name)
    if raw.dtype.kind not in "fiu":
        raise ArrayError(f"{name} must hold real numbers, not {_kind(raw)}")
    if or_none and raw.shape in ((0,), (0, 3)):
        return read_only(np.zeros((0, 3)))
    _check_shape(raw, name, 3, "points")
    copy = np.array(_as_doubles(raw, name), dtype=np.float64, order="C")
    if len(copy) > INT32_MAX:
        raise ArrayError(f"{name} has {len(copy)} rows; at most {INT32_MAX} can be indexed")
    known = np.isfinite(copy).all(axis=1)
    if or_lost:
        known |= np.isnan(copy).all(axis=1)
    bad = np.flatnonzero(~known)
    if len(bad):
        raise NonFiniteError(
            f"{name} has NaN or infinite coordinates at {describe('vertex', bad)}; "
            "replace or remove those vertices",
            bad,
        )
    if (np.abs(copy) > LARGEST).any():
        bad = np.flatnonzero((np.abs(copy) > LARGEST).any(axis=1))
        raise ArrayError(
            f"{name} has coordinates beyond {LARGEST:g} at {describe('vertex', bad)}, whose "
            "volumes are no numbers any more; scale the points",
            bad,
        )
    return read_only(copy)


def as_indices(indices: ArrayLike, width: int, n: int, name: str = "F") -> NDArray[np.int32]:
    """Convert element indices to a read-only C-ordered copy.

    Parameters
    ----------
    indices : (m, width) array_like of integers
        Any integer type, byte order and memory order.
    width : int
        Vertices per element: 3 or 4.
    n : int
        Number of vertices; every index has to lie in ``[0, n)``.
    name : str
        What the caller names the array, for messages.

    Returns
    -------
    (m, width) ndarray of int32

    Raises
    ------
    ArrayError
        Not an integer (m, width) array with at least one row, or too many elements.
    IndexRangeError
        An index outside ``[0, n)``; ``ids`` are the rows.
    """
    raw = _as_array(indices, name)
    if raw.dtype.kind not in "iu":
        hint = f"; convert with {name}.astype(int)" if raw.dtype.kind == "f" else ""
        raise ArrayError(f"{name} must hold integers, not {_kind(raw)}{hint}")
    element = {3: "face", 4: "tet"}[width]
    _check_shape(raw, name, width, f"{element}s")
    if len(raw) > INT32_MAX // (2 * width):
        raise ArrayError(f"{name} has {len(raw)} rows, more than 32-bit ids can number")
    bad = np.flatnonzero(((raw < 0) | (raw >= n)).any(axis=1))
    if len(bad):
        low, high = int(raw.min()), int(raw.max())
        hint = "; the indices look 1-based, subtract 1" if low == 1 and high == n else ""
        raise IndexRangeError(
            f"{name} points outside V at {describe(element, bad)}: indices run from {low} to "
            f"{high}, allowed are 0 to {n - 1}{hint}",
            bad,
        )
    return read_only(np.array(raw, dtype=np.int32, order="C"))


def as_reals(
    values: ArrayLike, name: str, *shapes: tuple[int | None, ...], finite: bool = True
) -> NDArray[np.float64]:
    """Convert real numbers to a C-ordered array of doubles.

    Parameters
    ----------
    values : array_like of real numbers
        Anything else is refused: masked entries, complex numbers, truth values, text, objects.
    name : str
        What the caller names the array, for messages.
    *shapes : tuple of int or None
        Shapes that will do: the length of each axis, None where any will. Without them any shape.
    finite : bool
        Refuse NaN and infinities.

    Returns
    -------
    ndarray of float64
        The input itself where it is of that kind already.

    Raises
    ------
    ArrayError
        Another shape or no real numbers.
    NonFiniteError
        A NaN or an infinity; ``ids`` are the rows.
    """
    raw = _as_array(values, name)
    if raw.dtype.kind not in "fiu":
        raise ArrayError(f"{name} must hold real numbers, not {_kind(raw)}")
    if shapes:
        _check_axes(raw, name, *shapes)
    reals = _as_doubles(raw, name)
    if finite and not np.isfinite(reals).all():
        bad = _rows(~np.isfinite(reals))
        raise NonFiniteError(f"{name} has NaN or infinite values in {describe('row', bad)}", bad)
    return reals


def as_rows(values: ArrayLike, name: str, rows: int) -> NDArray[Any]:
    """Convert data to an array of one or two axes with so many rows, its type kept.

    Parameters
    ----------
    values : array_like of real numbers or truth values
        NaN and infinities are data like others; masked entries, complex numbers, text and objects
        are refused.
    name : str
        What the caller names the array, for messages.
    rows : int

    Returns
    -------
    ndarray, shape (rows,) or (rows, c)

    Raises
    ------
    ArrayError
        Another shape, or not of that kind.
    """
    raw = _as_array(values, name)
    if raw.dtype.kind not in "biuf":
        raise ArrayError(f"{name} must be numeric with {rows} rows, it holds {_kind(raw)}")
    _check_axes(raw, name, (rows,), (rows, None))
    return raw


def as_integers(
    values: ArrayLike,
    name: str,
    shape: tuple[int | None, ...],
    low: int = -INT32_MAX,
    high: int = INT32_MAX,
) -> NDArray[np.int64]:
    """Convert integers of a range to an array of 64-bit ones.

    Parameters
    ----------
    values : array_like of integers
        Any integer type; floating-point numbers are refused even if they are whole.
    name : str
        What the caller names the array, for messages.
    shape : tuple of int or None
        Length of each axis; None where any will do.
    low, high : int
        The range, both ends in it.

    Returns
    -------
    ndarray of int64

    Raises
    ------
    ArrayError
        Another shape or no integers.
    IndexRangeError
        A number out of range; ``ids`` are the rows.
    """
    raw = _as_array(values, name)
    if raw.shape == (0,):
        raw = raw.astype(np.int64)  # an empty list is one of floats to NumPy
    if raw.dtype.kind not in "iu":
        raise ArrayError(f"{name} must hold integers, not {_kind(raw)}")
    _check_axes(raw, name, shape)
    outside = (raw < low) | (raw > high)
    if outside.any():
        bad = _rows(outside)
        raise IndexRangeError(
            f"{name} must lie between {low} and {high}, {describe('row', bad)} does not: "
            f"{raw[bad[0]].tolist()}",
            bad,
        )
    return raw.astype(np.int64)


def describe(what: str, ids: ArrayLike, limit: int = 5) -> str:
    """Name a few ids: ``'vertex 7'`` or ``'12 faces (0, 3, 4, 9, 11, ...)'``."""
    rows = np.asarray(ids).tolist()
    rows = [tuple(row) if isinstance(row, list) else row for row in rows]
    if len(rows) == 1:
        return f"{what} {rows[0]}"
    plural = what[:-2] + "ices" if what.endswith("vertex") else what + "s"
    tail = ", ..." if len(rows) > limit else ""
    return f"{len(rows)} {plural} ({', '.join(str(row) for row in rows[:limit])}{tail})"


def _as_array(values: ArrayLike, name: str) -> NDArray[Any]:
    try:
        array, masked = np.asarray(values), _has_masked(values)
    except Exception as error:  # whatever an object's own conversion raises
        raise ArrayError(f"{name} is not a rectangular array of numbers: {error}") from error
    if masked:
        raise ArrayError(f"{name} has masked entries; fill or drop them")
    return array


def _has_masked(values: Any) -> bool:
    """Whether entries are masked; in lists, too, which NumPy takes for NaN or what is beneath."""
    if isinstance(values, (list, tuple)):
        return any(map(_has_masked, values))
    return isinstance(values, np.ma.MaskedArray) and bool(np.ma.is_masked(values))


def _as_doubles(raw: NDArray[Any], name: str) -> NDArray[np.float64]:
    with np.errstate(over="ignore"):
        doubles = np.asarray(raw, np.float64, order="C")
    if raw.dtype.itemsize > 8 and (np.isinf(doubles) & np.isfinite(raw)).any():
        raise NonFiniteError(f"{name} has values beyond double precision; scale them")
    return doubles


def _kind(raw: NDArray[Any]) -> str:
    """What an array holds, in words, where NumPy's name for it says little."""
    words = {"b": "truth values", "O": "Python objects", "U": "text", "S": "bytes", "c": "complex"}
    return words.get(raw.dtype.kind, str(raw.dtype))


def _check_axes(raw: NDArray[Any], name: str, *shapes: tuple[int | None, ...]) -> None:
    for shape in shapes:
        if raw.ndim == len(shape) and all(
            want in (None, have) for want, have in zip(shape, raw.shape, strict=True)
        ):
            return
    expected = " or ".join(str(shape).replace("None", "any") for shape in shapes)
    raise ArrayError(f"{name} must have shape {expected}, not {raw.shape}")


def _rows(where: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Rows (of a number itself: row 0) with a marked entry."""
    return np.flatnonzero(np.atleast_1d(where).reshape(len(np.atleast_1d(where)), -1).any(axis=1))


def _check_shape(raw: NDArray[Any], name: str, width: int, what: str) -> None:
    expected = f"{name} must have shape (number of {what}, {width}), not {raw.shape}"
    if raw.ndim != 2:
        raise ArrayError(expected)
    if raw.shape[1] != width:
        hint = ""
        if raw.shape[0] == width:
            hint = f"; it looks transposed, pass {name}.T"
        elif what == "points" and raw.shape[1] == 2:
            hint = "; add a column of zeros to planar points"
        elif what == "faces" and raw.shape[1] == 4:
            hint = "; tets belong into a TetMesh, quads have to be split into triangles"
        elif what == "tets" and raw.shape[1] == 3:
            hint = "; triangles belong into a TriMesh"
        raise ArrayError(expected + hint)
    if len(raw) == 0:
        raise ArrayError(f"{name} is empty, there is no mesh without {what}")


def given_rows(values: ArrayLike, n: int) -> NDArray[np.float64]:
    """Values as floats, one row for each of ``n`` vertices.

    Raises
    ------
    ArrayError
        Another number of rows, or no numbers.
    """
    array = as_reals(values, "values", finite=False)
    if array.ndim == 0 or len(array) != n:
        raise ArrayError(f"values must have {n} rows, not shape {array.shape}")
    return array


def with_means(
    array: NDArray[np.float64], groups: Iterable[NDArray[np.int32]]
) -> NDArray[np.float64]:
    """Rows and, after them, the means of those that each row of each group names."""
    for ids in groups:
        array = np.concatenate([array, array[ids].mean(axis=1)])
    return array
