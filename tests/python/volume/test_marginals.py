"""Volumes between level surfaces: shifts and targets against a known distortion and exact cuts."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import _core, samples
from stretchmap.base.budget import Budget
from stretchmap.volume.equalize import equalize, gently_moved
from stretchmap.volume.marginals import Marginals
from stretchmap.volume.model import History
from stretchmap.volume.options import VolumeOptions
from stretchmap.volume.problem import VolumeProblem

TORUS = sm.Torus(3.0, 1.0)


@pytest.fixture(scope="module")
def solid():
    return samples.solid_torus(60_000, R=3.0, r=1.0)


def marginals(solid, held=False):
    shares = solid.tet_volumes / solid.volume
    return Marginals(solid.T, shares, solid.boundary_vertices, TORUS, held=held)


def distorted(solid, axis):
    """The source moved by a smooth function of one coordinate."""
    u, v, s = TORUS.coordinates(solid.V)
    if axis == "s":
        return TORUS.xi(u, v, s * (1.0 + 0.05 * (1.0 - s)))
    if axis == "u":
        return TORUS.xi(u + 0.03 * np.sin(u), v, s)
    return TORUS.xi(u, v + 0.03 * np.sin(2.0 * v), s)


@pytest.mark.parametrize("axis", ["s", "u", "v"])
def test_a_known_shift_along_one_coordinate_is_undone(solid, axis):
    tool = marginals(solid)
    moved = distorted(solid, axis)
    first = tool.error(tool.measure(moved))
    back = moved
    for _ in range(4):
        back = tool.shifted(back)
    assert first > 0.004
    assert tool.error(tool.measure(back)) < 0.05 * first
    # The constant of a turn is free, and the mean of the levels' shifts is not that of the volume.
    before = np.linalg.norm(moved - solid.V, axis=1).max()
    assert np.linalg.norm(back - solid.V, axis=1).max() < 0.25 * before


def test_error_of_a_turn_is_what_the_shift_says(solid):
    """u + 0.03 sin u moves the share 0.03 sin(u) / (2 pi) of the volume past the level u."""
    tool = marginals(solid)
    assert tool.error(tool.measure(distorted(solid, "u"))) == pytest.approx(
        0.03 / (2.0 * np.pi), rel=0.05
    )


def test_the_torus_is_mapped_to_itself_and_a_held_boundary_stays(solid):
    ids = solid.boundary_vertices
    moved = distorted(solid, "u")
    free = marginals(solid).shifted(moved)
    assert np.abs(TORUS.coordinates(free[ids])[2] - 1.0).max() < 1e-12
    assert np.abs(free[ids] - moved[ids]).max() > 1e-3
    moved = distorted(solid, "s")
    held = marginals(solid, held=True).shifted(moved)
    assert np.array_equal(held[ids], moved[ids])
    assert np.abs(held - moved).max() > 1e-3


@pytest.mark.parametrize("axis", ["s", "u", "v"])
def test_targets_ask_for_what_is_missing_and_add_up(solid, axis):
    """Asked of every tet, they are the image's volumes seen from the source, layer by layer."""
    tool = marginals(solid)
    moved = distorted(solid, axis)
    targets = tool.targets(tool.measure(moved))
    volumes = _core.mesh.tet_volumes(moved, solid.T)
    ratio = tool.shares / (volumes / volumes.sum())
    # Exact up to the width of a bin; the distortion is a function of one coordinate.
    assert np.corrcoef(targets, ratio)[0, 1] > 0.8
    again = tool.targets(tool.measure(moved))
    assert targets.min() > 0.8 and targets.max() < 1.25
    assert np.allclose(again, np.clip(2.0 * targets - 1.0, 0.8, 1.25), atol=1e-12)


def test_targets_are_reached_by_the_energy(solid):
    """set_targets moves the minimum: det J = 1 where the volume is the target's share."""
    V, T = solid.V, solid.T
    shares = solid.tet_volumes / solid.volume
    motion = np.ones(len(V), np.uint8)  # all fixed but one
    motion[np.setdiff1d(np.arange(len(V)), solid.boundary_vertices)[0]] = 0
    newton = _core.volume.SolidNewton(
        V, tets=T, rest=_core.volume.rest_matrices(V, T, 1e6), weights=shares, motion=motion
    )
    weights = _core.volume.EnergyWeights(0.0, 1.0, 0.0, 0.0)
    assert newton.value(V, weights).energy == pytest.approx(0.0, abs=1e-12)
    target = np.linspace(0.5, 2.0, len(T))
    newton.set_targets(target)
    det = 1.0 / target
    expected = shares @ (0.5 * (det + 1.0 / det) - 1.0)
    assert newton.value(V, weights).energy == pytest.approx(expected, rel=1e-10)
    newton.set_targets(np.ones(len(T)))
    assert newton.value(V, weights).energy == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(sm.errors.ArrayError):
        newton.set_targets(np.zeros(len(T)))


