"""Area map: exact cases, invariance, thresholds on real surfaces."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
import pytest

import stretchmap
from shapes import torus_grid
from stretchmap import TriMesh, _core, area_map
from stretchmap.conformal.map import conformal_map
from stretchmap.errors import GenusError, OptionError, SolverError
from stretchmap.maps.files import load_map

TWO_PI = 2.0 * np.pi
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
        {"ratio": 1.1e6},
        {"torus": stretchmap.Torus(1.0, 1e-7)},
        {"phase": np.nan},
        {"finish": "all"},
        {"max_iter": -1},
        {"tol": 0.0},
        {"shape_budget": 0.5},
        {"sem_iter": -1},
        {"torus": stretchmap.Torus(2.0, 1.0), "ratio": 2.0},
        {"finish": "none", "balance": 0.5},
    ],
)
def test_options_out_of_range(bumpy: TriMesh, options: dict) -> None:
    with pytest.raises(OptionError):
        area_map(bumpy, **options)


@pytest.mark.parametrize("ratio", [1.0 + 1e-15, 1.001, 1e3, 1e6])
def test_the_thinnest_and_the_thickest_torus_hold_their_maps(bumpy: TriMesh, ratio: float) -> None:
    result = area_map(bumpy, ratio=ratio, finish="none")
    assert result.certificate.checks["on_torus"] and result.ratio == pytest.approx(ratio, rel=1e-12)


def test_a_chart_has_converged_where_its_energy_is_at_rest(bumpy: TriMesh, caplog) -> None:
    for sem_iter in (0, 1):
        result = area_map(bumpy, finish="none", sem_iter=sem_iter)
        assert not result.converged and f"after step {sem_iter}" in result.stop_reason
        assert result.stop_reason in caplog.text
    caplog.clear()
    result = area_map(bumpy, finish="none", sem_iter=100)
    before, last = (record.energy for record in result.history[-2:])
    assert result.converged and 0.0 <= before - last <= 1e-4 * last and not caplog.text


def test_sphere_is_refused() -> None:
    octahedron = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    with pytest.raises(GenusError):
        area_map(TriMesh(octahedron, faces))
