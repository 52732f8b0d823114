"""Shapes that are unlike the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["modified_z_scores"]

_MAD_OF_NORMAL = 0.6745  # median absolute deviation of a normal variable of variance one
_MEAN_OF_NORMAL = 1.253314  # the same by the mean absolute deviation, where the median is zero


def modified_z_scores(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k,) Distances from the median in robust standard deviations.

    Iglewicz and Hoaglin, How to detect and handle outliers, 1993, who call values above 3.5
    outliers. Unlike mean and standard deviation, median and median deviation are not moved by the
    outliers themselves.

    Examples
    --------
    >>> import numpy as np
    >>> modified_z_scores(np.array([1.0, 1.1, 0.9, 1.0, 5.0])).round(1).tolist()
    [0.0, 0.7, -0.7, 0.0, 27.0]
    """
    gaps = values - np.median(values)
    spread = float(np.median(np.abs(gaps))) / _MAD_OF_NORMAL
    if spread == 0.0:
        spread = float(np.abs(gaps).mean()) * _MEAN_OF_NORMAL
    return np.asarray(gaps / spread if spread > 0.0 else np.zeros_like(gaps))
