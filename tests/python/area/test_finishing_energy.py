"""Energies of area maps: identities, derivatives by differences, a second computation."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap
from stretchmap import Torus, TriMesh, _core, area_map
from stretchmap.conformal.map import conformal_map
from stretchmap.errors import SolverError

TWO_PI = 2.0 * np.pi


# --- stretch energy and Laplacian ---------------------------------------------------------------


def cotangent_stretch_laplacian(mesh: TriMesh, image: np.ndarray) -> np.ndarray:
    """(4.2)-(4.3) literally: cotangents of the image over the stretch factors."""
    L = np.zeros((len(image), len(image)))
    for face, area in zip(mesh.F, mesh.face_areas, strict=True):
        p = image[face]
        size = 0.5 * np.linalg.norm(np.cross(p[1] - p[0], p[2] - p[0]))
        for k in range(3):
            i, j = face[(k + 1) % 3], face[(k + 2) % 3]
            a, b = p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]
            cotangent = a @ b / np.linalg.norm(np.cross(a, b))
            w = 0.5 * cotangent * size / area
            L[[i, j], [j, i]] -= w
            L[[i, j], [i, j]] += w
    return L


def test_stretch_laplacian_is_the_printed_one(bumpy: TriMesh) -> None:
    image = bumpy.V @ np.diag([1.0, 0.7, 1.3])
    ours = _core.testing.surface_stretch_laplacian(bumpy.F, bumpy.face_areas, image).toarray()
    np.testing.assert_allclose(ours, cotangent_stretch_laplacian(bumpy, image), atol=1e-12)


def test_stretch_energy_identities(bumpy: TriMesh) -> None:
    image = bumpy.V @ np.diag([1.0, 0.7, 1.3])
    L = _core.testing.surface_stretch_laplacian(bumpy.F, bumpy.face_areas, image)
    energy = _core.testing.surface_stretch_energy(bumpy.F, bumpy.face_areas, image)
    areas = TriMesh(image, bumpy.F).face_areas
    assert energy == pytest.approx(0.5 * np.trace(image.T @ (L @ image)), rel=1e-13)
    assert energy == pytest.approx((areas**2 / bumpy.face_areas).sum(), rel=1e-13)
    assert energy > areas.sum() ** 2 / bumpy.area
    similar = _core.testing.surface_stretch_energy(bumpy.F, bumpy.face_areas, 3.0 * bumpy.V)
    assert similar == pytest.approx(81.0 * bumpy.area, rel=1e-13)


def test_stretch_gradient_by_differences(bumpy: TriMesh) -> None:
    rng = np.random.default_rng(0)
    direction = rng.normal(size=bumpy.V.shape)
    image, h = bumpy.V @ np.diag([1.0, 0.7, 1.3]), 1e-5

    def energy(t: float) -> float:
        return _core.testing.surface_stretch_energy(
            bumpy.F, bumpy.face_areas, image + t * direction
        )

    gradient = (
        2.0 * _core.testing.surface_stretch_laplacian(bumpy.F, bumpy.face_areas, image) @ image
    )
    numeric = (energy(h) - energy(-h)) / (2.0 * h)
    assert (gradient * direction).sum() == pytest.approx(numeric, rel=1e-7)


def test_chart_energy_and_gradient(
    bumpy: TriMesh, chart: _core.area.SurfaceChart, turns: np.ndarray
) -> None:
    periods = np.array([1.6, 0.9])
    areas = bumpy.face_areas
    rng = np.random.default_rng(0)
    direction, h = rng.normal(size=turns.shape), 1e-6

    def energy(t: float) -> float:
        return _core.testing.chart_stretch_energy(chart, areas, periods, turns + t * direction)

    half = _core.testing.chart_stretch_product(chart, areas, periods, turns, turns) * periods
    numeric = (energy(h) - energy(-h)) / (2.0 * h)
    assert 2.0 * (half * direction * periods).sum() == pytest.approx(numeric, rel=1e-6)
    signed = _core.area.turn_areas(chart, turns) * periods.prod()
    assert energy(0.0) == pytest.approx((signed**2 / areas).sum(), rel=1e-12)
    assert signed.sum() == pytest.approx(periods.prod(), rel=1e-12)
    laplacian = _core.testing.chart_stretch_laplacian(chart, areas, periods, turns)
    np.testing.assert_allclose(laplacian @ np.ones(len(turns)), 0.0, atol=1e-12)
    moved = _core.testing.chart_stretch_product(chart, areas, periods, turns, turns + direction)
    before = _core.testing.chart_stretch_product(chart, areas, periods, turns, turns)
    np.testing.assert_allclose(moved - before, laplacian @ direction, atol=1e-10)


# --- chart --------------------------------------------------------------------------------------


@pytest.mark.parametrize("tube_ratio", [0.0, 0.3, 0.95, 0.9999])
def test_equal_area_coordinate_and_its_inverse(tube_ratio: float) -> None:
    s = np.concatenate([np.linspace(-20.0, 20.0, 2001), np.pi * np.arange(-5, 6)])
    v = _core.area.angle_from_equal_area(s, tube_ratio)
    np.testing.assert_allclose(v + tube_ratio * np.sin(v), s, atol=1e-13)
    np.testing.assert_allclose(_core.testing.equal_area_from_angle(v, tube_ratio), s, atol=1e-13)
    assert np.abs(v - s).max() <= tube_ratio + 1e-12


def test_open_forms_are_refused(bumpy: TriMesh) -> None:
    forms = conformal_map(bumpy).forms.copy()
    forms[0, 0] += 1
    with pytest.raises(SolverError, match="not closed") as caught:
        _core.area.SurfaceChart(bumpy.topology, forms)
    assert len(caught.value.ids) == 2


# --- finishing energy ---------------------------------------------------------------------------


@pytest.mark.parametrize("weights", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_finishing_derivatives_by_differences(
    glide: tuple[_core.area.GlideProblem, np.ndarray], weights: tuple[float, float, float]
) -> None:
    problem, angles = glide
    direction = np.random.default_rng(3).normal(size=angles.shape)
    h = 1e-5

    def at(t: float) -> tuple[float, np.ndarray, object]:
        return _core.testing.glide_energy(problem, *weights, 1.1, angles + t * direction)

    _, gradient, hessian = at(0.0)
    (plus, gradient_plus, _), (minus, gradient_minus, _) = at(h), at(-h)
    assert gradient @ direction.ravel() == pytest.approx((plus - minus) / (2 * h), rel=1e-5)
    numeric = (gradient_plus - gradient_minus) / (2 * h)
    np.testing.assert_allclose(
        hessian @ direction.ravel(), numeric, atol=1e-7 * np.abs(numeric).max()
    )


@pytest.mark.parametrize("sides", [(9, 5, 1.2), (12, 8, 2.0)])
def test_facing_derivatives_by_differences(sides: tuple[int, int, float]) -> None:
    nu, nv, ratio = sides
    mesh = stretchmap.samples.torus_surface(nu, nv, ratio, 1.0)
    conformal = conformal_map(mesh)
    chart = _core.area.SurfaceChart(mesh.topology, conformal.forms)
    problem = _core.area.GlideProblem(chart, _core.area.SurfaceReference(mesh.V, mesh.F), ratio)
    rng = np.random.default_rng(5)
    angles = conformal.angles + 0.05 * rng.normal(size=conformal.angles.shape)
    direction = rng.normal(size=angles.shape)
    h = 1e-6

    def at(t: float, epsilon: float) -> tuple[float, np.ndarray, object]:
        moved = angles + t * direction
        return _core.testing.glide_energy(
            problem, 0.0, 0.0, 0.0, 1.0, moved, facing=1.0, epsilon=epsilon
        )

    for epsilon in (0.3, 0.0):
        slope = (at(h, epsilon)[0] - at(-h, epsilon)[0]) / (2 * h)
        assert at(0.0, epsilon)[1] @ direction.ravel() == pytest.approx(slope, rel=1e-6)
    change = (at(h, 0.0)[1] - at(-h, 0.0)[1]) / (2 * h)
    exact = at(0.0, 0.0)[2] @ direction.ravel()
    np.testing.assert_allclose(exact, change, atol=1e-7 * np.abs(exact).max())


def test_long_triangles_are_rounded_for_the_shape_terms() -> None:
    V = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-3, 0.0]])
    F = np.array([[0, 1, 2]], dtype=np.int32)
    true, round_ = (_core.area.SurfaceReference(V, F, *limit) for limit in ((), (4.0,)))
    np.testing.assert_allclose(true.cotan[0], [500.0, 500.0, -249.999], rtol=1e-3)
    # Edges over the area: the sum of squares is that of a triangle of aspect 4.
    assert round_.cotan.sum() == pytest.approx(np.sqrt(3.0) * (4.0 + 0.25) / 2.0, rel=1e-9)


def test_model_is_convex_and_bounded_by_nothing_but_convexity(
    glide: tuple[_core.area.GlideProblem, np.ndarray],
) -> None:
    problem, angles = glide
    value, gradient, _ = _core.testing.glide_energy(problem, 1.0, 0.1, 1.0, 1.0, angles)
    same, same_gradient, model = _core.testing.glide_energy(
        problem, 1.0, 0.1, 1.0, 1.0, angles, True
    )
    assert same == value
    np.testing.assert_array_equal(same_gradient, gradient)
    assert np.linalg.eigvalsh(model.toarray()).min() > -1e-10 * abs(model).max()


def test_finishing_energy_against_a_second_computation(
    bumpy: TriMesh, glide: tuple[_core.area.GlideProblem, np.ndarray]
) -> None:
    problem, angles = glide
    scale = _core.testing.best_scale(problem, angles)
    ratio = area_map(bumpy, finish="none", sem_iter=0).ratio
    torus = stretchmap.Torus.from_ratio(ratio, area=1.0)
    image = torus.xi(angles[:, 0], angles[:, 1])
    shares = bumpy.face_areas / bumpy.area
    weights = np.sqrt(shares) / np.sqrt(shares).sum()
    areas = TriMesh(image, bumpy.F).face_areas
    np.testing.assert_allclose(_core.testing.glide_areas(problem, angles), areas, rtol=1e-12)
    rho = areas / shares / scale
    value = _core.testing.glide_energy(problem, 1.0, 0.0, 0.0, scale, angles)[0]
    assert value == pytest.approx((weights * 0.25 * (rho - 1.0 / rho) ** 2).sum(), rel=1e-10)
    for other in (0.99 * scale, 1.01 * scale):
        assert _core.testing.glide_energy(problem, 1.0, 0.0, 0.0, other, angles)[0] > value
    jacobians = []
    for face in bumpy.F:
        p, q = bumpy.V[face], image[face]
        jacobians.append(_singular_values(p, q))
    s1, s2 = np.array(jacobians).T
    value = _core.testing.glide_energy(problem, 0.0, 1.0, 0.0, scale, angles)[0]
    assert value == pytest.approx((weights * (0.5 * (s1 / s2 + s2 / s1) - 1.0)).sum(), rel=1e-9)


def _singular_values(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Of the affine map between two triangles in space."""

    def flat(t: np.ndarray) -> np.ndarray:
        return np.linalg.qr(np.column_stack([t[1] - t[0], t[2] - t[0]]))[1]

    return np.linalg.svd(flat(q) @ np.linalg.inv(flat(p)), compute_uv=False)


