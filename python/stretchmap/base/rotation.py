"""The rotation that brings points nearest to others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["kabsch"]


def kabsch(products: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations of least squares, without reflection (Kabsch 1976).

    Parameters
    ----------
    products : (..., 3, 3) ndarray
        ``p.T @ q`` of points p, q (n, 3), both about their means.

    Returns
    -------
    rotations : (..., 3, 3) ndarray
        ``p @ rotation`` is nearest to q.
    shares : (..., 3) ndarray
        Their sum is that of ``(p @ rotation) * q``; the last one is negative where a reflection
        would be nearer.
    """
    U, S, W = np.linalg.svd(products)
    turn = np.sign(np.linalg.det(U @ W))
    S[..., 2] *= turn
    U[..., 2] *= turn[..., None]
    return U @ W, S
