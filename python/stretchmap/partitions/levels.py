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
from .cutting import cut_exactly
from .heights import Heights, Ladder
from .pieces import Pieces

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


def levels_of(
    pieces: Pieces, axis: str, shares: NDArray[np.float64], start: float, of: str
) -> NDArray[np.float64]:
    """Levels that divide source or image as asked: p - 1 for s, p angles from 0 on for u and v."""
    pieces = pieces.compact()  # within a part of a grid few points are left
    if axis == "s":
        below = _shell_volume(pieces, of)
        values = pieces.points[:, 7]
        ends = (float(values.min()), float(values.max()))
    else:
        below = _sector_volume(pieces, axis, start, of)
        ends = (0.0, TWO_PI)
    total = float(pieces.volumes(of).sum())
    found = [_root(below, share * total, ends) for share in np.cumsum(shares)[:-1]]
    return np.array(found if axis == "s" else [0.0, *found])


def _shell_volume(pieces: Pieces, of: str) -> Callable[[float], float]:
    """Volume within the shell of a value of ``(s / r)^2``."""
    volumes, values = pieces.volumes(of), pieces.points[:, 7]
    return lambda level: _core.partitions.volume_below(pieces.T, volumes, values - level)


def _sector_volume(pieces: Pieces, axis: str, start: float, of: str) -> Callable[[float], float]:
    """Volume from the angle ``start`` up to another, counted from there."""
    ladder = Ladder(Heights.of(pieces.points, axis, start), np.zeros(1))
    halves = cut_exactly(pieces, ladder, np.ones(len(pieces.T), bool), None)[0]
    heights, volumes = Heights.of(halves.points, axis, start), halves.volumes(of)
    # The first sheet is at 0 for tets behind it, at a whole turn for those before.
    corners = heights.corners(halves.T)
    corners -= TWO_PI * np.floor(np.nanmean(corners, axis=1, keepdims=True) / TWO_PI)
    low, high = np.nanmin(corners, axis=1), np.nanmax(corners, axis=1)

    def below(angle: float) -> float:
        cut = (low < angle) & (angle < high)
        T = np.ascontiguousarray(halves.T[cut])
        values = np.ascontiguousarray(
            heights.above(np.arange(len(heights.values), dtype=np.int32), angle)
        )
        part = _core.partitions.volume_below(T, volumes[cut], values)
        return float(volumes[high <= angle].sum()) + part

    return below


def _root(below: Callable[[float], float], target: float, ends: tuple[float, float]) -> float:
    def excess(level: float) -> float:
        return below(level) - target

    if not excess(ends[0]) <= 0.0 <= excess(ends[1]):
        raise SolverError("no level divides the image as asked; is the map certified?")
    return float(brentq(excess, *ends, xtol=1e-15, rtol=4 * np.finfo(float).eps))


# Levels, and the volumes of the parts between them as `cut_exactly` takes them.
Levels = tuple[NDArray[np.float64], NDArray[np.float64] | None]


def cut_nested(
    pieces: Pieces,
    axes: tuple[str, ...],
    counts: list[int],
    start: float,
    rule: Callable[[int, tuple[int, ...], Pieces], Levels],
) -> tuple[Pieces, NDArray[np.int32], tuple[NDArray[np.float64], ...]]:
    """Cut along each coordinate within each part of those before it.

    Parameters
    ----------
    rule : callable
        ``rule(i, cell, inside)`` returns the levels of the i-th coordinate in a cell of those
        before it, and the volumes of the parts there.

    Returns
    -------
    Pieces
    labels : ndarray of int32, shape (k,)
    levels : tuple of ndarray
        For the i-th coordinate shape (p_1, ..., p_{i-1}, cuts).
    """
    labels = np.zeros(len(pieces.T), np.intp)
    levels: list[NDArray[np.float64]] = []
    for i, (axis, count) in enumerate(zip(axes, counts, strict=True)):
        before = counts[:i]
        cuts = []
        labels = labels * count
        for place, cell in enumerate(np.ndindex(*before)):
            chosen = labels == place * count
            here, asked = rule(i, cell, pieces.only(chosen))
            ladder = Ladder(Heights.of(pieces.points, axis, start), here)
            pieces, origin, parts = cut_exactly(pieces, ladder, chosen, asked)
            labels = labels[origin] + np.maximum(parts, 0)
            cuts.append(here + (0.0 if axis == "s" else start))
        levels.append(np.array(cuts).reshape(*before, -1))
    return pieces, labels.astype(np.int32), tuple(levels)
