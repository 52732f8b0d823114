"""Area map: derivatives, identities, exact cases, invariance, thresholds on real surfaces."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
import pytest

import stretchmap
from stretchmap import Torus, TriMesh, _core, area_map
from stretchmap.conformal.map import conformal_map
from stretchmap.errors import GenusError, OptionError, SolverError
from stretchmap.maps.files import load_map

TWO_PI = 2.0 * np.pi


def torus_grid(nu: int, nv: int, ratio: float, seed: int | None = None) -> TriMesh:
    """Torus of revolution sampled evenly in the equal-area coordinates (u, s)."""
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    u, s = TWO_PI * i.ravel() / nu, TWO_PI * j.ravel() / nv
    v = _core.area.angle_from_equal_area(s, 1.0 / ratio)
    points = stretchmap.Torus(ratio, 1.0).xi(u, v)
    a, b = i.ravel() * nv + j.ravel(), ((i.ravel() + 1) % nu) * nv + j.ravel()
    c = ((i.ravel() + 1) % nu) * nv + (j.ravel() + 1) % nv
    d = i.ravel() * nv + (j.ravel() + 1) % nv
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    if seed is not None:
        order = np.random.default_rng(seed).permutation(len(points))
        inverse = np.argsort(order)
        points, faces = points[order], inverse[faces]
    return TriMesh(points, faces)


@pytest.fixture(scope="module")
def bumpy() -> TriMesh:
    """A small bumpy torus with uneven triangles."""
    mesh = torus_grid(24, 16, 2.2)
    rng = np.random.default_rng(5)
    x, y, z = mesh.V.T
    bump = 1.0 + 0.25 * np.sin(3.0 * np.arctan2(y, x)) * np.cos(2.0 * z) + 0.02 * rng.random(len(x))
    return TriMesh(mesh.V * bump[:, None], mesh.F)


@pytest.fixture(scope="module")
def chart(bumpy: TriMesh) -> _core.area.SurfaceChart:
    return _core.area.SurfaceChart(bumpy.topology, conformal_map(bumpy).forms)


@pytest.fixture(scope="module")
def turns(bumpy: TriMesh) -> np.ndarray:
    rng = np.random.default_rng(1)
    conformal = conformal_map(bumpy)
    return conformal.turns + 1e-3 * rng.normal(size=conformal.turns.shape)


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


@pytest.fixture(scope="module")
def glide(
    bumpy: TriMesh, chart: _core.area.SurfaceChart
) -> tuple[_core.area.GlideProblem, np.ndarray]:
    rng = np.random.default_rng(2)
    result = area_map(bumpy, finish="none", sem_iter=2)
    reference = _core.area.SurfaceReference(bumpy.V, bumpy.F)
    angles = result.angles + 5e-3 * rng.normal(size=result.angles.shape)
    return _core.area.GlideProblem(chart, reference, result.ratio), angles


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


STAGES = ("sem", "balance", "untangle", "newton")


def pinched(seed: int) -> TriMesh:
    """A torus turned inside out about a point close to it: a big body with a small hole."""
    rng = np.random.default_rng(seed)
    mesh = stretchmap.samples.torus_surface(40, 28, 2.0, 1.0)
    away = mesh.V - [3.6, *rng.uniform(-0.2, 0.2, size=2)]
    return TriMesh(away / (away**2).sum(axis=1)[:, None], mesh.F, orient=True)


@pytest.mark.parametrize("seed", [0, 1])
def test_small_handles_are_balanced_and_certified(seed: int) -> None:
    mesh = pinched(seed)
    chart_areas = conformal_map(mesh).chart_areas * mesh.area / mesh.face_areas
    assert chart_areas.max() > 1e3 * chart_areas.min()
    result = area_map(mesh, finish="face", max_iter=15)
    stages = {stage: [r for r in result.history if r.stage == stage] for stage in STAGES}
    assert stages["sem"][-1].energy > 1.01
    assert stages["balance"][-1].element_std < stages["sem"][0].element_std / 5.0
    assert result.certificate.certified
    assert result.distortion.flips == 0
    assert result.distortion.element_std <= 0.3


def test_balancing_starts_only_from_charts_without_folds(bumpy: TriMesh) -> None:
    conformal = conformal_map(bumpy)
    chart = _core.area.SurfaceChart(bumpy.topology, conformal.forms)
    reference = _core.area.SurfaceReference(bumpy.V, bumpy.F)
    with pytest.raises(SolverError, match="folded") as caught:
        _core.area.ChartNewton(chart, reference, conformal.aspect, conformal.turns[:, ::-1].copy())
    assert len(caught.value.ids) > 0
    newton = _core.area.ChartNewton(chart, reference, conformal.aspect, conformal.turns)
    taken = newton.step(1.0, 0.1, 4.0)
    assert taken.step > 0.0 and taken.after < taken.before


def test_long_triangles_are_rounded_for_the_shape_terms() -> None:
    V = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-3, 0.0]])
    F = np.array([[0, 1, 2]], dtype=np.int32)
    true, round_ = (_core.area.SurfaceReference(V, F, *limit) for limit in ((), (4.0,)))
    np.testing.assert_allclose(true.cotan[0], [500.0, 500.0, -249.999], rtol=1e-3)
    # Edges over the area: the sum of squares is that of a triangle of aspect 4.
    assert round_.cotan.sum() == pytest.approx(np.sqrt(3.0) * (4.0 + 0.25) / 2.0, rel=1e-9)


def test_a_basis_or_map_of_another_surface_is_refused(bumpy: TriMesh) -> None:
    other = TriMesh(bumpy.V * [1.0, 1.0, 2.0], bumpy.F)
    basis = stretchmap.homology_basis(other)
    for call in (
        lambda: stretchmap.harmonic_forms(bumpy, basis),
        lambda: stretchmap.holomorphic_forms(bumpy, basis),
        lambda: conformal_map(bumpy, basis=basis),
        lambda: area_map(bumpy, basis=basis),
        lambda: area_map(bumpy, conformal=conformal_map(other, basis=basis)),
    ):
        with pytest.raises(stretchmap.errors.KindError, match="of another surface"):
            call()
    solid = stretchmap.samples.solid_torus(600)
    with pytest.raises(stretchmap.errors.KindError, match="of another surface"):
        stretchmap.volume_map(solid, start=area_map(bumpy, finish="none"))


def test_folds_are_refused_or_kept_on_request(bumpy: TriMesh) -> None:
    coarse = stretchmap.samples.torus_surface(3, 3, 1.05, 1.0)
    try:
        kept = area_map(coarse)
    except stretchmap.errors.CertificationError as error:
        assert error.ids
        kept = area_map(coarse, keep_best=True)
        assert not kept.certificate.certified
    else:
        assert kept.certificate.certified
    assert kept.to_dict()["certified"] == kept.certificate.certified


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
    assert value == pytest.approx((weights * (rho + 1.0 / rho - 2.0)).sum(), rel=1e-10)
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


def test_candidates_are_rated_like_their_images(bumpy: TriMesh) -> None:
    conformal = conformal_map(bumpy)
    reference = _core.area.SurfaceReference(bumpy.V, bumpy.F)
    candidates = np.array([[0.0, 1.5], [0.3, 2.2], [-0.45, 5.0]])
    rated = _core.area.phase_qualities(reference, bumpy.F, conformal.turns, candidates)
    for (phase, ratio), quality in zip(candidates, rated, strict=True):
        u, shifted = 2.0 * np.pi * (conformal.turns + np.array([0.0, phase])).T
        v = _core.area.angle_from_equal_area(shifted, 1.0 / ratio)
        image = Torus.from_ratio(ratio, area=1.0).xi(u, v)
        exact = _core.testing.surface_quality(reference, bumpy.F, image)
        assert quality.energy == pytest.approx(exact.energy, rel=1e-4)
        assert quality.angle_mean == pytest.approx(exact.angle_mean, rel=1e-4)
    similar = _core.testing.surface_quality(reference, bumpy.F, 2.0 * bumpy.V)
    assert similar.energy == pytest.approx(1.0, abs=1e-12)
    assert similar.angle_max == pytest.approx(1.0, abs=1e-7)
    assert similar.face_std < 1e-12


def test_newton_refuses_a_start_with_flips(
    glide: tuple[_core.area.GlideProblem, np.ndarray],
) -> None:
    problem, angles = glide
    with pytest.raises(SolverError, match="flipped") as caught:
        _core.area.SurfaceNewton(problem, angles[:, ::-1].copy())
    assert len(caught.value.ids) > 0


# --- the map ------------------------------------------------------------------------------------


def test_equal_area_torus_is_a_fixed_point() -> None:
    ratio = 2.5
    mesh = torus_grid(60, 36, ratio, seed=3)
    chart = _core.area.SurfaceChart(mesh.topology, conformal_map(mesh).forms)
    u, v, _ = stretchmap.Torus(ratio, 1.0).coordinates(mesh.V)
    s = _core.testing.equal_area_from_angle(v, 1.0 / ratio)
    turns = _lift(mesh, chart, np.column_stack([u, s]) / TWO_PI)
    sem = _core.area.SurfaceSem(chart, np.full(len(mesh.F), 1.0), ratio, turns)
    start = sem.measures()
    assert start.energy == pytest.approx(1.0, abs=1e-12)
    assert start.ring_std < 1e-12
    sem.step()
    np.testing.assert_allclose(sem.turns - sem.turns[0], turns - turns[0], atol=1e-9)


def _lift(mesh: TriMesh, chart: _core.area.SurfaceChart, turns: np.ndarray) -> np.ndarray:
    """Whole turns added so that the corners of every face fit together under the chart's shifts."""
    shift = np.stack([chart.shift_u, chart.shift_v], axis=2)
    lifted, seen, stack = turns.copy(), np.zeros(len(turns), bool), [0]
    seen[0] = True
    neighbors: dict[int, list[tuple[int, np.ndarray]]] = {}
    for face, offsets in zip(mesh.F, shift, strict=True):
        for k in range(3):
            a, b = k, (k + 1) % 3
            neighbors.setdefault(face[a], []).append((face[b], offsets[b] - offsets[a]))
    while stack:
        i = stack.pop()
        for j, jump in neighbors[i]:
            if not seen[j]:
                lifted[j] += np.round(lifted[i] - (lifted[j] + jump))
                seen[j] = True
                stack.append(j)
    return lifted