def _squared_stretches(mesh: TriMesh, image: np.ndarray) -> np.ndarray:
    """Squares of the singular values (m, 2) of the faces' maps, areas scaled to total one."""
    scale = mesh.area / TriMesh(image, mesh.F).area
    pairs = zip(mesh.V[mesh.F], image[mesh.F], strict=True)
    return np.array([scale * _singular_values(p, q) ** 2 for p, q in pairs])


def test_candidates_are_rated_like_their_images(bumpy: TriMesh) -> None:
    conformal = conformal_map(bumpy)
    reference = _core.area.SurfaceReference(bumpy.V, bumpy.F)
    # more than fit into one vector of the processor, and not a multiple
    candidates = np.column_stack(
        [np.linspace(-0.45, 0.6, 11), np.tile([1.5, 2.2, 5.0, 1.1], 3)[:11]]
    )
    rated = _core.area.phase_energies(reference, bumpy.F, conformal.turns, candidates)
    for (phase, ratio), energy in zip(candidates, rated, strict=True):
        u, shifted = 2.0 * np.pi * (conformal.turns + np.array([0.0, phase])).T
        v = _core.area.angle_from_equal_area(shifted, 1.0 / ratio)
        image = Torus.from_ratio(ratio, area=1.0).xi(u, v)
        squares = _squared_stretches(bumpy, image)
        shares = bumpy.face_areas / bumpy.area
        exact = 0.25 * (shares[:, None] * (squares + 1.0 / squares)).sum()
        assert energy == pytest.approx(exact, rel=1e-6)


