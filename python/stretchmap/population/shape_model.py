"""The linear model of a population: a mean, and the modes by which shapes differ from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_reals, read_only
from ..base.options import memory, whole
from ..errors import ArrayError, OptionError

__all__ = ["ShapeModel", "shape_model"]

_NOISE = 1e-12  # of the largest singular value: no variance at all


@dataclass(frozen=True, eq=False)
class ShapeModel:
    """Mean and principal components of shapes that correspond and lie in one pose.

    Attributes
    ----------
    mean : ndarray, shape (n, 3)
    modes : ndarray, shape (m, n, 3)
        Orthonormal, by falling variance; the component largest in size is positive.
    variances : ndarray, shape (m,)
        Of the scores, with k - 1 in the denominator.
    scores : ndarray, shape (k, m)
        Of the shapes the model was made from, in the unit of the shapes.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.population import shape_model
    >>> shapes = np.random.default_rng(0).standard_normal((5, 20, 3))
    >>> model = shape_model(shapes)
    >>> bool(np.allclose(model.reconstruct(model.scores[2]), shapes[2]))
    True
    """

    mean: NDArray[np.float64]
    modes: NDArray[np.float64]
    variances: NDArray[np.float64]
    scores: NDArray[np.float64]

    @property
    def n_modes(self) -> int:
        """Number of modes, m."""
        return len(self.variances)

    def reconstruct(self, scores: ArrayLike) -> NDArray[np.float64]:
        """The shape of some scores.

        Parameters
        ----------
        scores : array_like, shape (j,) or (c, j), j <= m
            In the unit of the shapes; modes without a score have zero. Two standard deviations of
            the first mode are ``[2 * variances[0] ** 0.5]``.

        Returns
        -------
        ndarray, shape (n, 3) or (c, n, 3)

        Raises
        ------
        ArrayError, NonFiniteError
            No such array, or more scores than modes.
        """
        given = as_reals(scores, "scores", (None,), (None, None))
        if given.shape[-1] > self.n_modes:
            raise ArrayError(f"{given.shape[-1]} scores were given, the model has {self.n_modes}")
        return np.asarray(self.mean + np.tensordot(given, self.modes[: given.shape[-1]], axes=1))

    def project(self, shape: ArrayLike) -> NDArray[np.float64]:
        """Scores (m,) of the shape of the model that is nearest to a shape (n, 3) in its pose.

        Raises
        ------
        ArrayError, NonFiniteError
            No such array.
        """
        points = as_reals(shape, "shape", self.mean.shape)
        return np.asarray(np.tensordot(self.modes, points - self.mean, axes=2))

    def sample(
        self, n: int = 1, seed: int = 0, *, n_modes: int | None = None
    ) -> NDArray[np.float64]:
        """Shapes drawn from the normal distribution of the model.

        Parameters
        ----------
        n : int
            Number of shapes.
        seed : int
        n_modes : int, optional
            Use the first modes only.

        Returns
        -------
        ndarray, shape (n, n_points, 3)

        Raises
        ------
        OptionError
            A number out of range.
        """
        n, seed = whole("n", n, 1), whole("seed", seed, 0)
        count = self._count(n_modes)
        memory(f"{n} shapes", 16.0 * n * self.mean.size)
        drawn = np.random.default_rng(seed).standard_normal((n, count))
        return self.reconstruct(drawn * np.sqrt(self.variances[:count]))

    def _count(self, n_modes: int | None) -> int:
        if n_modes is None:
            return self.n_modes
        count = whole("n_modes", n_modes, 0)
        if count > self.n_modes:
            raise OptionError(f"n_modes must be at most {self.n_modes}, got {count}")
        return count


def shape_model(shapes: ArrayLike, mean: ArrayLike | None = None) -> ShapeModel:
    """Principal components of shapes.

    Parameters
    ----------
    shapes : array_like, shape (k, n, 3)
        Points that correspond, in one pose: `generalized_procrustes`.
    mean : array_like, shape (n, 3), optional
        What deviations are taken from, the average by default.

    Returns
    -------
    ShapeModel
        With at most k - 1 modes, those of no variance left out.

    Raises
    ------
    ArrayError, NonFiniteError
        No such arrays, or fewer than two shapes.

    Notes
    -----
    Cootes, Taylor, Cooper, Graham: Active shape models, CVIU 61(1), 1995; computed by the singular
    value decomposition of LAPACK.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.population import shape_model
    >>> line = np.linspace(0.0, 1.0, 12).reshape(4, 3)
    >>> model = shape_model([line, 2.0 * line, 3.0 * line])
    >>> model.n_modes
    1
    """
    given = as_reals(shapes, "shapes", (None, None, 3))
    k, n, _ = given.shape
    if k < 2:
        raise ArrayError(f"a shape model needs two shapes or more, got {k}")
    middle = given.mean(axis=0) if mean is None else as_reals(mean, "mean", (n, 3))
    flat = (given - middle).reshape(k, -1)
    _, singular, rows = scipy.linalg.svd(flat, full_matrices=False)
    keep = singular[: k - 1] > _NOISE * max(singular[0], np.finfo(float).tiny)
    modes = rows[: k - 1][keep]
    largest = np.abs(modes).argmax(axis=1)
    modes = modes * np.sign(modes[np.arange(len(modes)), largest])[:, None]
    return ShapeModel(
        mean=read_only(np.array(middle)),
        modes=read_only(modes.reshape(-1, n, 3)),
        variances=read_only(singular[: k - 1][keep] ** 2 / (k - 1)),
        scores=read_only(flat @ modes.T),
    )