def test_history_records_and_falls(bumpy: TriMesh) -> None:
    result = area_map(bumpy)
    for stage in ("sem", "newton"):
        records = [record for record in result.history if record.stage == stage]
        energies = np.array([record.energy for record in records])
        energies = energies[np.isfinite(energies)]
        assert len(energies) > 2
        assert (np.diff(energies) <= 1e-12 * energies[:-1]).all()
        assert all(record.flips == 0 for record in records)
    assert result.distortion.flips == 0
    assert result.history[-1].ring_std == pytest.approx(result.distortion.ring_std, abs=1e-9)
    assert result.history[-1].element_std == pytest.approx(result.distortion.element_std, rel=1e-6)


def test_image_is_on_the_torus_of_the_same_area(bumpy: TriMesh) -> None:
    result = area_map(bumpy)
    assert result.torus.area == pytest.approx(bumpy.area, rel=1e-12)
    _, _, distance = result.torus.coordinates(result.image)
    np.testing.assert_allclose(distance, result.torus.r, rtol=1e-12)
    larger = result.image_on(result.torus.scaled(2.0))
    np.testing.assert_allclose(larger, 2.0 * result.image, atol=1e-12)
    with pytest.raises(OptionError):
        result.image_on(stretchmap.Torus(result.torus.R * 1.1, result.torus.r))


