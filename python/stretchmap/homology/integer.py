"""Exact integer linear algebra for matrices of some hundred rows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["complement", "integer_inverse", "integer_kernel", "reduced_basis"]


def integer_kernel(matrix: ArrayLike) -> NDArray[np.int64]:
    """Basis of the integer vectors that a matrix sends to zero.

    Parameters
    ----------
    matrix : (k, n) array_like of integers

    Returns
    -------
    (d, n) ndarray of int64
        Rows generate ``{x in Z^n : matrix x = 0}``; the lattice they span has no gaps.
    """
    matrix = np.asarray(matrix)
    k, n = matrix.shape
    # Columns of [matrix; identity], reduced by unimodular column operations.
    free = np.hstack([matrix.T, np.eye(n, dtype=np.int64)]).astype(np.int64)
    for row in range(k):
        while True:
            (active,) = np.nonzero(free[:, row])
            if len(active) < 2:
                break
            pivot = active[np.argmin(np.abs(free[active, row]))]
            active = active[active != pivot]
            factors = free[active, row] // free[pivot, row]
            free = _roomy(free, factors, free[pivot])
            free[active] -= np.outer(factors, free[pivot])
        free = free[free[:, row] == 0]
    return free[:, k:].astype(np.int64)


def _roomy(array: NDArray[Any], factors: NDArray[Any], row: NDArray[Any]) -> NDArray[Any]:
    """The array, of Python integers where products of it might not fit into int64."""
    if array.dtype == object:
        return array
    most = float(np.abs(factors).max()) * float(np.abs(row).max()) + float(np.abs(array).max())
    return array if most < 2.0**62 else array.astype(object)


def complement(vector: ArrayLike) -> NDArray[np.int64]:
    """For a primitive ``(p, q)`` a pair ``(s, t)`` with ``s q - p t = 1``.

    Raises
    ------
    ValueError
        If p and q have a common divisor.
    """
    p, q = (int(x) for x in np.asarray(vector))
    # Extended Euclid on (|q|, |p|): s |q| + t |p| = 1.
    r0, r1, s0, s1, t0, t1 = abs(q), abs(p), 1, 0, 0, 1
    while r1:
        factor = r0 // r1
        r0, r1 = r1, r0 - factor * r1
        s0, s1 = s1, s0 - factor * s1
        t0, t1 = t1, t0 - factor * t1
    if r0 != 1:
        raise ValueError(f"({p}, {q}) is not primitive")
    return np.array([s0 if q >= 0 else -s0, -t0 if p >= 0 else t0], dtype=np.int64)


def integer_inverse(matrix: ArrayLike) -> NDArray[np.int64]:
    """Inverse of a small integer matrix of determinant plus or minus one.

    Raises
    ------
    ValueError
        If it has none.
    """
    matrix = np.asarray(matrix, dtype=np.int64)
    if abs(abs(np.linalg.det(matrix)) - 1.0) > 1e-6:
        raise ValueError("the matrix has no integer inverse")
    return np.rint(np.linalg.inv(matrix)).astype(np.int64)


def reduced_basis(rows: ArrayLike, metric: ArrayLike) -> NDArray[np.int64]:
    """Shorten the vectors of a lattice basis in a positive definite metric, shortest first.

    Multiples of one row are taken from another as long as that makes it shorter.

    Parameters
    ----------
    rows : (d, n) array_like of integers
    metric : (n, n) array_like

    Returns
    -------
    (d, n) ndarray of int64
        A basis of the same lattice.
    """
    basis = np.array(rows, dtype=np.int64)
    metric = np.asarray(metric, dtype=float)
    shorter = True
    while shorter:
        shorter = False
        gram = basis @ metric @ basis.T
        for i in range(len(basis)):
            for j in range(len(basis)):
                share = gram[i, j] / gram[j, j]
                if i != j and abs(share) > 0.5 + 1e-9:
                    times = round(share)
                    basis[i] -= times * basis[j]
                    gram[i] -= times * gram[j]
                    gram[:, i] -= times * gram[:, j]
                    shorter = True
    lengths = np.einsum("ij,jk,ik->i", basis, metric, basis)
    return basis[np.argsort(lengths, kind="stable")]
