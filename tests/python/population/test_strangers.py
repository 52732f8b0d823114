"""Shapes that do not belong as they are: mirror images, and others in another unit."""

from __future__ import annotations

import itertools
import logging

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.deformation import pose
from stretchmap.deformation.fitting import Anchors, Template
from stretchmap.deformation.pose import looks_mirrored, rigid_poses
from stretchmap.errors import LandmarkError
from stretchmap.population import correspond

SIDES = np.array([-1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def bones():
    return sm.samples.vertebra_population(4, seed=5, n_tets=600)


def twisted(bones, i, turn=0.8):
    """An individual unlike its mirror image: turned about the first axis of the material."""
    x = bones.material[i]
    angle = turn * x[:, 0] / np.ptp(x[:, 0])
    c, s = np.cos(angle), np.sin(angle)
    points = np.stack([x[:, 0], c * x[:, 1] - s * x[:, 2], s * x[:, 1] + c * x[:, 2]], axis=1)
    return sm.TetMesh(bones.place(i, points), bones.solids[i].T)


def mirrored(solid):
    return sm.TetMesh(solid.V * SIDES, solid.T, orient=True)


def test_a_mirror_image_is_told_from_the_others(bones):
    solids = [twisted(bones, i) for i in range(3)]
    for one, other in itertools.combinations(solids, 2):
        assert not looks_mirrored(one.surface, other.surface)
        assert looks_mirrored(one.surface, mirrored(other).surface)


def test_poses_are_searched_once_for_what_is_asked_of_the_same_surfaces(bones, monkeypatch):
    one, other, third = (solid.surface for solid in bones.solids[:3])
    improved, steps = pose._improved, []

    def counted(*given):
        steps.append(len(given))
        return improved(*given)

    monkeypatch.setattr(pose, "_improved", counted)
    monkeypatch.setattr(pose, "_ranked", pose._ranked.__wrapped__)  # that of the package
    pose._ranked.cache_clear()
    found = rigid_poses(one, other)
    once = len(steps)
    looks_mirrored(one, other)  # the mirror image is new
    assert once > 0 and len(steps) == 2 * once
    rigid_poses(one, third)  # others are not taken for them
    again = rigid_poses(one, other)
    assert len(steps) == 4 * once
    for before, after in zip(found, again, strict=True):
        assert (before.rotation == after.rotation).all()
        assert (before.shift == after.shift).all()


def test_where_there_is_no_side_none_is_wrong(bones):
    for one, other in itertools.combinations(bones.solids[:3], 2):
        assert not looks_mirrored(one.surface, other.surface)
    assert not looks_mirrored(one.surface, one.surface)


def test_doubts_are_told_and_the_rest_goes_on(bones, caplog):
    solids = {f"bone {i}": twisted(bones, i) for i in range(4)}
    solids["bone 2"] = mirrored(solids["bone 2"])
    odd = solids["bone 3"]
    solids["bone 3"] = sm.TetMesh(1e-3 * odd.V, odd.T)
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        found = sm.population.fit(solids, max_rounds=2, tol=0.0)
    assert found.names == tuple(solids)
    assert set(found.doubts) == {"bone 2", "bone 3"}
    assert "mirror" in found.doubts["bone 2"] and "unit" not in found.doubts["bone 2"]
    assert "small as the median" in found.doubts["bone 3"]
    assert found.to_dict()["doubts"] == found.doubts and "bone 2, bone 3" in found.summary()
    told = [r.message for r in caplog.records if r.message.startswith("bone 2: ")]
    assert len(told) == 1 and "orient=True" in told[0]


def test_landmarks_of_a_mirror_image_are_refused(bones):
    marks = [bones.landmarks[0], bones.landmarks[1], bones.landmarks[2] * SIDES]
    solids = [*bones.solids[:2], mirrored(bones.solids[2])]
    found = sm.population.fit(solids, landmarks=marks, max_rounds=1, tol=1.0)
    assert found.names == ("0", "1") and "mirror" in found.skipped["2"]


def test_register_says_what_folded_landmarks_have_in_common(bones, caplog):
    pair = bones.solids[0], mirrored(bones.solids[1])
    marks = bones.landmarks[0], bones.landmarks[1] * SIDES
    with (
        caplog.at_level(logging.WARNING, logger="stretchmap"),
        pytest.raises(LandmarkError, match=r"cannot be reached.*mirror image"),
    ):
        sm.register(*pair, marks)
    assert "mirror image" in caplog.text
    caplog.clear()
    sm.register(bones.solids[0], bones.solids[0], (marks[0], marks[0]))
    assert "mirror" not in caplog.text


@pytest.mark.parametrize(("factor", "held"), [(1e-9, False), (1e-3, True), (1e3, False)])
def test_the_unit_of_either_does_not_matter(bones, factor, held):
    def map_of(first, second):
        anchors = Anchors.of(one.surface, bones.landmarks[0]) if held else None
        source = Template(sm.TetMesh(first * one.V, one.T), anchors)
        marks = second * bones.landmarks[1] if held else None
        target = sm.TetMesh(second * other.V, other.T)
        return correspond(source, target, landmarks=marks)

    one, other = bones.solids[:2]
    wanted, found = map_of(1.0, 1.0), map_of(1.0 / factor, factor)
    assert found.along == wanted.along == "smooth"
    size = np.abs(wanted.image).max()
    np.testing.assert_allclose(found.image / factor, wanted.image, atol=1e-6 * size)
