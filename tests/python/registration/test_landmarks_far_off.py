"""Landmarks far from where the surfaces laid on each other have them."""

from __future__ import annotations

import time

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import LandmarkError
from stretchmap.registration import boundary
from stretchmap.registration import map as _map
from stretchmap.registration.flat_torus import FlatSurface
from stretchmap.registration.match import match_surfaces


@pytest.fixture(scope="module")
def solid():
    return samples.bumpy_torus(1500)


@pytest.fixture(scope="module")
def flat(solid):
    return FlatSurface.of(solid.surface)


def displaced(flat: FlatSurface, seed: int) -> np.ndarray:
    """A few vertices, and others about an eighth of a turn from them: (k, 2)."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(4, 14))
    source = rng.choice(len(flat.turns), k, replace=False)
    goals = flat.turns[source] + rng.uniform(-0.12, 0.12, (k, 2))
    away = flat.turns - goals[:, None]
    target = np.linalg.norm(away - np.round(away), axis=2).argmin(axis=1)
    assert len(set(target)) == k
    return np.stack([source, target], axis=1).astype(np.int32)


@pytest.mark.parametrize("seed", [28, 59, 67, 83, 96, 172])
def test_they_go_ahead_where_few_faces_are_in_the_way_of_all(flat, seed):
    pairs = displaced(flat, seed)
    match = match_surfaces(flat, flat, flat.turns, pairs, max_iter=0, tol=1e-3, progress=None)
    away = match.y[pairs[:, 0]] - flat.turns[pairs[:, 1]]
    assert np.abs(away - np.round(away)).max() < 1e-12


@pytest.mark.parametrize("seed", [19, 143])
def test_where_faces_have_no_room_edges_are_halved(solid, flat, seed):
    pairs = displaced(flat, seed)
    with pytest.raises(LandmarkError):
        match_surfaces(flat, flat, flat.turns, pairs, max_iter=0, tol=1e-3, progress=None)
    skin = solid.boundary_vertices
    result = sm.register(solid, solid, (skin[pairs[:, 0]], skin[pairs[:, 1]]))
    assert result.certificate.certified and result.landmark_error < 1e-12
    assert result.boundary_splits > 0
    assert np.array_equal(result.mesh.V[: solid.n_vertices], solid.V)


def test_the_time_limit_counts_what_the_boundary_takes(solid, monkeypatch):
    given = []
    fill, match = _map.fill_either_way, boundary.match_surfaces

    def burns(*args, **options):
        end = time.thread_time() + 0.5
        while time.thread_time() < end:
            pass
        return match(*args, **options)

    def filled(source, target, waiting, ways, options, budget, progress):
        given.append((budget.left, budget.seconds))
        return fill(source, target, waiting, ways, options, budget, progress)

    monkeypatch.setattr(boundary, "match_surfaces", burns)
    monkeypatch.setattr(_map, "fill_either_way", filled)
    sm.register(solid, solid)
    assert given[0][0] < given[0][1] - 0.5
