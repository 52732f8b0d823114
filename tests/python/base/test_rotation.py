"""Rotations of least squares."""

from __future__ import annotations

import numpy as np
import pytest

from stretchmap.base.rotation import kabsch


@pytest.fixture
def random():
    return np.random.default_rng(7)


def rotation(random):
    Q = np.linalg.qr(random.standard_normal((3, 3)))[0]
    return Q * np.sign(np.linalg.det(Q))


def test_a_rotation_is_found_again(random):
    p, R = random.standard_normal((20, 3)), rotation(random)
    found, shares = kabsch(p.T @ (p @ R))
    assert found == pytest.approx(R, abs=1e-12)
    assert shares.sum() == pytest.approx((p**2).sum())


def test_a_reflection_is_never_taken_and_no_rotation_is_nearer(random):
    p = random.standard_normal((20, 3))
    q = p * [1.0, 1.0, -1.0] + 0.1 * random.standard_normal((20, 3))
    found, shares = kabsch(p.T @ q)
    assert np.linalg.det(found) == pytest.approx(1.0) and shares[2] < 0.0
    assert shares.sum() == pytest.approx(((p @ found) * q).sum())
    for _ in range(200):
        assert ((p @ rotation(random)) * q).sum() <= shares.sum() + 1e-9


def test_many_at_once_are_as_one_by_one(random):
    products = random.standard_normal((5, 4, 3, 3))
    rotations, shares = kabsch(products)
    for i, j in np.ndindex(5, 4):
        one, share = kabsch(products[i, j])
        np.testing.assert_array_equal(rotations[i, j], one)
        np.testing.assert_array_equal(shares[i, j], share)
