"""Element energy of the flip-free optimisation: finite differences, closed forms, projection."""

from __future__ import annotations

import numpy as np
import pytest

from stretchmap import _core

RNG = np.random.default_rng(7)


def value(J, w):
    return _core.element_energy(J, w)[0]


def hessian_by_differences(J, w, h=1e-5):
    H = np.zeros((9, 9))
    for k in range(9):
        E = np.zeros(9)
        E[k] = h
        E = E.reshape(3, 3, order="F")
        plus, minus = (_core.element_energy(J + s * E, w)[1] for s in (1, -1))
        H[:, k] = (plus - minus).reshape(9, order="F") / (2 * h)
    return H


@pytest.mark.parametrize(
    ("epsilon", "inverted"), [(0.0, False), (0.3, False), (0.3, True), (2.0, False), (2.0, True)]
)
def test_gradient_matches_finite_differences(epsilon, inverted):
    w = _core.EnergyWeights(1.3, 0.7, epsilon)
    for _ in range(10):
        J = np.eye(3) + 0.3 * RNG.standard_normal((3, 3))
        if (np.linalg.det(J) < 0) != inverted:
            J[:, 0] *= -1
        P = _core.element_energy(J, w)[1]
        h = 1e-6
        for i in range(3):
            for j in range(3):
                E = np.zeros((3, 3))
                E[i, j] = h
                slope = (value(J + E, w) - value(J - E, w)) / (2 * h)
                assert slope == pytest.approx(P[i, j], rel=2e-6, abs=1e-6 * np.abs(P).max())


@pytest.mark.parametrize("epsilon", [0.0, 0.3])
def test_hessian_is_the_positive_part_of_the_differenced_one(epsilon):
    w = _core.EnergyWeights(1.0, 2.0, epsilon)
    for trial in range(20):
        J = np.diag([1.0, 0.9, 0.7]) + 0.25 * RNG.standard_normal((3, 3))
        if np.linalg.det(J) < 0 and (epsilon == 0.0 or trial % 2):
            J[:, 0] *= -1
        H = _core.element_energy(J, w)[2]
        exact = hessian_by_differences(J, w)
        values, vectors = np.linalg.eigh(0.5 * (exact + exact.T))
        projected = (vectors * np.maximum(values, 0)) @ vectors.T
        assert np.abs(H - projected).max() < 1e-5 * np.abs(exact).max()


def test_rotations_cost_nothing_and_are_minima():
    Q = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    energy, P, _ = _core.element_energy(Q, _core.EnergyWeights(1.0, 5.0))
    assert energy == pytest.approx(0, abs=1e-14)
    assert np.abs(P).max() < 1e-13


def test_barrier_is_infinite_at_inversion_and_its_closed_form_holds():
    w = _core.EnergyWeights(0.0, 1.0)
    for d in (0.25, 1.0, 3.0):
        J = np.diag([1.0, 1.0, d])
        assert value(J, w) == pytest.approx(0.5 * (d + 1 / d) - 1, rel=1e-14)
    w = _core.EnergyWeights(1.0, 0.0)
    J = np.diag([1.0, 2.0, 4.0])  # tr / (3 det^(2/3)) - 1
    assert value(J, w) == pytest.approx(21 / 12 - 1, rel=1e-14)


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_rank_deficient_elements_are_finite_when_regularised(rank):
    J = np.zeros((3, 3))
    J[:rank, :rank] = np.eye(rank)
    energy, P, H = _core.element_energy(J, _core.EnergyWeights(1.0, 1.0, 0.5))
    assert np.isfinite(energy) and np.isfinite(P).all() and np.isfinite(H).all()
    assert np.linalg.eigvalsh(H).min() > -1e-9 * np.abs(H).max()
