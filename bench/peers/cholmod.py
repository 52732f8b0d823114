"""CHOLMOD as its authors would run it: supernodal, ordered by nested dissection, analysed once.

    pip install cvxopt pymetis

cvxopt's wheels contain CHOLMOD and a BLAS, pymetis finds the ordering; CHOLMOD's own minimum degree
takes two to three times as long on solids.
"""

from __future__ import annotations

import importlib.util

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

AVAILABLE = all(importlib.util.find_spec(name) for name in ("cvxopt", "pymetis"))


class Cholmod:
    """Solves with symmetric positive definite matrices that share a pattern.

    Parameters
    ----------
    lower : csc_matrix
        Lower triangle; its indices, sorted, are the pattern.
    """

    def __init__(self, lower: sp.csc_matrix) -> None:
        from cvxopt import cholmod, matrix, spmatrix
        from pymetis import CSRAdjacency, nested_dissection

        self._cholmod, self._matrix = cholmod, matrix
        cholmod.options.update(supernodal=2, print=0)
        entries = lower.tocoo()
        self._lower = spmatrix(
            matrix(entries.data), matrix(entries.row.astype(np.int64)),
            matrix(entries.col.astype(np.int64)), lower.shape,
        )  # fmt: skip
        below = sp.tril(lower, -1)
        graph = (below + below.T).tocsr()
        order, _ = nested_dissection(CSRAdjacency(graph.indptr, graph.indices))
        self._symbolic = cholmod.symbolic(self._lower, p=matrix(list(map(int, order))))

    def solve(self, values: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solution for the entries of the lower triangle, in the pattern's order.

        Raises
        ------
        ArithmeticError
            The matrix is not positive definite.
        """
        self._lower.V = self._matrix(values)
        self._cholmod.numeric(self._lower, self._symbolic)
        x = self._matrix(b)
        self._cholmod.solve(self._symbolic, x)
        return np.asarray(x).reshape(b.shape)
