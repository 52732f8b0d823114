"""Faces of a flat torus found from coordinates on it."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import _core
from stretchmap.area.map import equal_areas


@pytest.fixture(scope="module")
def level():
    surface = sm.samples.torus_surface(24, 12)
    return equal_areas(surface, sm.conformal_map(surface), None).level


def corners(level, faces):
    """(k, 3, 2) in turns, each face in one piece."""
    chart = level.chart
    shifts = np.stack([chart.shift_u, chart.shift_v], axis=-1)
    return (level.turns[level.surface.F] + shifts)[faces]


def test_a_point_is_where_its_weights_say_whatever_turns_are_added(level):
    queries = np.random.default_rng(5).uniform(size=(200, 2))
    locator = _core.registration.ChartLocator(level.chart, level.turns)
    faces, weights = locator.locate(queries)
    found = np.einsum("kc,kcx->kx", weights, corners(level, faces))
    apart = found - queries
    np.testing.assert_allclose(apart, np.round(apart), atol=1e-12)
    assert weights.min() > -1e-9
    again, _ = locator.locate(queries + np.array([3.0, -2.0]))
    np.testing.assert_array_equal(again, faces)


def test_what_is_no_number_is_found_nowhere(level):
    queries = np.array([[np.nan, 0.5], [0.5, np.inf], [-np.inf, np.nan]])
    faces, weights = _core.registration.ChartLocator(level.chart, level.turns).locate(queries)
    assert (faces == -1).all() and np.isnan(weights).all()
