"""The matrix of normal equations of a tall system."""

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
    A, weights = random.standard_normal((3000, 900)), random.standard_normal(3000)
    found = []
    for count in (1, 2, 5):
        with sm.threads(count):
            found.append(_core.linalg.normal_matrix(A, weights))
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


def test_a_weight_for_every_row():
    with pytest.raises(errors.SolverError):
        _core.linalg.normal_matrix(np.ones((4, 2)), np.ones(3))
