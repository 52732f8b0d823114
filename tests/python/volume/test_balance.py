"""From maps that keep shape to maps that keep volume."""

from __future__ import annotations

import pytest

import stretchmap as sm
from stretchmap.errors import OptionError

SOLID = sm.samples.bumpy_torus(1500)
STEPS = (0.0, 0.25, 0.5, 0.75, 1.0)


@pytest.fixture(scope="module")
def maps() -> dict[float, sm.volume.VolumeMap]:
    return {balance: sm.volume_map(SOLID, balance=balance) for balance in STEPS}


def test_volume_is_gained_and_shape_lost_step_by_step(maps):
    spread = [maps[b].distortion.element_std for b in STEPS]
    angle = [maps[b].distortion.angle_mean for b in STEPS]
    assert spread == sorted(spread, reverse=True) and spread[0] > 2.0 * spread[-1]
    assert angle == sorted(angle) and angle[-1] > 1.02 * angle[0]
    assert all(found.certificate.certified and found.converged for found in maps.values())


def test_full_balance_is_the_default(maps):
    assert (maps[1.0].image == sm.volume_map(SOLID).image).all()


def test_held_boundaries_are_balanced_too():
    shape = sm.volume_map(SOLID, balance=0.0, boundary="frozen")
    volume = sm.volume_map(SOLID, boundary="frozen")
    assert shape.distortion.angle_mean < volume.distortion.angle_mean
    assert shape.distortion.element_std > volume.distortion.element_std


def test_at_the_end_of_shape_no_part_grows_for_the_sake_of_angles():
    """Parts of a grid in the image that grew are small where they came from."""
    solid = sm.samples.vertebra_like(4000)

    def by_weight(weight):
        options = sm.VolumeOptions(volume_weight=weight, target_iter=0, shift_iter=0)
        return sm.volume_map(solid, options=options).distortion

    shape, angles, half = (
        sm.volume_map(solid, balance=0.0).distortion,
        by_weight(0.01),
        by_weight(10),
    )
    assert angles.angle_mean < shape.angle_mean < half.angle_mean
    assert shape.ratio_max < 0.9 * half.ratio_max and shape.ratio_max < 0.3 * angles.ratio_max


def test_ratios_that_are_free_cost_nothing():
    """All of them: what is left is the shape, as if volumes hardly counted."""

    def angle(**options):
        given = sm.VolumeOptions(target_iter=0, shift_iter=0, frozen_tol=1e-5, **options)
        return sm.volume_map(SOLID, boundary="frozen", options=given).distortion.angle_mean

    free = angle(volume_weight=100.0, free_ratios=(1e-9, 1e9))
    assert free == pytest.approx(angle(volume_weight=1e-6), rel=2e-3)
    assert angle(volume_weight=100.0) > 1.01 * free


@pytest.mark.parametrize("pair", [(1.1, 2.0), (0.5, 0.9), (-0.1, 2.0), (0.5,), 1.0, (0.5, "a")])
def test_free_ratios_are_a_range_round_one(pair):
    with pytest.raises(OptionError, match="free_ratios"):
        sm.VolumeOptions(free_ratios=pair)


def test_areas_are_balanced():
    surface = sm.samples.vertebra_like(2000).surface
    found = [sm.area_map(surface, balance=b, keep_best=True) for b in (0.0, 0.3)]
    spread = [result.distortion.element_std for result in found]
    angle = [result.distortion.angle_mean for result in found]
    assert spread[0] > 2.0 * spread[1] and angle[0] < angle[1]
    assert all(result.converged for result in found)
    assert all(result.certificate.certified for result in found)


@pytest.mark.parametrize("balance", [-0.1, 1.1, float("nan"), "half", [0.5]])
def test_other_values_are_refused(balance):
    with pytest.raises(OptionError, match="balance"):
        sm.volume_map(SOLID, balance=balance)
    with pytest.raises(OptionError, match="balance"):
        sm.area_map(SOLID.surface, balance=balance)


def test_one_way_of_asking_at_a_time():
    with pytest.raises(OptionError, match="certified"):
        sm.volume_map(SOLID, c=1.0, balance=0.5)
    with pytest.raises(OptionError, match="not both"):
        sm.volume_map(SOLID, balance=0.5, options=sm.VolumeOptions(volume_weight=2.0))
    with pytest.raises(OptionError, match="not both"):
        sm.volume_map(SOLID, balance=0.5, options=sm.VolumeOptions(free_ratios=(0.5, 2.0)))
    with pytest.raises(OptionError, match="no target_iter, marginal_tol"):
        levels = sm.VolumeOptions(target_iter=20, marginal_tol=1e-5)
        sm.volume_map(SOLID, balance=0.5, options=levels)


def test_the_picture_shows_every_map(maps):
    pytest.importorskip("matplotlib")
    axes = sm.plot.tradeoff(maps).axes[0]
    assert len(axes.lines[0].get_xdata()) == len(STEPS)
    assert {text.get_text() for text in axes.texts} == {f"{b:g}" for b in STEPS}
    with pytest.raises(OptionError, match="two or more"):
        sm.plot.tradeoff({1.0: maps[1.0]})
    for key in (None, "a"):
        with pytest.raises(OptionError, match="a key of maps must be a finite number"):
            sm.plot.tradeoff({key: maps[1.0], 1: maps[1.0]})
