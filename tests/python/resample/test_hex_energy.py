"""The energy of a grid against finite differences, and its samples of the boundary."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

import stretchmap as sm
from stretchmap import _core, samples
from stretchmap.errors import SolverError
from stretchmap.resample.layout import swept_layout
from stretchmap.resample.optimize import GridOptimizer
from stretchmap.resample.quality import boundary_quads

TORUS = sm.Torus(3.0, 1.0)


def a_grid(noise):
    layout = swept_layout(8, 2, 1)
    V = TORUS.xi(layout.u, layout.v, layout.share)
    V += noise * np.random.default_rng(1).standard_normal(V.shape)
    return layout.H, np.ascontiguousarray(V)


def a_fit(H):
    surface = samples.torus_surface(16, 12, R=3.0, r=1.0)
    normals = TORUS.normal(*TORUS.coordinates(surface.V)[:2])
    faces = np.arange(0, surface.n_faces, 3, dtype=np.int32)
    weights = np.full((len(faces), 3), 1.0 / 3.0)
    quads = boundary_quads(H)
    return _core.resample.BoundaryFit(surface.V, surface.F, normals, faces, weights, quads, 2, 0.1)


@pytest.mark.parametrize(
    ("epsilon", "power", "guarded"),
    [(0.0, 1.0, False), (0.0, 2.5, True), (0.2, 1.0, True), (0.2, 1.0, False)],
)
def test_gradient_and_hessian_are_those_of_the_value(epsilon, power, guarded):
    H, V = a_grid(0.02)
    newton = _core.resample.HexNewton(H, len(V))
    rng = np.random.default_rng(2)
    sides, weights = rng.uniform(0.5, 1.5, (len(H), 24)), rng.uniform(0.5, 1.5, len(H))
    newton.set_rest(sides, weights, np.full(len(H), guarded))
    samples_ = a_fit(H).match(V)
    newton.set_fit(samples_, rng.uniform(1.0, 2.0, len(samples_.share)), 0.05, power, 0.03)
    corner = _core.volume.EnergyWeights(1.0, 0.2, epsilon)
    gradient, start, col, values = newton.model(V, corner, power)
    way = rng.standard_normal(V.shape)
    step = 1e-6
    ahead, behind = (newton.value(V + s * step * way, corner, power) for s in (1.0, -1.0))
    slope = (ahead.energy - behind.energy) / (2.0 * step)
    assert slope == pytest.approx((gradient * way).sum(), rel=1e-6)
    n = 3 * len(V)
    hessian = sp.bsr_matrix((np.reshape(values, (-1, 3, 3)), col, start), shape=(n, n)).toarray()
    assert np.allclose(hessian, hessian.T, atol=1e-9 * abs(hessian).max())
    assert np.linalg.eigvalsh(hessian).min() > -1e-9 * abs(hessian).max()
    # The Hessian of the elements is projected, so it bounds the true curvature from above.
    true = (newton.model(V + step * way, corner, power)[0] - gradient) / step
    assert (way * true).sum() <= (way.ravel() @ hessian @ way.ravel()) * (1.0 + 1e-4)


def test_a_round_lowers_the_energy_with_the_samples_of_where_it_leads():
    """With those of where it starts it may leave a sharp crest along their tangent planes."""
    thin = samples.solid_torus(1500, R=3.0, r=1.0)
    surface = thin.surface
    crest = sm.TriMesh(surface.V * [1.0, 1.0, 0.3], surface.F)
    corner, led_away = _core.volume.EnergyWeights(1.0, 0.1, 0.0), 0
    for twist in (0.05, 0.1, 0.25):
        H, V = a_grid(0.0)
        turn = twist * np.sin(3.0 * V[:, :1])  # round the axis: points glide
        V = V * [1.0, 1.0, 0.3] + turn * np.stack([-V[:, 1], V[:, 0], 0.0 * V[:, 0]], axis=1)
        optimizer = GridOptimizer(np.ascontiguousarray(V), H, crest)
        assert optimizer._untangle(20, None)
        for _ in range(6):
            optimizer._prepare(2.0, 6.0, guard=False)
            start = optimizer.V
            before = optimizer._newton.value(start, corner, 4.0).energy
            full, _ = optimizer._newton.run(start, corner, 4.0, optimizer._steps, tol=0.01)
            optimizer._match(full, 2.0, 6.0)
            led_away += optimizer._newton.value(full, corner, 4.0).energy > before
            optimizer._match(start, 2.0, 6.0)
            optimizer._advance(4.0, 2.0, 6.0)
            optimizer._match(optimizer.V, 2.0, 6.0)
            assert optimizer.V is not start
            assert optimizer._newton.value(optimizer.V, corner, 4.0).energy < before
    assert led_away > 0


def test_samples_lie_on_both_surfaces():
    H, V = a_grid(0.0)
    matched = a_fit(H).match(V)
    first = matched.first_of_surface
    assert first == len(np.unique(boundary_quads(H)))  # corners are shared
    assert matched.share[:first].sum() == pytest.approx(1.0)
    assert matched.share[first:].sum() == pytest.approx(1.0)
    assert 0.0 < matched.distance.max() < 0.5


@pytest.mark.parametrize("per_side", [2, 3, 5])
def test_samples_on_edges_and_corners_are_shared(per_side):
    """All points of all quads, each once; twice matched it is the same."""
    H, V = a_grid(0.05)
    quads = boundary_quads(H)
    surface = samples.torus_surface(16, 12, R=3.0, r=1.0)
    normals = TORUS.normal(*TORUS.coordinates(surface.V)[:2])
    one = np.zeros(1, np.int32), np.full((1, 3), 1.0 / 3.0)
    fit = _core.resample.BoundaryFit(surface.V, surface.F, normals, *one, quads, per_side, 0.1)
    s, t = (k.ravel()[:, None] for k in np.meshgrid(*2 * [np.linspace(0.0, 1.0, per_side)]))
    weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])[..., 0]
    points = np.einsum("ck,qci->qki", weights, V[quads]).reshape(-1, 3)
    _, first, which = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    tree = _core.maps.SurfaceTree(surface.V, surface.F)
    feet = tree.closest(np.ascontiguousarray(points[first]))[0]
    expected = np.linalg.norm(feet - points[first], axis=1)
    across = V[quads[:, 2:]] - V[quads[:, :2]]
    areas = np.linalg.norm(np.cross(across[:, 0], across[:, 1]), axis=1)
    shares = np.bincount(which.ravel(), np.repeat(areas / areas.sum() / per_side**2, per_side**2))
    for _ in range(2):
        found = fit.match(V)
        n = found.first_of_surface
        assert n == len(first)
        order, wanted = np.argsort(found.distance[:n]), np.argsort(expected)
        np.testing.assert_allclose(found.distance[:n][order], expected[wanted], atol=1e-9)
        np.testing.assert_allclose(found.share[:n][order], shares[wanted], rtol=1e-6)


def test_gaps_seen_closely_are_those_to_bilinear_quads():
    """Which are what a warped face of a hexahedron is, not triangles between its corners."""
    cube = np.ascontiguousarray(np.indices((2, 2, 2)).reshape(3, -1).T, float)
    one = np.array([[0, 4, 6, 2, 1, 5, 7, 3]], np.int32)
    cube[[1, 7], 2] += 0.8  # opposite corners of its top
    x, y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(0.35, 0.65, 7)]))
    sites = np.stack([x, y, 1.6 + 0.0 * x], axis=1)
    grid = np.arange(49).reshape(7, 7)
    a, b, c = grid[:-1, :-1].ravel(), grid[:-1, 1:].ravel(), grid[1:, 1:].ravel()
    F = np.ascontiguousarray(np.stack([a, b, c], axis=1), np.int32)
    faces = np.arange(len(F), dtype=np.int32)
    weights = np.ascontiguousarray(np.tile([1.0, 0.0, 0.0], (len(F), 1)))
    normals = np.ascontiguousarray(np.tile([0.0, 0.0, 1.0], (49, 1)))
    s, t = (k.ravel() for k in np.meshgrid(*2 * [np.linspace(0.0, 1.0, 301)]))
    patch = np.stack([s, t, 1.0 + 0.8 * ((1 - s) * (1 - t) + s * t)], axis=1)
    expected = np.linalg.norm(patch - sites[a][:, None], axis=2).min(axis=1)
    quads, errors = boundary_quads(one), []
    for closely in (True, False):
        fit = _core.resample.BoundaryFit(
            sites, F, normals, faces, weights, quads, 2, 0.1, bilinear=closely
        )
        matched = fit.match(cube)
        found = matched.distance[matched.first_of_surface :]
        errors.append(np.abs(found - expected).max())
        assert (matched.share[matched.first_of_surface :] > 0.0).all()
    assert errors[0] < 2e-3 < 0.02 < errors[1]


def test_a_tip_beyond_the_grid_pulls_along_itself():
    """Points of its sides do, too, though their tangent planes hold the grid already."""
    cube = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    )
    one, quads = np.arange(8, dtype=np.int32)[None], boundary_quads(np.arange(8)[None])
    walls = quads[2:]
    F = np.ascontiguousarray(np.concatenate([walls[:, [0, 1, 2]], walls[:, [0, 2, 3]]]), np.int32)
    outward = np.where(cube[:, :2] > 0.5, 1.0, -1.0) / np.sqrt(2.0)
    normals = np.ascontiguousarray(np.column_stack([outward, np.zeros(8)]))
    taller = cube * [1.0, 1.0, 3.0]
    faces, which = np.nonzero(cube[F, 2] > 0.5)
    weights = np.ascontiguousarray(np.eye(3)[which])
    pulls = []
    for far in (1e-3, 1e3):
        fit = _core.resample.BoundaryFit(
            taller, F, normals, faces.astype(np.int32), weights,
            quads.astype(np.int32), 2, far,
        )  # fmt: skip
        samples_ = fit.match(1.0 * cube)
        newton = _core.resample.HexNewton(one, 8)
        newton.set_rest(np.ones((1, 24)), np.ones(1), np.zeros(1, bool))
        newton.set_fit(samples_, np.where(samples_.distance > 1.0, samples_.share, 0.0))
        gradient = newton.model(1.0 * cube, _core.volume.EnergyWeights(1.0, 0.1, 0.0), 1.0)[0]
        pulls.append(-gradient[4:, 2].sum())
    assert pulls[0] == pytest.approx(4.0, rel=1e-3)  # 2 times a gap of 2
    assert abs(pulls[1]) < 1e-3


def test_newton_steps_untangle_and_never_raise_the_energy():
    H, V = a_grid(0.15)
    newton = _core.resample.HexNewton(H, len(V))
    newton.set_rest(np.full((len(H), 24), 0.6), np.ones(len(H)), np.ones(len(H), bool))
    barrier = _core.volume.EnergyWeights(1.0, 1.0, 0.0)
    assert newton.value(V, barrier).flips > 0
    with pytest.raises(SolverError, match="not positive"):
        newton.run(V, barrier, 1.0, 3)
    for epsilon in (0.3, 0.1, 0.03):
        V, report = newton.run(V, _core.volume.EnergyWeights(1.0, 1.0, epsilon), 1.0, 20)
        assert report.after.energy < report.before.energy
    assert report.after.flips == 0
    V, last = newton.run(V, barrier, 2.0, 10)
    assert last.after.energy < last.before.energy and last.after.min_det > 0.0
    assert _core.resample.scaled_jacobians(V, H).min() > 0.3


def test_a_box_whose_edges_are_those_of_the_grid_costs_its_angles_alone():
    """psi + 1 is then the scaled Jacobian to the power -2/3, however the edges are stretched."""
    H, V = a_grid(0.02)
    V = V * [1.0, 2.0, 0.3]
    newton = _core.resample.HexNewton(H, len(V))
    sides = _core.resample.corner_sides(V, H)
    newton.set_rest(sides, np.ones(len(H)), np.zeros(len(H), bool))
    newton.set_fit(a_fit(H).match(V), np.zeros(0))
    shape_only = _core.volume.EnergyWeights(1.0, 0.0, 0.0)
    quality = _core.resample.scaled_jacobians(V, H)
    assert newton.value(V, shape_only, 1.5).energy == pytest.approx(
        ((1.0 / quality - 1.0) / 1.5).mean(axis=1).sum()
    )


def test_edge_triples_bound_the_coefficients_between_corners():
    """The coefficients in the middle of edges are means of two triples each."""
    cube = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    )
    one = np.arange(8, dtype=np.int32)[None]
    assert _core.resample.least_edge_jacobians(1.0 * cube, one)[0] == pytest.approx(1.0)
    rng, caught = np.random.default_rng(6), 0
    middle = [9 * i + 3 * j + k for i in range(3) for j in range(3) for k in range(3)
              if (i == 1) + (j == 1) + (k == 1) == 1]  # fmt: skip
    for _ in range(500):
        corners = cube + 0.4 * rng.standard_normal((8, 3))
        net = np.array(_core.resample.jacobian_coefficients(corners))
        least = _core.resample.least_edge_jacobians(corners, one)[0]
        if net[middle].min() <= 0.0:
            caught += 1
            assert least <= 0.0
    assert caught > 50


def test_boxes_are_drawn_to_the_mean_size_only_once_corners_are_positive(monkeypatch):
    """Drawn earlier, those round inverted hexahedra grow, and every round folds more."""
    H, V = a_grid(0.4)
    grid = GridOptimizer(V, H, samples.torus_surface(16, 12, R=3.0, r=1.0))
    pulls = []
    sides = grid._sides

    def noted(mean, pull):
        pulls.append(pull)
        return sides(mean, pull)

    monkeypatch.setattr(grid, "_sides", noted)
    assert grid._untangle(40, None)
    assert len(pulls) > 1 and set(pulls) == {0.0}
    grid._round(1.0, 1.0)
    assert pulls[-1] > 0.0
