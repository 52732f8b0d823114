"""Poses taken out: exactly, without reflections, linear variation staying linear."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stretchmap.deformation.similarity import similarity_onto
from stretchmap.errors import ArrayError, DegenerateError, NonFiniteError, OptionError
from stretchmap.population import generalized_procrustes, shape_model

RNG = np.random.default_rng(13)


def posed(shape, rng, scale=True):
    turn = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    factor = rng.uniform(0.5, 2.0) if scale else 1.0
    return factor * shape @ turn + rng.standard_normal(3)


def test_copies_in_any_pose_become_one():
    shape = RNG.standard_normal((40, 3))
    found = generalized_procrustes([posed(shape, RNG) for _ in range(6)])
    assert np.ptp(found.aligned, axis=0).max() < 1e-12


def test_moves_lead_there_and_back():
    shapes = np.stack([posed(RNG.standard_normal((30, 3)) + 3 * np.eye(30, 3), RNG) for _ in "abc"])
    found = generalized_procrustes(shapes)
    for move, given, aligned in zip(found.moves, shapes, found.aligned, strict=True):
        assert np.allclose(move(given), aligned) and np.allclose(move.back(aligned), given)
        assert np.linalg.det(move.rotation) == pytest.approx(1.0)


def test_without_scaling_sizes_are_kept():
    shape = RNG.standard_normal((40, 3))
    shapes = [posed(shape, RNG, scale=False), 2.0 * posed(shape, RNG, scale=False)]
    found = generalized_procrustes(shapes, scale=False)
    sizes = [np.sqrt(((x - x.mean(axis=0)) ** 2).sum()) for x in (*shapes, *found.aligned)]
    assert sizes[:2] == pytest.approx(sizes[2:])
    assert np.allclose(found.aligned[1], 2.0 * found.aligned[0])


def test_a_reflection_is_no_pose():
    shape = RNG.standard_normal((40, 3))
    found = similarity_onto(shape * [-1.0, 1.0, 1.0], shape)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)


def test_linear_variation_stays_linear():
    mean = RNG.standard_normal((60, 3))
    mean -= mean.mean(axis=0)
    mode = RNG.standard_normal((60, 3))
    mode -= mode.mean(axis=0)
    poses = np.stack([mean, *(np.cross(mean, axis) for axis in np.eye(3))]).reshape(4, -1)
    free = np.linalg.qr(poses.T)[0]
    mode -= (free @ (free.T @ mode.ravel())).reshape(mode.shape)
    shapes = [posed(mean + t * mode, RNG) for t in np.linspace(-0.2, 0.2, 9)]
    model = shape_model(generalized_procrustes(shapes).aligned)
    # By least squares the size would follow the square of the score: a second mode of 1 %.
    assert model.variances[1:].sum() < 1e-5 * model.variances[0]


def test_the_mean_has_the_pose_of_the_start():
    shapes = [posed(RNG.standard_normal((20, 3)) + 4 * np.eye(20, 3), RNG) for _ in range(4)]
    start = posed(shapes[0], RNG)
    mean = generalized_procrustes(shapes, start=start).mean
    assert np.allclose(similarity_onto(mean, start, False).rotation, np.eye(3))


@pytest.mark.parametrize(
    ("shapes", "error"),
    [
        (np.zeros((3, 4, 2)), ArrayError),
        (np.zeros((0, 4, 3)), ArrayError),
        (np.zeros((2, 4, 3)), DegenerateError),
        (np.full((2, 4, 3), np.nan), NonFiniteError),
    ],
)
def test_no_shapes(shapes, error):
    with pytest.raises(error):
        generalized_procrustes(shapes)


def test_flags_are_flags():
    with pytest.raises(OptionError, match="scale"):
        generalized_procrustes(np.ones((2, 4, 3)), scale=1)
