"""Where a level passes by vertices that it could go through."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .heights import Ids, Reals
from .slabs import Slabs

# Share of an edge by which it does.
_WIDTH = 0.1
# A tilt makes up for about half or twice the volume that detours add up to.
_TOO_FEW, _TOO_MANY = 0.7, 1.2


def detours_of(slabs: Slabs, level: int, period: int, missing: float) -> tuple[Ids, Reals] | None:
    """Vertices for a level to pass by where it goes through nearly all near it.

    No tilt moves it then. Passed by on one side, they make up for the missing volume; where one
    alone is too much, two are passed by on either side.

    Returns
    -------
    vertices, values : ndarray
        As in `Detours`. None if there are not enough.
    """
    on = (slabs.corners - (2 * level + 1)) % (2 * period) == 0
    on &= slabs.corners != _core.partitions.EVERYWHERE
    tets, corner = np.nonzero(on)
    if not len(tets):
        return None
    ids, which = np.unique(slabs.own.T[tets, corner], return_inverse=True)
    values = slabs.signed(tets, level, slabs.corners[tets, corner])
    side = -1.0 if missing > 0.0 else 1.0
    gain, there = _gains(slabs, tets, corner, values, which, side)
    near = _neighbors(len(ids), which, tets)
    taken: list[int] = []
    blocked: set[int] = set()
    total = 0.0
    order = [int(i) for i in np.argsort(-gain) if gain[i] > 0.0]
    for i in order:
        if i not in blocked and total + gain[i] <= _TOO_MANY * abs(missing):
            taken.append(i)
            blocked |= near[i]
            total += gain[i]
    if taken:
        return (ids[taken], there[taken]) if total > _TOO_FEW * abs(missing) else None
    loss, back = _gains(slabs, tets, corner, values, which, -side)
    for i in reversed(order):
        for j in np.argsort(np.abs(loss - gain[i])):
            if loss[j] > 0.0 and int(j) not in near[i]:
                return ids[[i, j]], np.array([there[i], back[j]])
    return None


def _gains(
    slabs: Slabs,
    tets: NDArray[np.intp],
    corner: NDArray[np.intp],
    values: Reals,
    which: NDArray[np.intp],
    side: float,
) -> tuple[Reals, Reals]:
    """Volume by which each vertex adds to its side when passed by, and the value it gets."""
    across = np.where(side * values < 0.0, np.abs(values), np.inf).min(axis=1)
    nearest = np.full(which.max() + 1, np.inf)
    np.minimum.at(nearest, which, across)
    there = np.where(np.isfinite(nearest), side * _WIDTH * nearest, 0.0)
    moved = values.copy()
    moved[np.arange(len(tets)), corner] = there[which]
    shares = [_core.partitions.shares_below(np.ascontiguousarray(v)) for v in (values, moved)]
    change = np.abs(shares[1] - shares[0]) * slabs.volumes[tets]
    return np.where(there != 0.0, np.bincount(which, change), 0.0), there


def _neighbors(count: int, which: NDArray[np.intp], tets: NDArray[np.intp]) -> list[set[int]]:
    """Of each vertex, itself and those that share a tet with it."""
    near: list[set[int]] = [{i} for i in range(count)]
    for group in np.split(which, np.flatnonzero(np.diff(tets)) + 1):
        for i in group:
            near[i].update(int(j) for j in group)
    return near
