"""Cutting tets into parts whose volumes are prescribed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .detours import detours_of
from .heights import Detours, Ladder
from .pieces import Pieces
from .slabs import Slabs

# A level passes through a vertex that is nearer to it than this share of an edge it cuts; smaller
# shares follow where a part would not have its volume.
_SNAP = np.array([0.03, 0.01, 1e-3, 1e-5, 1e-7, 0.0])
_TRIES = 3  # of each with detours


def cut_exactly(
    pieces: Pieces,
    ladder: Ladder,
    chosen: NDArray[np.bool_],
    asked: NDArray[np.float64] | None,
) -> tuple[Pieces, NDArray[np.intp], NDArray[np.intp]]:
    """The chosen tets cut along levels into parts of the volumes asked for.

    Parameters
    ----------
    asked : ndarray or None
        Volume of each part. None: the levels as they are, through no vertex that they do not meet.

    Returns
    -------
    pieces : Pieces
    origin : ndarray, shape (k,)
        The tet each was cut from.
    labels : ndarray, shape (k,)
        The part each belongs to, -1 where it was not chosen.
    """
    count, points = len(ladder.levels), len(pieces.points)
    detours = Detours.none(points)
    if asked is None:
        slabs = Slabs(pieces, ladder, chosen, np.full(count, 1e-9), detours)
        return slabs.pieces(np.zeros(count)), slabs.origin, slabs.labels
    step, tries = np.zeros(count, int), np.zeros(count, int)
    while True:
        slabs = Slabs(pieces, ladder, chosen, _SNAP[step], detours)
        tilts, missing, crowded = slabs.tilts(asked)
        failed = (missing != 0.0) | crowded
        if not failed.any() or (step[failed] == len(_SNAP) - 1).all():
            return slabs.pieces(tilts), slabs.origin, slabs.labels
        for level in np.flatnonzero(failed):
            found = None
            if not crowded[level] and tries[level] < _TRIES:
                found = detours_of(slabs, int(level), ladder.period, float(missing[level]))
            if found is None:
                step[level], tries[level] = min(step[level] + 1, len(_SNAP) - 1), 0
                detours.level[detours.level == level] = -1
            else:
                tries[level] += 1
                detours.level[found[0]], detours.values[found[0]] = level, found[1]
        if len(asked) == count:  # volumes are counted from the first level
            step[0] = step[failed].max()
