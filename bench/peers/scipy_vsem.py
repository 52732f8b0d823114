"""The fixed-point iteration (5.5) in NumPy and SciPy, written for speed but kept readable.

The pattern is built once; a step is one vectorised assembly (``bincount`` into the CSR values) and
one factorisation with three right-hand sides: by SciPy's sparse LU, or by CHOLMOD.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg
from cholmod import Cholmod
from numpy.typing import NDArray

Array = NDArray[np.float64]
Solve = Callable[[sp.csc_matrix, Array], Array]
_PAIRS = [(a, b) for a in range(4) for b in range(a + 1, 4)]


def face_vectors(x: Array, T: NDArray[np.int32]) -> tuple[Array, Array]:
    """Twice the outward area vectors (4, k, 3), up to sign, and the volumes (k,)."""
    p = x[T[:, 0]]
    u, v, w = (x[T[:, a]] - p for a in (1, 2, 3))
    g = np.empty((4, len(T), 3))
    g[1], g[2], g[3] = np.cross(v, w), np.cross(w, u), np.cross(u, v)
    g[0] = -(g[1] + g[2] + g[3])
    return g, np.einsum("ij,ij->i", u, g[1]) / 6.0


class Assembly:
    """L_II and L_IB on a fixed pattern."""

    def __init__(self, T: NDArray[np.int32], fixed: NDArray[np.bool_]) -> None:
        n = len(fixed)
        i = np.concatenate([T[:, a] for a, _ in _PAIRS] + [T[:, b] for _, b in _PAIRS])
        j = np.concatenate([T[:, b] for _, b in _PAIRS] + [T[:, a] for a, _ in _PAIRS])
        keys = np.concatenate([i.astype(np.int64) * n + j, np.arange(n, dtype=np.int64) * (n + 1)])
        unique, self._slot = np.unique(keys, return_inverse=True)
        self._pattern = sp.csr_matrix(
            (np.arange(len(unique), dtype=float), (unique // n, unique % n)), shape=(n, n)
        )
        self._rows = i
        self._n = n
        self.free, self.held = np.flatnonzero(~fixed), np.flatnonzero(fixed)
        inner = self._pattern[self.free]
        self._inner, self._couple = inner[:, self.free].tocsc(), inner[:, self.held].tocsr()
        self._inner_at = self._inner.data.astype(np.int64)
        self._couple_at = self._couple.data.astype(np.int64)

    def __call__(self, g: Array, factor: Array) -> tuple[sp.csc_matrix, sp.csr_matrix]:
        """The two matrices for area vectors g and factors (k,)."""
        w = np.concatenate([factor * np.einsum("ij,ij->i", g[a], g[b]) for a, b in _PAIRS])
        w = np.concatenate([w, w])
        diagonal = -np.bincount(self._rows, w, self._n)
        values = np.bincount(self._slot, np.concatenate([w, diagonal]))
        self._inner.data, self._couple.data = values[self._inner_at], values[self._couple_at]
        return self._inner, self._couple


def by_superlu(matrix: sp.csc_matrix, b: Array) -> Array:
    """SciPy's sparse LU."""
    solver = scipy.sparse.linalg.splu(
        matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
    )
    solved: Array = solver.solve(b)
    return solved


def by_cholmod() -> Solve:
    """CHOLMOD, analysed at its first call; later matrices have the same pattern."""
    factors: list[tuple[Cholmod, NDArray[np.intp]]] = []

    def solve(matrix: sp.csc_matrix, b: Array) -> Array:
        if not factors:
            columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
            factors.append((Cholmod(sp.tril(matrix, format="csc")), matrix.indices >= columns))
        factor, lower = factors[0]
        return factor.solve(matrix.data[lower], b)

    return solve


def minimize(
    V: Array, T: NDArray[np.int32], fixed: NDArray[np.bool_], start: Array, c: float, steps: int,
    by: Solve = by_superlu,
) -> tuple[Array, float]:  # fmt: skip
    """Harmonic map and ``steps`` fixed-point steps; the image and the seconds of the steps."""
    assembly = Assembly(T, fixed)
    x = start.copy()

    def solve(g: Array, factor: Array) -> None:
        inner, couple = assembly(g, factor)
        x[assembly.free] = by(inner, -(couple @ x[assembly.held]))

    g, rest = face_vectors(V, T)
    solve(g, 1.0 / rest)
    begin = time.perf_counter()
    for _ in range(steps):
        g, volumes = face_vectors(x, T)
        solve(g, 1.0 / (rest + c * np.abs(volumes)))
    return x, time.perf_counter() - begin
