"""Rotation, factor and shift, and those that lay points on others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_points, as_reals
from ..base.options import real
from ..base.rotation import kabsch
from ..errors import ArrayError, DegenerateError

__all__ = ["Similarity", "similarity_onto"]

_NO_ROTATION = 1e-8

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Similarity:
    """``points -> factor * points @ rotation + shift``.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        A rotation, never a reflection.
    factor : float
    shift : ndarray, shape (3,)

    Raises
    ------
    ArrayError, NonFiniteError, OptionError
        An array of another shape, no rotation, or a factor that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.population import Similarity
    >>> move = Similarity(np.eye(3), 2.0, np.array([1.0, 0.0, 0.0]))
    >>> move.back(move([[0.0, 1.0, 0.0]])).tolist()
    [[0.0, 1.0, 0.0]]
    """

    rotation: Array
    factor: float
    shift: Array

    def __post_init__(self) -> None:
        rotation = as_reals(self.rotation, "rotation", (3, 3))
        off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if off > _NO_ROTATION or not np.linalg.det(rotation) > 0.0:
            raise ArrayError("rotation must be orthogonal with determinant 1")
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "factor", real("factor", self.factor, above=0.0))
        object.__setattr__(self, "shift", as_reals(self.shift, "shift", (3,)))

    def __call__(self, points: ArrayLike) -> Array:
        """Points (n, 3) moved.

        Raises
        ------
        ArrayError, NonFiniteError
            No such array.
        """
        return np.asarray(
            self.factor * as_points(points, "points", or_none=True) @ self.rotation + self.shift
        )

    def back(self, points: ArrayLike) -> Array:
        """Points (n, 3) moved back; as a call."""
        away = as_points(points, "points", or_none=True) - self.shift
        return np.asarray(away @ self.rotation.T / self.factor)


def similarity_onto(points: Array, goal: Array, scale: bool = True) -> Similarity:
    """The rotation, shift and factor that bring points (n, 3) onto a mean shape (n, 3).

    The rotation is that of least squares (Kabsch 1976; no reflection). The factor makes the
    component along the mean shape equal to the mean shape itself, so that what varies lies in the
    tangent space and linear variation stays linear (Cootes, Taylor, Cooper, Graham 1995); the
    factor of least squares would bend it.

    Raises
    ------
    DegenerateError
        All points coincide, or are nowhere near the shape of the goal.
    """
    middle, aim = points.mean(axis=0), goal.mean(axis=0)
    p, q = points - middle, goal - aim
    rotation, shares = kabsch(np.einsum("ni,nj->ij", p, q))  # no threads, same bits anywhere
    if not shares.sum() > 0.0:
        raise DegenerateError("shapes of no extent cannot be laid on each other")
    factor = float(np.einsum("ni,ni->", q, q) / shares.sum()) if scale else 1.0
    if not factor > 0.0:
        raise DegenerateError("shapes cannot be laid on a single point")
    return Similarity(rotation, factor, aim - factor * middle @ rotation)
