"""Shapes brought into one pose: generalized Procrustes analysis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_points, as_reals, read_only
from ..base.options import flag, real
from ..base.rotation import kabsch
from ..errors import ArrayError, DegenerateError, SolverError

__all__ = ["Procrustes", "Similarity", "generalized_procrustes", "similarity_onto"]

_MOST_ITERATIONS, _AT_REST = 200, 1e-12
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


@dataclass(frozen=True, eq=False)
class Procrustes:
    """What `generalized_procrustes` returns.

    Attributes
    ----------
    aligned : ndarray, shape (k, n, 3)
    mean : ndarray, shape (n, 3)
    moves : tuple of Similarity
        From every shape as given to the aligned one.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.population import generalized_procrustes
    >>> square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    >>> found = generalized_procrustes([square, 3.0 * square[:, [1, 2, 0]]])
    >>> bool(np.allclose(found.aligned[0], found.aligned[1]))
    True
    """

    aligned: NDArray[np.float64]
    mean: NDArray[np.float64]
    moves: tuple[Similarity, ...]


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


def generalized_procrustes(
    shapes: ArrayLike, *, scale: bool = True, start: ArrayLike | None = None
) -> Procrustes:
    """Bring shapes into one pose, each onto the mean of all.

    Parameters
    ----------
    shapes : array_like, shape (k, n, 3)
        Points that correspond.
    scale : bool
        Take out size as well as place and direction. The mean then has the mean of the sizes.
    start : array_like, shape (n, 3), optional
        The pose the mean is to have; that of the first shape without.

    Returns
    -------
    Procrustes

    Raises
    ------
    ArrayError, NonFiniteError
        No such array.
    DegenerateError
        A shape of no extent.
    SolverError
        The mean does not come to rest.

    Notes
    -----
    Gower, Psychometrika 40, 1975; Dryden and Mardia, Statistical Shape Analysis, 2nd ed. 2016,
    chapter 7. Reflections are never used.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.population import generalized_procrustes
    >>> rng = np.random.default_rng(0)
    >>> bones = rng.standard_normal((50, 3)) + 0.1 * rng.standard_normal((4, 50, 3))
    >>> found = generalized_procrustes(bones)
    >>> bool(np.allclose(found.aligned.mean(axis=0), found.mean))
    True
    """
    scale = flag("scale", scale)
    given = as_reals(shapes, "shapes", (None, None, 3))
    if not given.size:
        raise ArrayError("shapes: there are none")
    centered = given - given.mean(axis=1, keepdims=True)
    size = float(np.sqrt((centered**2).sum(axis=(1, 2))).mean())
    anchor = given[0] if start is None else as_reals(start, "start", (given.shape[1], 3))
    mean = _sized(anchor, size) if scale else anchor - anchor.mean(axis=0)
    for _ in range(_MOST_ITERATIONS):
        aligned = np.stack([similarity_onto(x, mean, scale)(x) for x in given])
        moved = aligned.mean(axis=0)
        # Every round is free to turn all shapes alike: the mean stays in the pose of the start.
        moved = similarity_onto(moved, anchor, False)(moved)
        moved = _sized(moved, size) if scale else moved - moved.mean(axis=0)
        change = float(np.abs(moved - mean).max())
        mean = moved
        if change <= _AT_REST * size:
            break
    else:
        raise SolverError(
            "the mean of the shapes does not come to rest: they have little in common"
        )
    moves = tuple(similarity_onto(x, mean, scale) for x in given)
    aligned = np.stack([move(x) for move, x in zip(moves, given, strict=True)])
    return Procrustes(read_only(aligned), read_only(mean), moves)


def _sized(points: Array, size: float) -> Array:
    centered = points - points.mean(axis=0)
    extent = float(np.sqrt((centered**2).sum()))
    if not extent > 0.0:
        raise DegenerateError("shapes of no extent cannot be laid on each other")
    return np.asarray(centered * (size / extent))