def test_mean_angle_distortion_against_singular_values(bumpy: TriMesh) -> None:
    reference = _core.area.SurfaceReference(bumpy.V, bumpy.F)
    image = bumpy.V * (1.0, 2.0, 0.5) + np.sin(bumpy.V[:, ::-1])
    s1, s2 = np.sqrt(_squared_stretches(bumpy, image)).T
    shares = bumpy.face_areas / bumpy.area
    found = _core.testing.mean_angle_distortion(reference, bumpy.F, image)
    assert found == pytest.approx((shares * 0.5 * (s1 / s2 + s2 / s1)).sum(), rel=1e-12)
    assert found > 1.1
    similar = _core.testing.mean_angle_distortion(reference, bumpy.F, 2.0 * bumpy.V)
    assert similar == pytest.approx(1.0, abs=1e-12)


def test_a_candidate_with_a_flat_face_is_rated_last(bumpy: TriMesh) -> None:
    reference = _core.area.SurfaceReference(bumpy.V, bumpy.F)
    turns = conformal_map(bumpy).turns.copy()
    turns[bumpy.F[0]] = turns[bumpy.F[0, 0]]
    rated = _core.area.phase_energies(reference, bumpy.F, turns, np.array([[0.0, 2.0], [0.5, 3.0]]))
    np.testing.assert_array_equal(rated, np.inf)


def test_newton_refuses_a_start_with_flips(
    glide: tuple[_core.area.GlideProblem, np.ndarray],
) -> None:
    problem, angles = glide
    with pytest.raises(SolverError, match="flipped") as caught:
        _core.area.SurfaceNewton(problem, angles[:, ::-1].copy())
    assert len(caught.value.ids) > 0
