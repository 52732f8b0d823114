"""CHOLMOD, the peer of races and of Algorithm 5.1: the same solutions as SciPy's."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

PEERS = Path(__file__).resolve().parents[3] / "bench" / "peers"
MODULES = ("cholmod", "scipy_vsem")


@pytest.fixture
def peers(monkeypatch: pytest.MonkeyPatch):
    for name in ("cvxopt", "pymetis"):
        pytest.importorskip(name)
    monkeypatch.syspath_prepend(str(PEERS))
    for name in MODULES:
        sys.modules.pop(name, None)
    import scipy_vsem

    yield scipy_vsem
    for name in MODULES:
        sys.modules.pop(name, None)


def test_solves_with_every_matrix_of_one_pattern(peers) -> None:
    rng = np.random.default_rng(3)
    line = sp.diags([-1.0, 2.5, -1.0], [-1, 0, 1], (12, 12))
    grid = sp.kronsum(line, line).tocsc()
    solve, b = peers.by_cholmod(), rng.standard_normal((grid.shape[0], 3))
    for _ in range(3):
        scale = sp.diags(rng.uniform(0.5, 2.0, grid.shape[0]))
        matrix = (scale @ grid @ scale).tocsc()
        matrix.sort_indices()
        x = solve(matrix, b)
        assert np.abs(matrix @ x - b).max() < 1e-12
        assert np.allclose(x, peers.by_superlu(matrix, b), atol=1e-12)


def test_refuses_what_is_not_definite(peers) -> None:
    with pytest.raises(ArithmeticError):
        peers.by_cholmod()(sp.diags([1.0, -1.0, 2.0]).tocsc(), np.ones(3))
