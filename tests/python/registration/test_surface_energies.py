"""Energies of surface registration: derivatives, and steps of single vertices."""

from __future__ import annotations

import numpy as np
import pytest

from stretchmap import _core, samples
from stretchmap.registration.flat_torus import FlatSurface

RNG = np.random.default_rng(8)


def test_surface_derivatives_match_finite_differences():
    """On a flat patch of the target the energy's gradient is exact in both models."""
    surface = samples.torus_surface(24, 12)
    flat = FlatSurface.of(surface)
    rest = _core.volume.rest_triangles(surface.V, surface.F, 1.0)
    weights = surface.face_areas / surface.area
    # Points in general position inside faces; the edges of the chart's faces are smooth there.
    y = flat.turns + np.array([0.013, 0.017])
    X = flat.points(y)
    faces, _ = flat.locate(y)
    F, V = surface.F[faces], surface.V
    shift = np.stack([flat.chart.shift_u, flat.chart.shift_v], axis=-1)[faces]
    corner = flat.turns[F] + shift
    edges = np.stack([V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]], axis=-1)
    chart_edges = np.stack([corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]], axis=-1)
    slopes = np.ascontiguousarray((edges @ np.linalg.inv(chart_edges)).reshape(-1, 6))
    gradient, hessian = _core.registration.match_model(flat.chart, y, X, slopes, rest, weights)
    assert np.abs(hessian - hessian.T).max() < 1e-12 * np.abs(hessian).max()
    direction = RNG.standard_normal(y.shape)
    step = 1e-7

    def energy(z):
        return _core.registration.match_value(flat.chart, z, flat.points(z), rest, weights)

    difference = (energy(y + step * direction) - energy(y - step * direction)) / (2 * step)
    assert difference == pytest.approx(gradient @ direction.ravel(), rel=1e-5)


def test_cover_derivatives_match_finite_differences():
    surface = samples.torus_surface(24, 12)
    flat = FlatSurface.of(surface)
    rest = _core.volume.rest_triangles(surface.V, surface.F, 1.0)
    y = flat.turns + 1e-3 * RNG.standard_normal(flat.turns.shape)
    home = RNG.integers(0, surface.n_faces, 700).astype(np.int32)
    metric = np.tile(np.array([[9.0, 0.3, 0.0, 3.0]]), (len(home), 1))
    weights = RNG.uniform(0.5, 1.0, len(home))
    gradient, hessian = _core.registration.cover_model(flat.chart, y, home, metric, rest, weights)
    assert np.abs(hessian - hessian.T).max() < 1e-12 * np.abs(hessian).max()
    direction = RNG.standard_normal(y.shape)
    difference = [
        _core.registration.cover_value(
            flat.chart, y + step * direction, home, metric, rest, weights
        )
        for step in (1e-7, -1e-7)
    ]
    slope = (difference[0] - difference[1]) / 2e-7
    assert slope == pytest.approx(gradient @ direction.ravel(), rel=1e-5)


def test_flat_derivatives_match_finite_differences():
    surface = samples.torus_surface(24, 12)
    flat = FlatSurface.of(surface)
    lattice = np.array([[2.0, 0.3], [0.0, 0.5]])
    rest = _core.volume.rest_triangles(surface.V, surface.F, 1.0 / surface.area)
    weights = surface.face_areas / surface.area
    y = flat.turns + 1e-3 * RNG.standard_normal(flat.turns.shape)
    gradient, hessian = _core.registration.flat_model(flat.chart, y, lattice, rest, weights)
    assert np.abs(hessian - hessian.T).max() < 1e-12 * np.abs(hessian).max()
    direction = RNG.standard_normal(y.shape)
    difference = [
        _core.registration.flat_value(flat.chart, y + step * direction, lattice, rest, weights)
        for step in (1e-7, -1e-7)
    ]
    slope = (difference[0] - difference[1]) / 2e-7
    assert slope == pytest.approx(gradient @ direction.ravel(), rel=1e-5)


def test_vertices_moved_one_by_one_lower_the_energy():
    surface = samples.vertebra_like(6000).surface
    flat = FlatSurface.of(surface)
    rest = _core.volume.rest_triangles(surface.V, surface.F, 1.0)
    weights = surface.face_areas / surface.area
    y = flat.turns + np.array([0.1, 0.05])
    X = flat.points(y)
    held = np.zeros(len(y), np.uint8)
    held[::3] = 1
    before = _core.registration.match_value(flat.chart, y, X, rest, weights)
    moved, there, _, gain, count = _core.registration.relax_match(
        flat.chart, flat.locator, surface.V, surface.F, flat.face_slopes, rest, weights, held, 2,
        y, X, np.full(len(y), 0.02),
    )  # fmt: skip
    after = _core.registration.match_value(flat.chart, moved, there, rest, weights)
    assert count > 0 and gain > 0.0 and after == pytest.approx(before - gain, rel=1e-9)
    assert np.array_equal(moved[::3], y[::3]) and np.allclose(flat.points(moved), there, atol=1e-12)
