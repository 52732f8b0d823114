"""What is asked of volumes where a boundary glides on a mesh: their share, and what they miss."""

from __future__ import annotations

import pytest

import stretchmap as sm
from stretchmap.volume.glide_targets import GlideTargets
from stretchmap.volume.options import FillOptions
from stretchmap.volume.problem import VolumeProblem


@pytest.fixture(scope="module")
def model():
    solid = sm.samples.solid_torus(600)
    ground = solid.surface
    problem = VolumeProblem.of(solid, solid.surface.V, ground=ground, refine=None)
    return problem.model(FillOptions())


@pytest.fixture
def swollen(model):
    """The image with what lies on one side of the middle swollen: (n, 3)."""
    x = model.V.copy()
    x[x[:, 0] > 0.0, 0] *= 1.2
    return x


def test_targets_are_renewed_as_the_volume_enclosed_or_what_is_missing_changes(model, swollen):
    targets = GlideTargets(model)
    asked = targets.renewed(model.V)
    assert asked is not None and targets.renewed(model.V) is None
    assert targets.renewed(swollen) is not None and targets.renewed(swollen) is None
    targets.learn(swollen)
    assert targets.renewed(swollen) is not None


def test_what_is_missing_is_asked_for_on_top(model, swollen):
    targets = GlideTargets(model)
    before = targets.renewed(swollen)
    targets.learn(swollen)
    more = targets.renewed(swollen) / before
    ratios = model.ring_ratios(swollen)[model.T]
    assert (more[(ratios > 1.0).all(axis=1)] < 1.0).all()
    assert (more[(ratios < 1.0).all(axis=1)] > 1.0).all()
    # All that is asked for is still what there is.
    assert model.shares @ (more * before) == pytest.approx(model.shares @ before, rel=1e-2)
    for _ in range(200):
        targets.learn(swollen)
    most = targets.renewed(swollen) / before
    assert most.max() / most.min() < 9.0 + 1e-9


def test_the_best_is_kept_and_no_progress_is_seen(model, swollen):
    targets = GlideTargets(model)
    targets.learn(swollen)
    assert targets.best is swollen
    half = 0.5 * (swollen + model.V)
    targets.learn(half)
    assert targets.best is half and not targets.stalled
    for _ in range(29):
        targets.learn(swollen)
    assert not targets.stalled
    targets.learn(swollen)
    assert targets.stalled and targets.best is half


def test_misfit_is_what_distortion_says(model, swollen):
    solid = sm.TetMesh(model.V, model.T)
    found = sm.distortion(solid, swollen)
    assert model.misfit(swollen) == pytest.approx((found.ring_std, found.total_distortion))
    assert model.misfit(model.V) == pytest.approx((0.0, 0.0), abs=1e-12)
