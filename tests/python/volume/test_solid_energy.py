"""Newton steps on the energy of a solid; its derivatives are tested in tests/cpp."""

from __future__ import annotations

import numpy as np
import pytest

from stretchmap import _core

RNG = np.random.default_rng(7)


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


def test_a_step_knows_the_energy_where_it_begins():
    """Whether it begins where the last one ended, elsewhere, with other weights or targets."""
    from stretchmap import samples

    solid = samples.solid_torus(600)
    V, T, n = solid.V / solid.volume ** (1 / 3), solid.T, len(solid.V)
    motion = np.zeros(n, np.uint8)
    motion[solid.boundary_vertices] = 1
    newton = _core.volume.SolidNewton(
        V,
        tets=T,
        rest=_core.volume.rest_matrices(V, T, 6.0),
        weights=solid.tet_volumes / solid.volume,
        motion=motion,
    )
    x = V.copy()
    x[motion == 0] += 0.002 * RNG.standard_normal(((motion == 0).sum(), 3))
    options = _core.volume.NewtonOptions(tol=0.1, max_cg=100)
    shifted = lambda x: x + 1e-3 * np.sin(x) * (motion == 0)[:, None]  # noqa: E731
    targets = 1.0 + 0.1 * RNG.random(len(T))
    for weight, change, target in [
        (3.0, None, None), (3.0, None, None), (9.0, None, None), (9.0, shifted, None),
        (9.0, None, targets), (9.0, None, None),
    ]:  # fmt: skip
        x = x if change is None else change(x)
        if target is not None:
            newton.set_targets(target)
        w = _core.volume.EnergyWeights(1.0, weight, 0.0, 0.0)
        expected = newton.value(x, w).energy
        x, report = newton.step(x, w, options)
        assert report.before.energy == expected
        assert report.after.energy == newton.value(x, w).energy < expected


def test_a_soft_energy_gives_each_inverted_tet_an_epsilon_of_its_own():
    """sqrt(epsilon^2 + (soft min(det, 0))^2), of where the step begins and for all of it."""
    from stretchmap import samples

    solid = samples.solid_torus(600)
    V, T, n = solid.V / solid.volume ** (1 / 3), solid.T, len(solid.V)
    weights = solid.tet_volumes / solid.volume
    rest = _core.volume.rest_matrices(V, T, 6.0)
    newton = _core.volume.SolidNewton(
        V, tets=T, rest=rest, weights=weights, motion=np.zeros(n, np.uint8)
    )
    x = V + 0.2 * np.random.default_rng(3).normal(size=V.shape)

    def energy(at, own):
        J = np.swapaxes(at[T[:, 1:]] - at[T[:, :1]], 1, 2) @ rest.reshape(-1, 3, 3)
        det, root = np.linalg.det(J), np.hypot(0.3, own)
        chi = 0.5 * (det + np.sqrt(root**2 + det**2))
        shape = (J**2).sum(axis=(1, 2)) / (3.0 * chi ** (2 / 3)) - 1.0
        return float(weights @ (shape + 2.0 * ((det**2 + 1.0) / (2.0 * chi) - 1.0))), det

    det = energy(x, 0.0)[1]
    assert (det < -1.0).any() and (det > 0.0).any()
    linear = _core.volume.NewtonOptions()
    for soft in (0.2, 0.0, 1.0):
        w = _core.volume.EnergyWeights(1.0, 2.0, 0.3, 0.0, soft)
        y, report = newton.step(x, w, linear)
        own = soft * np.minimum(det, 0.0)
        assert report.before.energy == pytest.approx(energy(x, own)[0], rel=1e-10)
        assert report.after.energy == pytest.approx(energy(y, own)[0], rel=1e-10)
        assert report.after.energy < report.before.energy
    # A step that follows begins with what is inverted by then.
    y, _ = newton.step(x, w, linear)
    _, report = newton.step(y, w, linear)
    own = np.minimum(energy(y, 0.0)[1], 0.0)
    assert report.before.energy == pytest.approx(energy(y, own)[0], rel=1e-10)
