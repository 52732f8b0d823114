"""What is too small for the exact tests: their verdict is safe, the reason has to be true, too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core

__all__ = ["not_positive"]

_LEAST = 2.0**-300  # of a difference of coordinates and its rounding error, see `orient3d`


def not_positive(
    V: NDArray[np.float64], T: NDArray[np.int32], bad: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Of tets that are not proven to have positive volume those that are proven not to have it.

    Parameters
    ----------
    V : ndarray, shape (n, 3)
    T : ndarray of int32, shape (m, 4)
    bad : ndarray of int32, shape (k,)
        Ids of the former.

    Returns
    -------
    ndarray of int32
        Ids of the latter; the others are too small for the tests.
    """
    tets = T[bad]
    first, others = V[tets[:, :1]], V[tets[:, 1:]]
    high = others - first
    part = others - high
    low = (others - (high + part)) + (part - first)  # what rounding took off the difference
    sizes = np.abs(np.concatenate([high, low], axis=1)).reshape(len(tets), -1)
    told = ((sizes == 0.0) | (sizes >= _LEAST)).all(axis=1)
    turned = np.ascontiguousarray(tets[:, [1, 0, 2, 3]])
    inverted = np.ones(len(tets), bool)
    inverted[_core.certificate.not_positive_tets(V, turned)] = False
    return np.asarray(bad[told | inverted])
