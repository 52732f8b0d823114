"""Normal equations of a tall system: their matrix and their solution."""

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import _core, errors


@pytest.mark.parametrize("shape", [(700, 103), (3000, 600), (5, 9), (40, 1), (0, 3)])
def test_against_numpy(shape):
    random = np.random.default_rng(7)
    A, weights = random.standard_normal(shape), random.standard_normal(shape[0])
    found = _core.linalg.normal_matrix(A, weights)
    assert np.array_equal(found, found.T)
    np.testing.assert_allclose(found, (A.T * weights) @ A, rtol=0.0, atol=1e-11)


def test_bits_do_not_depend_on_threads():
    random = np.random.default_rng(8)
    A, weights = random.standard_normal((3000, 900)), random.random(3000)
    found = []
    for count in (1, 2, 5):
        with sm.threads(count):
            matrix = _core.linalg.normal_matrix(A, weights)
            found.append(np.vstack([matrix, _core.linalg.solve_dense(matrix, A[0])]))
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


def test_a_weight_for_every_row():
    with pytest.raises(errors.SolverError):
        _core.linalg.normal_matrix(np.ones((4, 2)), np.ones(3))


@pytest.mark.parametrize("n", [1, 7, 32, 33, 312, 700])
@pytest.mark.parametrize("least", [1.0, 1e-10])
def test_solutions_are_as_exact_as_lapack(n, least):
    random = np.random.default_rng(n)
    turn = np.linalg.qr(random.standard_normal((n, n)))[0]
    A = np.ascontiguousarray((turn * np.geomspace(least, 1.0, n)) @ turn.T)
    A, b = 0.5 * (A + A.T), random.standard_normal(n)
    left, usual = (
        np.abs(A @ x - b).max() for x in (_core.linalg.solve_dense(A, b), np.linalg.solve(A, b))
    )
    assert left < 4.0 * usual + 1e-14 * n


@pytest.mark.parametrize("values", [[1.0, -1.0], [1.0, 0.0], [1.0, np.nan], [1.0, np.inf]])
def test_what_is_not_positive_definite_is_refused(values):
    with pytest.raises(errors.SolverError, match="positive definite"):
        _core.linalg.solve_dense(np.diag(values), np.ones(2))
    with pytest.raises(errors.SolverError, match="square"):
        _core.linalg.solve_dense(np.diag(values), np.ones(3))
    with pytest.raises(errors.SolverError, match="square"):
        _core.linalg.solve_dense(np.ones((2, 3)), np.ones(2))