def test_uncorrected_fifths_of_a_vertebra():
    """The paper's cumulative errors for fifths, Table 7.1, are 0.06 to 0.17 per cent."""
    result = sm.volume_map(samples.vertebra_like(20_000))
    assert result.certificate.certified
    for by in "suv":
        parts = sm.partition(result, 5, by)
        assert np.abs(parts.uncorrected_errors).max() < 1e-3
        assert np.abs(parts.errors).max() < 1e-12


def test_few_tets_do_no_harm():
    small = samples.solid_torus(400, R=3.0, r=1.0)
    moved = marginals(small).shifted(small.V)
    assert (_core.mesh.tet_volumes(moved, small.T) > 0.0).all()


def test_the_histogram_counts_every_tet_at_four_points(solid):
    values = np.ascontiguousarray(TORUS.coordinates(solid.V)[2] ** 2)
    amounts = np.column_stack([solid.tet_volumes, np.ones(solid.n_tets)])
    far = (5.0 - np.sqrt(5.0)) / 20.0
    weights = np.full((4, 4), far) + np.eye(4) * (1.0 - 4.0 * far)
    bins = np.clip((values[solid.T] @ weights * 20.0).astype(int), 0, 19).ravel()
    found = _core.volume.level_histogram(solid.T, values, amounts, 20, 1.0, False)
    for column, amount in zip(found.T, amounts.T, strict=True):
        expected = np.bincount(bins, np.repeat(0.25 * amount, 4), minlength=20)
        # A point on the border of two bins may fall into either.
        assert np.abs(np.cumsum(column) - np.cumsum(expected)).max() < 1e-3 * amount.sum()
        assert column.sum() == pytest.approx(amount.sum(), rel=1e-12)


def test_equalizing_takes_no_more_than_a_fifth_of_a_tet(solid):
    moved = solid.V + np.random.default_rng(0).normal(scale=0.01, size=solid.V.shape)
    kept = gently_moved(solid.T, solid.V, moved, solid.tet_volumes)
    ratios = _core.mesh.tet_volumes(kept, solid.T) / solid.tet_volumes
    assert ratios.min() > 0.8 and ratios.max() < 1.25
    ratios = _core.mesh.tet_volumes(moved, solid.T) / solid.tet_volumes
    assert ratios.min() < 0.8 or ratios.max() > 1.25
    went = (kept != solid.V).any(axis=1)
    assert went.any() and not went.all() and np.array_equal(kept[went], moved[went])


@pytest.mark.parametrize(("seconds", "taken"), [(0.0, False), (60.0, True)])
def test_without_time_left_nothing_is_equalized(seconds, taken):
    small = samples.solid_torus(4000, R=3.0, r=1.0)
    problem = VolumeProblem.of(small, small.V[small.boundary_vertices], torus=TORUS)
    model, moved = problem.model(VolumeOptions()), distorted(small, "s")
    history = History(model, Budget(seconds))
    found = equalize(model, moved, history, VolumeOptions(), glide=False, newton=None)
    assert (len(history.records) > 0) == taken
    assert np.array_equal(found, moved) != taken


def test_equalizing_does_not_hold_back_what_still_moves():
    """A dent the minimizer had not yet smoothed out goes, by steps of any size."""
    small = samples.solid_torus(12_000, R=3.0, r=1.0)
    problem = VolumeProblem.of(small, small.V[small.boundary_vertices], torus=TORUS)
    model = problem.model(VolumeOptions())
    middle = np.abs(small.V - [3.0, 0.0, 0.0]).sum(axis=1).argmin()
    away = model.V - model.V[middle]
    size = 0.6 * problem.torus.r
    moved = model.V + 0.35 * np.exp(-((away / size) ** 2).sum(axis=1))[:, None] * away
    moved[model.boundary] = model.V[model.boundary]

    def off(x):
        volumes = [_core.mesh.tet_volumes(at, small.T) for at in (x, model.V)]
        return np.abs(volumes[0] / volumes[1] - 1.0)

    assert (_core.mesh.tet_volumes(moved, small.T) > 0.0).all() and off(moved).max() > 0.4
    history = History(model, Budget(60.0))
    found = equalize(model, moved, history, VolumeOptions(), glide=False, newton=None)
    assert off(found).max() < 0.1
    assert off(found).mean() < 0.6 * off(moved).mean()
