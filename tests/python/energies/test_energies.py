"""Public energies against differences, closed forms, eigenvalues and the optimizer's own."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import _core, energies
from stretchmap.errors import ArrayError, DegenerateError, OptionError, OrientationError

SOLID = sm.samples.solid_torus(400)
SURFACE = sm.samples.torus_surface(12, 8)


def bent(points, seed, amount=0.08):
    """A smooth deformation, the same points every time."""
    rng = np.random.default_rng(seed)
    waves, phases = rng.normal(size=(3, 3)), rng.uniform(0.0, 6.0, 3)
    return points @ (np.eye(3) + 0.2 * rng.normal(size=(3, 3))) + amount * np.sin(
        points @ waves + phases
    )


CASES = {
    "volume stretch": energies.VolumeStretch(SOLID),
    "area stretch": energies.AreaStretch(SURFACE),
    "barrier": energies.DistortionEnergy(SOLID, volume=3.0),
    "regularized": energies.DistortionEnergy(SOLID, shape=0.7, epsilon=0.3, max_aspect=2.0),
}


@pytest.fixture(params=CASES, ids=str)
def case(request):
    energy = CASES[request.param]
    points = bent(energy.mesh.V, 3)
    return energy, -points if request.param == "regularized" else points


def test_gradients_and_hessians_are_those_of_differences(case):
    energy, x = case
    rng = np.random.default_rng(0)
    gradient, hessian = energy.gradient(x), energy.hessian(x)
    assert abs(hessian - hessian.T).max() <= 1e-9 * abs(hessian).max()
    for _ in range(3):
        step = rng.normal(size=x.shape)
        h = 1e-5
        slope = (energy.value(x + h * step) - energy.value(x - h * step)) / (2 * h)
        assert slope == pytest.approx(float((gradient * step).sum()), rel=1e-6, abs=1e-8)
        change = (energy.gradient(x + h * step) - energy.gradient(x - h * step)) / (2 * h)
        expected = (hessian @ step.ravel()).reshape(-1, 3)
        np.testing.assert_allclose(change, expected, atol=1e-6 * np.abs(expected).max())


def test_parts_add_up_to_the_whole(case):
    energy, x = case
    parts = energy.elements(x)
    assert parts.values.sum() == energy.value(x)
    corners = energy.mesh.T if hasattr(energy.mesh, "T") else energy.mesh.F
    whole = np.zeros_like(x)
    np.add.at(whole, corners, parts.gradients)
    np.testing.assert_allclose(energy.gradient(x), whole, atol=1e-12 * np.abs(whole).max())
    # Nothing pushes or turns the whole: gradients of elements add up to zero.
    np.testing.assert_allclose(parts.gradients.sum(axis=1), 0.0, atol=1e-9)
    assert energy.elements(x, 0).gradients is None and energy.elements(x, 1).hessians is None


def test_stretch_energies_are_those_of_the_measures():
    for energy in (energies.VolumeStretch(SOLID), energies.AreaStretch(SURFACE)):
        image = bent(energy.mesh.V, 5)
        found = sm.distortion(energy.mesh, image)
        assert energy.value(image) == pytest.approx(found.stretch_energy, rel=1e-12)
        assert energy.value(image) > found.stretch_bound


def test_projected_hessians_have_the_negative_eigenvalues_of_the_exact_ones_cut_off():
    options = {"shape": 1.0, "volume": 2.0, "epsilon": 0.2}
    x = bent(SOLID.V, 7, 0.4)
    exact = energies.DistortionEnergy(SOLID, **options).elements(x).hessians
    projected = energies.DistortionEnergy(SOLID, projected=True, **options).elements(x).hessians
    cut = 0
    for t in range(0, SOLID.n_tets, 7):
        corners = SOLID.V[SOLID.T[t]]
        rest = np.linalg.inv((corners[1:] - corners[0]).T)
        # Columns of J by the twelve coordinates.
        slope = np.kron(np.vstack([-rest.sum(axis=0), rest]).T, np.eye(3))
        back = np.linalg.pinv(slope)
        values, vectors = np.linalg.eigh(back.T @ exact[t] @ back)
        expected = slope.T @ (vectors * np.maximum(values, 0.0)) @ vectors.T @ slope
        np.testing.assert_allclose(projected[t], expected, atol=1e-7 * np.abs(exact[t]).max())
        cut += values.min() < 0.0
    assert cut > 10


def test_the_distortion_energy_is_the_one_of_the_optimizer():
    x = bent(SOLID.V, 11)
    factors = np.sqrt(SOLID.tet_volumes)
    newton = _core.volume.SolidNewton(
        x,
        tets=SOLID.T,
        rest=_core.volume.rest_matrices(SOLID.V, SOLID.T, 6.0),
        weights=factors,
        motion=np.zeros(SOLID.n_vertices, np.uint8),
    )
    energy = energies.DistortionEnergy(SOLID, volume=5.0, weights=factors, max_aspect=6.0)
    theirs = newton.value(x, _core.volume.EnergyWeights(1.0, 5.0)).energy
    assert energy.value(x) == pytest.approx(theirs, rel=1e-12)


def test_newton_steps_with_these_derivatives_end_where_nothing_is_distorted():
    from scipy.sparse import identity
    from scipy.sparse.linalg import spsolve

    energy = energies.DistortionEnergy(SOLID, projected=True)
    x = bent(SOLID.V, 13, 0.05)
    for _ in range(25):
        gradient = energy.gradient(x)
        step = -spsolve(energy.hessian(x) + 1e-9 * identity(x.size), gradient.ravel()).reshape(
            -1, 3
        )
        alpha = 0.9 * energies.longest_step(SOLID, x, step, limit=1.0 / 0.9)
        while energy.value(x + alpha * step) > energy.value(x):
            alpha *= 0.5
            if alpha < 1e-9:
                break
        x = x + alpha * step
    assert energy.value(x) < 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_the_bound_is_the_first_step_at_which_a_tet_turns_over(seed):
    rng = np.random.default_rng(seed)
    x, step = bent(SOLID.V, seed), rng.normal(size=SOLID.V.shape)
    alpha = energies.longest_step(SOLID, x, step, limit=10.0)
    volumes = _core.mesh.tet_volumes
    for share in np.linspace(0.0, 0.999, 12):
        assert (volumes(x + share * alpha * step, SOLID.T) > 0.0).all()
    assert (volumes(x + 1.05 * alpha * step, SOLID.T) < 0.0).any()


def test_threads_change_no_bit():
    energy = energies.DistortionEnergy(sm.samples.solid_torus(9000), epsilon=0.1)
    x = bent(energy.mesh.V, 2)
    with sm.threads(1):
        one = energy.elements(x)
    with sm.threads(3):
        three = energy.elements(x)
    assert (one.hessians == three.hessians).all() and (one.gradients == three.gradients).all()


def test_errors_name_what_is_wrong():
    barrier = energies.DistortionEnergy(SOLID)
    assert barrier.value(-SOLID.V) == np.inf
    with pytest.raises(DegenerateError, match="epsilon") as caught:
        barrier.gradient(-SOLID.V)
    assert len(caught.value.ids) == SOLID.n_tets
    with pytest.raises(OrientationError, match="untangle"):
        energies.longest_step(SOLID, -SOLID.V, SOLID.V)
    with pytest.raises(OptionError, match="limit"):
        energies.longest_step(SOLID, SOLID.V, SOLID.V, limit=0.0)
    with pytest.raises(ArrayError):
        barrier.value(SOLID.V[:-1])
    with pytest.raises(OptionError, match="order"):
        barrier.elements(SOLID.V, 3)
    with pytest.raises(OptionError, match="positive"):
        energies.DistortionEnergy(SOLID, weights=np.zeros(SOLID.n_tets))


def test_weights_are_those_given_at_the_beginning():
    weights = np.full(SOLID.n_tets, 1.0 / SOLID.n_tets)
    energy = energies.DistortionEnergy(SOLID, weights=weights)
    before = energy.value(SOLID.V * [1.0, 1.0, 2.0])
    weights *= 3.0
    assert energy.value(SOLID.V * [1.0, 1.0, 2.0]) == before
