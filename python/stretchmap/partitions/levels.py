"""Levels at which a solid is cut."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from .. import _core
from ..base.arrays import as_reals
from ..base.options import one_of, whole
from ..base.torus import TWO_PI
from ..errors import MeshError, OptionError, SolverError
from .cutting import Pieces, middle_first

Coordinate = Literal["s", "u", "v"]


def shares_of(fractions: int | Sequence[float], most: int) -> NDArray[np.float64]:
    """Shares of the volume, summing to 1, from a number of equal ones or from the shares.

    Raises
    ------
    OptionError
        They are none, or more than ``most``.
    """
    if isinstance(fractions, (int, np.integer)):
        count = whole("the number of parts", fractions, 2, most)
        return np.full(count, 1.0 / count)
    try:
        shares = as_reals(fractions, "fractions", (None,))
    except MeshError as error:
        raise OptionError(
            f"fractions must be a number of parts or one share for each of them: {error}"
        ) from None
    whole("the number of parts", len(shares), 2, most)
    if not ((shares > 0.0).all() and abs(shares.sum() - 1.0) < 1e-9):
        raise OptionError(f"fractions must be positive and sum to 1, got {shares[:5].tolist()}")
    return np.asarray(shares / shares.sum())


def asked_shares(
    fractions: int | Sequence[float] | Sequence[int | Sequence[float]],
    by: Coordinate | Sequence[Coordinate],
    most: int,
) -> tuple[tuple[Coordinate, ...], list[NDArray[np.float64]]]:
    """Coordinates and the shares along each, with ``most`` cells at most.

    Raises
    ------
    OptionError
        They do not go together, are out of range, or ask for more cells.
    """
    single = isinstance(by, str)
    if not (single or isinstance(by, (tuple, list))):
        raise OptionError("by must be 's', 'u' or 'v', or a tuple of them")
    axes = tuple(one_of("by", axis, get_args(Coordinate)) for axis in ((by,) if single else by))
    if not axes or len(set(axes)) != len(axes):
        raise OptionError(f"by must name each of 's', 'u', 'v' at most once, got {by!r}")
    wanted: Any = (fractions,) if single or isinstance(fractions, (int, np.integer)) else fractions
    if not isinstance(wanted, (tuple, list)) or len(wanted) != len(axes):
        raise OptionError(f"{len(axes)} coordinates need a tuple of as many fractions")
    shares = [shares_of(entry, most) for entry in wanted]
    whole("the number of cells", math.prod(map(len, shares)), 2, most)
    return axes, shares


def _shell_volume(pieces: Pieces, of: str) -> Callable[[float], float]:
    """Volume within the shell of a value of ``(s / r)^2``."""
    volumes, values = pieces.volumes(of), pieces.points[:, 7]
    return lambda level: _core.partitions.volume_below(pieces.T, volumes, values - level)


def levels_of(
    pieces: Pieces, axis: str, shares: NDArray[np.float64], start: float, of: str
) -> NDArray[np.float64]:
    """Levels that divide source or image as asked: p - 1 for s, p angles for u and v."""
    if axis == "s":
        below = _shell_volume(pieces, of)
        values = pieces.points[:, 7]
        ends = (float(values.min()), float(values.max()))
    else:
        below = _sector_volume(pieces, axis, start, of)
        ends = (start, start + TWO_PI)
    total = float(pieces.volumes(of).sum())
    found = [_root(below, share * total, ends) for share in np.cumsum(shares)[:-1]]
    return np.array(found if axis == "s" else [start, *found])


def _sector_volume(pieces: Pieces, axis: str, start: float, of: str) -> Callable[[float], float]:
    """Volume from the angle ``start`` up to another."""
    halves = pieces.cut(axis, start, gated=False)
    volumes = halves.volumes(of)
    ahead = halves.side > 0
    parts = [(np.ascontiguousarray(halves.T[m]), volumes[m]) for m in (ahead, ~ahead)]
    first = float(parts[0][1].sum())

    def below(angle: float) -> float:
        values = np.ascontiguousarray(halves.level_function(axis, angle)[0])
        if angle - start <= math.pi:
            return _core.partitions.volume_below(*parts[0], values)
        return first + _core.partitions.volume_below(*parts[1], values)

    return below


def _root(below: Callable[[float], float], target: float, ends: tuple[float, float]) -> float:
    def excess(level: float) -> float:
        return below(level) - target

    if not excess(ends[0]) <= 0.0 <= excess(ends[1]):
        raise SolverError("no level divides the image as asked; is the map certified?")
    return float(brentq(excess, *ends, xtol=1e-15, rtol=4 * np.finfo(float).eps))


def cut_nested(
    pieces: Pieces, axes: tuple[str, ...], shares: list[NDArray[np.float64]], start: float
) -> tuple[Pieces, NDArray[np.int32], tuple[NDArray[np.float64], ...]]:
    """Cut along each coordinate at levels of their own within each part of those before it.

    Returns
    -------
    Pieces
    labels : ndarray of int32, shape (k,)
    levels : tuple of ndarray
        For the i-th coordinate shape (p_1, ..., p_{i-1}, cuts).
    """
    labels = np.zeros(len(pieces.T), np.intp)
    levels: list[NDArray[np.float64]] = []
    for i, (axis, share) in enumerate(zip(axes, shares, strict=True)):
        before = [len(entry) for entry in shares[:i]]
        cuts = []
        for cell in range(math.prod(before)):
            cuts.append(levels_of(pieces.only(labels == cell), axis, share, start, "source"))
            for level in middle_first(cuts[-1]):
                pieces, origin = pieces.cut_within(labels == cell, axis, level)
                labels = labels[origin]
        parts = np.zeros(len(labels), np.intp)
        for cell, levels_here in enumerate(cuts):
            inside = labels == cell
            parts[inside] = pieces.only(inside).parts_along(axis, levels_here)
        labels = labels * len(share) + parts
        levels.append(np.array(cuts).reshape(*before, -1))
    return pieces, labels.astype(np.int32), tuple(levels)
