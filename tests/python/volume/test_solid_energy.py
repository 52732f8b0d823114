"""Element energy of the flip-free optimisation: finite differences, closed forms, projection."""

from __future__ import annotations

import numpy as np
import pytest

from stretchmap import _core

RNG = np.random.default_rng(7)


def value(J, w):
    return _core.testing.element_energy(J, w)[0]


def hessian_by_differences(J, w, h=1e-5):
    H = np.zeros((9, 9))
    for k in range(9):
        E = np.zeros(9)
        E[k] = h
        E = E.reshape(3, 3, order="F")
        plus, minus = (_core.testing.element_energy(J + s * E, w)[1] for s in (1, -1))
        H[:, k] = (plus - minus).reshape(9, order="F") / (2 * h)
    return H


@pytest.mark.parametrize(
    ("epsilon", "inverted"), [(0.0, False), (0.3, False), (0.3, True), (2.0, False), (2.0, True)]
)
def test_gradient_matches_finite_differences(epsilon, inverted):
    w = _core.volume.EnergyWeights(1.3, 0.7, epsilon)
    for _ in range(10):
        J = np.eye(3) + 0.3 * RNG.standard_normal((3, 3))
        if (np.linalg.det(J) < 0) != inverted:
            J[:, 0] *= -1
        P = _core.testing.element_energy(J, w)[1]
        h = 1e-6
        for i in range(3):
            for j in range(3):
                E = np.zeros((3, 3))
                E[i, j] = h
                slope = (value(J + E, w) - value(J - E, w)) / (2 * h)
                assert slope == pytest.approx(P[i, j], rel=2e-6, abs=1e-6 * np.abs(P).max())


@pytest.mark.parametrize("epsilon", [0.0, 0.3])
def test_hessian_is_the_positive_part_of_the_differenced_one(epsilon):
    w = _core.volume.EnergyWeights(1.0, 2.0, epsilon)
    for trial in range(20):
        J = np.diag([1.0, 0.9, 0.7]) + 0.25 * RNG.standard_normal((3, 3))
        if np.linalg.det(J) < 0 and (epsilon == 0.0 or trial % 2):
            J[:, 0] *= -1
        H = _core.testing.element_energy(J, w)[2]
        exact = hessian_by_differences(J, w)
        values, vectors = np.linalg.eigh(0.5 * (exact + exact.T))
        projected = (vectors * np.maximum(values, 0)) @ vectors.T
        assert np.abs(H - projected).max() < 1e-5 * np.abs(exact).max()


def test_rotations_cost_nothing_and_are_minima():
    Q = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    energy, P, _ = _core.testing.element_energy(Q, _core.volume.EnergyWeights(1.0, 5.0))
    assert energy == pytest.approx(0, abs=1e-14)
    assert np.abs(P).max() < 1e-13


def test_barrier_is_infinite_at_inversion_and_its_closed_form_holds():
    w = _core.volume.EnergyWeights(0.0, 1.0)
    for d in (0.25, 1.0, 3.0):
        J = np.diag([1.0, 1.0, d])
        assert value(J, w) == pytest.approx(0.5 * (d + 1 / d) - 1, rel=1e-14)
    w = _core.volume.EnergyWeights(1.0, 0.0)
    J = np.diag([1.0, 2.0, 4.0])  # tr / (3 det^(2/3)) - 1
    assert value(J, w) == pytest.approx(21 / 12 - 1, rel=1e-14)


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_rank_deficient_elements_are_finite_when_regularized(rank):
    J = np.zeros((3, 3))
    J[:rank, :rank] = np.eye(rank)
    energy, P, H = _core.testing.element_energy(J, _core.volume.EnergyWeights(1.0, 1.0, 0.5))
    assert np.isfinite(energy) and np.isfinite(P).all() and np.isfinite(H).all()
    assert np.linalg.eigvalsh(H).min() > -1e-9 * np.abs(H).max()


def on_torus(angles, R, r):
    u, v = angles[:, 0], angles[:, 1]
    rho = R + r * np.cos(v)
    return np.column_stack([rho * np.cos(u), rho * np.sin(u), r * np.sin(v)])


