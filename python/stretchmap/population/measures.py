"""How good a shape model is: compactness, generalization, specificity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from ..base.options import instance, whole
from ..errors import ArrayError
from .shape_model import ShapeModel, shape_model

__all__ = ["ModelMeasures", "measure_model"]

_MOST_SAMPLES = 1_000_000

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelMeasures:
    """Measures of a shape model as functions of the number of modes used, from none to all.

    Attributes
    ----------
    compactness : ndarray, shape (m + 1,)
        Share of the variance that the first modes explain.
    generalization : ndarray, shape (min(m, k - 2) + 1, k)
        Distance of every shape from what the model of all others makes of it; that has k - 2 modes
        at most.
    specificity : ndarray, shape (m + 1, s)
        Distance of every random shape of the model from the nearest shape it was made from.

    Notes
    -----
    Styner, Rajamani, Nolte, Zsemlye, Szekely, Taylor, Davies: Evaluation of 3D correspondence
    methods for model building, IPMI 2003. Distances are means over the points, in the unit of the
    shapes; small is good.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.population import measure_model, shape_model
    >>> shapes = np.random.default_rng(0).standard_normal((6, 30, 3))
    >>> found = measure_model(shape_model(shapes), n_samples=10)
    >>> float(found.compactness[-1].round(12)), found.generalization.shape
    (1.0, (5, 6))
    """

    compactness: NDArray[np.float64]
    generalization: NDArray[np.float64]
    specificity: NDArray[np.float64]


def measure_model(model: ShapeModel, *, n_samples: int = 200, seed: int = 0) -> ModelMeasures:
    """Compactness, generalization and specificity of a shape model.

    Parameters
    ----------
    model : ShapeModel
    n_samples : int
        Random shapes drawn for the specificity, at most a million.
    seed : int

    Returns
    -------
    ModelMeasures

    Raises
    ------
    ArrayError
        The model was made from fewer than three shapes: none can be left out.
    OptionError
        A number out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.population import measure_model, shape_model
    >>> line = np.linspace(0.0, 1.0, 12).reshape(4, 3)
    >>> found = measure_model(shape_model([line, 2.0 * line, 4.0 * line]))
    >>> bool(found.generalization[1].max() < 1e-12)  # one mode is all there is
    True
    """
    model = instance("model", model, ShapeModel, "shape_model(shapes)")
    n_samples, seed = whole("n_samples", n_samples, 1, _MOST_SAMPLES), whole("seed", seed, 0)
    shapes = model.reconstruct(model.scores)
    if len(shapes) < 3:
        raise ArrayError(f"leaving one out needs three shapes or more, got {len(shapes)}")
    total = float(model.variances.sum())
    shares = model.variances / total if total > 0.0 else np.zeros(model.n_modes)
    return ModelMeasures(
        compactness=read_only(np.concatenate([[0.0], np.cumsum(shares)])),
        generalization=read_only(_left_out(shapes, min(model.n_modes, len(shapes) - 2) + 1)),
        specificity=read_only(_specificity(model, shapes, n_samples, seed)),
    )


def _left_out(shapes: Array, rows: int) -> Array:
    """(rows, k) Distance of each shape from the model of the others, with 0, 1, ... modes."""
    distances = np.empty((rows, len(shapes)))
    for i, shape in enumerate(shapes):
        model = shape_model(np.delete(shapes, i, axis=0))
        scores, left = model.project(shape), shape - model.mean
        for m in range(rows):
            if 0 < m <= model.n_modes:
                left = left - scores[m - 1] * model.modes[m - 1]
            distances[m, i] = _distance(left)
    return distances


def _specificity(model: ShapeModel, shapes: Array, n_samples: int, seed: int) -> Array:
    """(m + 1, s) Distance of random shapes from the nearest given one."""
    drawn = np.random.default_rng(seed).standard_normal((n_samples, model.n_modes))
    drawn = drawn * np.sqrt(model.variances)
    found = np.empty((model.n_modes + 1, n_samples))
    for m in range(model.n_modes + 1):
        for j, scores in enumerate(drawn):
            sample = model.reconstruct(scores[:m])
            found[m, j] = _distance(shapes - sample).min()
    return found


def _distance(displacements: Array) -> Array:
    """Mean length of displacements (..., n, 3) over the points."""
    return np.asarray(np.linalg.norm(displacements, axis=-1).mean(axis=-1))
