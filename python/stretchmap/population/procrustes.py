"""Shapes brought into one pose: generalized Procrustes analysis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_reals, read_only
from ..base.options import flag
from ..deformation.similarity import Similarity, similarity_onto
from ..errors import ArrayError, DegenerateError, SolverError

__all__ = ["Procrustes", "generalized_procrustes"]

_MOST_ITERATIONS, _AT_REST = 200, 1e-12

Array = NDArray[np.float64]


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