def face_case(folded):
    R, r = 2.0, 0.7
    angles = np.array([[0.3, 0.4], [0.55, 0.5], [0.4, 0.8]])
    if folded:
        angles[2] = [0.45, 0.35]
    faces = np.array([[0, 1, 2]], np.int32)
    rest = _core.volume.rest_triangles(
        np.array([[0.0, 0, 0], [0.5, 0.1, 0], [0.1, 0.4, 0.2]]), faces, 1.1, 6.0
    )
    return R, r, angles, faces, rest


@pytest.mark.parametrize(("epsilon", "folded"), [(0.0, False), (0.4, False), (0.4, True)])
def test_face_gradient_is_by_arc_length_along_the_coordinate_circles(epsilon, folded):
    R, r, angles, faces, rest = face_case(folded)
    _, gradient, hessian = _core.testing.face_energy(
        on_torus(angles, R, r), faces, rest, R, r, epsilon
    )
    h = 1e-6
    for i in range(3):
        metric = (R + r * np.cos(angles[i, 1]), r)
        for j in range(2):
            energies = []
            for sign in (1, -1):
                moved = angles.copy()
                moved[i, j] += sign * h / metric[j]
                image = on_torus(moved, R, r)
                energies.append(_core.testing.face_energy(image, faces, rest, R, r, epsilon)[0])
            slope = (energies[0] - energies[1]) / (2 * h)
            assert slope == pytest.approx(gradient[2 * i + j], rel=1e-6, abs=1e-7)
    assert np.linalg.eigvalsh(hessian).min() > -1e-10 * np.abs(hessian).max()


def test_folded_face_is_infinitely_bad_without_regularization():
    R, r, angles, faces, rest = face_case(folded=True)
    assert _core.testing.face_energy(on_torus(angles, R, r), faces, rest, R, r, 0.0)[0] == np.inf


@pytest.mark.parametrize("glide", [False, True])
def test_newton_steps_reach_a_critical_point(glide):
    """A solid torus out of shape returns to a critical point; steps lower the energy."""
    from stretchmap import samples

    solid = samples.solid_torus(600, R=2.0, r=1.0)
    V, T = solid.V / solid.volume ** (1 / 3), solid.T
    scale = solid.volume ** (1 / 3)
    R, r = 2.0 / scale, 1.0 / scale
    motion = np.zeros(len(V), np.uint8)
    motion[solid.boundary_vertices] = 2 if glide else 1
    u = np.arctan2(V[:, 1], V[:, 0])
    v = np.arctan2(V[:, 2], np.hypot(V[:, 0], V[:, 1]) - R)
    s = np.hypot(V[:, 2], np.hypot(V[:, 0], V[:, 1]) - R)
    if glide:  # slide the whole picture so that the boundary has somewhere to go
        u, v = u + 0.1 * np.sin(2 * u), v + 0.1 * np.cos(u)
    rho = R + s * np.cos(v)
    x = np.column_stack([rho * np.cos(u), rho * np.sin(u), s * np.sin(v)])
    inner = np.setdiff1d(np.arange(len(V)), solid.boundary_vertices)
    x[inner] += 0.01 * r * RNG.standard_normal((len(inner), 3))
    shares = solid.tet_volumes / solid.volume
    faces = solid.boundary_vertices[solid.surface.F]
    boundary = _core.volume.GlidingBoundary(
        surface=_core.volume.TorusSurface(R, r),
        faces=faces,
        rest=_core.volume.rest_triangles(V, faces, 1.0, 6.0),
        weights=np.full(len(faces), 1.0 / len(faces)),
    )
    newton = _core.volume.SolidNewton(
        x,
        tets=T,
        rest=_core.volume.rest_matrices(V, T, 6.0),
        weights=shares,
        motion=motion,
        boundary=boundary,
    )
    w = _core.volume.EnergyWeights(1.0, 3.0, 0.0, 1.0 if glide else 0.0)
    moved, report = newton.step(x, w, _core.volume.NewtonOptions(tol=1e-10, max_cg=2000))
    assert report.alpha >= 1.0 and report.after.energy < report.before.energy
    # Repeated steps converge to a point where the gradient vanishes.
    for _ in range(60):
        moved, report = newton.step(moved, w, _core.volume.NewtonOptions(tol=1e-8, max_cg=2000))
    assert report.decrement < 1e-9 * report.before.energy