def test_phase_and_ratio_can_be_fixed(bumpy: TriMesh) -> None:
    searched = area_map(bumpy, finish="none")
    given = area_map(bumpy, finish="none", phase=searched.phase, ratio=searched.ratio)
    np.testing.assert_allclose(given.angles, searched.angles, atol=1e-12)
    shifted = area_map(bumpy, finish="none", phase=searched.phase + 0.5)
    assert shifted.phase == searched.phase + 0.5
    assert shifted.distortion.angle_mean > searched.distortion.angle_mean
    free = area_map(bumpy, finish="none", ratio="search")
    assert free.ratio != searched.ratio
    torus = stretchmap.Torus(5.0, 2.0)
    onto = area_map(bumpy, finish="none", torus=torus)
    assert onto.torus == torus and onto.ratio == torus.ratio


def test_invariant_under_rotation_and_scale(bumpy: TriMesh) -> None:
    rotation = np.linalg.qr(np.random.default_rng(11).normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    a, b = area_map(bumpy), area_map(TriMesh(7.0 * bumpy.V @ rotation.T, bumpy.F))
    np.testing.assert_allclose(b.angles, a.angles, atol=1e-5)
    assert b.torus.area == pytest.approx(49.0 * a.torus.area, rel=1e-12)


def test_invariant_under_renumbering(bumpy: TriMesh) -> None:
    rng = np.random.default_rng(11)
    order = rng.permutation(len(bumpy.V))
    faces = np.argsort(order)[bumpy.F[rng.permutation(len(bumpy.F))]]
    other = TriMesh(bumpy.V[order], faces)
    a = area_map(bumpy, phase=0.1)
    # The origin of v and the common sign of u and v belong to the numbering: bring them along.
    start = area_map(bumpy, finish="none", phase=0.1).angles[order, 1]
    first = area_map(other, finish="none", phase=0.0).angles[:, 1]
    s_a, s_b = (_core.testing.equal_area_from_angle(v, 1.0 / a.ratio) for v in (start, first))
    shift = min(
        (np.angle(np.exp(1j * (sign * s_a - s_b))) for sign in (1.0, -1.0)),
        key=lambda x: np.abs(np.exp(1j * x) - np.exp(1j * x[0])).max(),
    )
    np.testing.assert_allclose(np.exp(1j * shift), np.exp(1j * shift[0]), atol=1e-8)
    b = area_map(other, phase=float(shift[0] / TWO_PI))
    np.testing.assert_allclose(b.distortion.ratios.std(), a.distortion.ratios.std(), rtol=1e-3)
    assert b.distortion.angle_mean == pytest.approx(a.distortion.angle_mean, rel=1e-6)


def test_same_input_same_bits(bumpy: TriMesh) -> None:
    np.testing.assert_array_equal(area_map(bumpy).angles, area_map(bumpy).angles)


@pytest.mark.parametrize(
    ("name", "ring", "face", "angle"),
    [
        ("bob", 1e-6, 5e-3, 2.2),
        ("rocker_arm_small", 2e-2, 2e-2, 3.0),
        ("knot_8000", 1e-6, 5e-3, 2.0),
    ],
)
def test_real_surfaces(load_surface, name: str, ring: float, face: float, angle: float) -> None:
    result = area_map(load_surface(name))
    d = result.distortion
    assert d.flips == 0
    assert d.ring_std <= ring
    assert d.element_std <= face
    assert d.total_distortion <= 1e-3
    assert d.angle_mean <= angle


def test_non_convergence_is_said_once(load_surface, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        result = area_map(load_surface("bob_small"), max_iter=1, finish="face")
    assert not result.converged
    assert "most steps done" in result.stop_reason
    assert len(caplog.records) == 1


def test_start_with_flips_is_replaced(bumpy: TriMesh) -> None:
    conformal = conformal_map(bumpy)
    rng = np.random.default_rng(4)
    broken = conformal.turns + 0.1 * rng.normal(size=conformal.turns.shape)
    chart = _core.area.SurfaceChart(bumpy.topology, conformal.forms)
    assert (_core.area.turn_areas(chart, broken) <= 0.0).any()
    result = area_map(bumpy, conformal=dataclasses.replace(conformal, turns=broken))
    assert result.history[0].flips == 0
    assert result.distortion.flips == 0


def test_saved_map_comes_back(bumpy: TriMesh, tmp_path) -> None:
    result = area_map(bumpy, finish="none")
    result.save(tmp_path / "map.npz")
    back = load_map(tmp_path / "map.npz")
    np.testing.assert_array_equal(back.image, result.image)
    np.testing.assert_array_equal(back.arrays["angles"], result.angles)
    assert back.meta["phase"] == result.phase
    assert "ring std" in result.summary()


@pytest.mark.parametrize(
    "options",
    [
        {"ratio": "best"},
        {"ratio": 1.0},
        {"phase": np.nan},
        {"finish": "all"},
        {"max_iter": -1},
        {"tol": 0.0},
        {"shape_budget": 0.5},
        {"sem_iter": -1},
        {"torus": stretchmap.Torus(2.0, 1.0), "ratio": 2.0},
    ],
)
def test_options_out_of_range(bumpy: TriMesh, options: dict) -> None:
    with pytest.raises(OptionError):
        area_map(bumpy, **options)


def test_sphere_is_refused() -> None:
    octahedron = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    with pytest.raises(GenusError):
        area_map(TriMesh(octahedron, faces))
