"""Surfaces that cross themselves bound nothing that could be mapped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import describe
from ..errors import DegenerateError, SelfIntersectionError
from .surfaces import MOST_PAIRS, TriMesh

__all__ = ["UNLESS_KEPT", "require_no_crossing", "too_small"]

# The remedy where a map of it could be made, but not be proven one to one.
UNLESS_KEPT = "repair it there, or see with keep_best=True how far a map gets all the same"


_SMALLEST = 1e-75  # of a surface whose last digits, 1e-16 of it, the exact tests still reach


def too_small(V: NDArray[np.float64]) -> bool:
    """Whether points (n, 3) lie so close together that exact tests of their faces may fail."""
    return float(np.ptp(V, axis=0).max()) < _SMALLEST


def require_no_crossing(surface: TriMesh, what: str, remedy: str) -> None:
    """Raise where faces meet beyond the vertices they share, by exact tests.

    Parameters
    ----------
    surface : TriMesh
    what : str
        What it is, for the message.
    remedy : str

    Raises
    ------
    DegenerateError
        All points lie so close together that nothing can be told.
    SelfIntersectionError
        ``ids`` are pairs of faces one after the other, a thousand at most.
    """
    pairs = surface.crossing_faces
    if len(pairs):
        if too_small(surface.V):
            across = float(np.ptp(surface.V, axis=0).max())
            raise DegenerateError(
                f"{what} is {across:.3g} across, too small for any test; scale the points"
            )
        more = "at least " if len(pairs) == MOST_PAIRS else ""
        faces = describe("face", np.unique(pairs))
        raise SelfIntersectionError(
            f"{what} touches or crosses itself at {more}{faces}; {remedy}", pairs.ravel().tolist()
        )
