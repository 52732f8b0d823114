"""Where points lie: how many boxes and tets are looked at, and which tet is answered."""

from __future__ import annotations

import numpy as np
import pytest

from stretchmap import _core, samples

TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


def graded(points):
    """Much finer towards a vertex: sizes over six orders."""
    away = points - points[np.argmax(points[:, 0])]
    return away * np.linalg.norm(away, axis=1)[:, None] ** 6


def slender(points):
    return (points * [1, 1e-4, 1e-4]) @ TURN


def flat(points):
    return (points * [1, 1, 1e-4]) @ TURN


@pytest.mark.parametrize("shape", [graded, slender, flat])
def test_visits_grow_like_a_logarithm(shape):
    """In the cells of a grid they had grown with a power of the number of tets, 0.5 to 0.8."""
    visits = []
    for n in (600, 20_000):
        solid = samples.solid_torus(n)
        points = shape(solid.V)
        locator = _core.maps.TetLocator(points, solid.T, 0.0)
        centers = points[solid.T].mean(axis=1)
        assert np.array_equal(locator.locate(centers)[0], np.arange(solid.n_tets))
        visits.append(locator.visits(centers).mean())
    assert visits[1] < 3.0 * visits[0] and visits[1] < 300


@pytest.mark.parametrize("shape", [np.asarray, graded, slender, flat])
def test_of_tets_that_share_a_point_the_first_is_answered(shape):
    solid = samples.solid_torus(600)
    points = np.ascontiguousarray(shape(solid.V))
    tets, weights = _core.maps.TetLocator(points, solid.T, 0.0).locate(points)
    first = np.full(len(points), solid.n_tets)
    np.minimum.at(first, solid.T, np.arange(solid.n_tets)[:, None])
    assert np.array_equal(tets, first)
    assert np.array_equal(weights.max(axis=1), np.ones(len(points)))


def test_what_lies_nowhere():
    solid = samples.solid_torus(600)
    nowhere = np.array([[0.0, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0], [1e300, 1e300, 1e300]])
    tets, weights = _core.maps.TetLocator(solid.V, solid.T, 1e-9).locate(nowhere)
    assert (tets == -1).all() and np.isnan(weights).all()
    none = _core.maps.TetLocator(solid.V, solid.T[:0], 0.0)
    assert (none.locate(solid.V)[0] == -1).all()
