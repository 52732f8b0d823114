"""Boundaries laid on others by a smooth deformation, and the steps that serve them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

import stretchmap as sm
from stretchmap import _core, samples
from stretchmap.base.budget import Budget
from stretchmap.deformation.fitting import Template
from stretchmap.deformation.smooth import settled
from stretchmap.registration import boundary
from stretchmap.registration.boundary import BoundaryWays
from stretchmap.registration.flat_torus import DampedSolver
from stretchmap.registration.landmarks import Landmarks
from stretchmap.registration.smooth_start import _COLLAPSED, _distortion


def ways(source: sm.TetMesh, target: sm.TetMesh, progress=None) -> BoundaryWays:
    none = np.zeros(0, np.int32)
    marks = Landmarks(none, none, np.zeros((0, 2)))
    return BoundaryWays(source, target, marks, "smooth", max_iter=300, tol=1e-3, progress=progress)


@pytest.fixture(scope="module")
def solid():
    return samples.vertebra_like(1500)


def moved(solid: sm.TetMesh) -> tuple[sm.TetMesh, np.ndarray]:
    """The same solid stretched a little, turned and scaled, its vertices renumbered; and where
    they went, in the old order."""
    order = np.random.default_rng(3).permutation(solid.n_vertices)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    V = 3.0 * (solid.V * [1.0, 1.1, 0.95]) @ turn + [5.0, 0.0, -2.0]
    return sm.TetMesh(V[order], np.argsort(order)[solid.T].astype(np.int32)), V


@pytest.fixture(scope="module")
def turned(solid):
    return moved(solid)


def test_the_deformation_is_found_without_being_told(solid, turned):
    target, V = turned
    (laid,) = ways(solid, target).others(Budget(100.0))
    assert not laid.crosses and laid.energy < 0.05
    assert laid.gauge.rule == "smooth fit"
    off = np.linalg.norm(laid.embedded.points - V[solid.boundary_vertices], axis=1)
    assert off.max() < 0.02 * np.linalg.norm(np.ptp(V, axis=0))


def test_it_is_looked_for_once_and_while_there_is_time(solid, turned):
    there = ways(solid, turned[0])
    assert not there.others(Budget(0.0))
    assert there.others(Budget(100.0))
    assert not there.others(Budget(100.0))


def test_it_stops_while_there_is_time_to_fill():
    solid, fits = samples.bumpy_torus(1500), []  # which lies on itself in several poses

    class Runs:
        """A budget of which each fit takes a third."""

        seconds = 1.0

        @property
        def left(self) -> float:
            return 1.0 - len(fits) / 3.0

    there = ways(solid, moved(solid)[0], lambda stage, *_, **__: fits.append(stage))
    assert not there.others(Runs())
    assert fits == ["deform"] * 3


def test_one_that_distorts_faces_beyond_use_is_left_out(solid, turned, monkeypatch):
    monkeypatch.setattr(boundary, "_UNLIKE", 1e-9)
    assert not ways(solid, turned[0]).others(Budget(100.0))


def test_distortion_is_that_of_shapes_and_shares_of_area(solid):
    skin = solid.surface
    bigger = sm.TriMesh(2.0 * skin.V, skin.F)
    assert _distortion(skin, bigger, bigger.V) < 1e-12
    flat = sm.samples.torus_surface(24, 12)
    with np.errstate(all="ignore"):
        assert _distortion(flat, flat, np.zeros_like(flat.V)) == pytest.approx(_COLLAPSED)
    there = flat.V.copy()
    there[flat.F[0]] = there[flat.F[0, 0]]  # one face and its neighbors collapse
    share = _distortion(flat, flat, there) / _COLLAPSED
    touched = np.isin(flat.F, flat.F[0]).any(axis=1)
    assert 0.0 < share < flat.face_areas[touched].sum() / flat.area


def test_steps_are_those_of_a_solver_that_begins_anew():
    """Of the same pattern with other values, and of another one with as many entries."""
    rng = np.random.default_rng(0)
    kept, some = DampedSolver(), sp.random(40, 40, 0.1, "csr", random_state=7)
    for order in (np.arange(40), np.arange(40), rng.permutation(40)):
        A = some[order][:, order]
        A.data = rng.standard_normal(A.nnz)
        H, g = (A @ A.T + sp.eye(40)).tocsr(), rng.standard_normal(40)
        step = kept.step(g, H)
        assert np.array_equal(step, DampedSolver().step(g, H))
        assert np.allclose(H @ step, -g, atol=1e-4)


def test_what_is_held_stays_where_faces_that_cross_are_settled(solid):
    skin, template = solid.surface, Template(solid)
    points, (i, j) = skin.V.copy(), skin.edges[50]
    points[[i, j]] = points[[j, i]]
    assert len(_core.certificate.crossing_faces(points, skin.F, 100))
    free, held = (settled(template, skin, points, rows) for rows in (None, np.array([i])))
    assert not len(_core.certificate.crossing_faces(free, skin.F, 100))
    assert not np.array_equal(free[i], points[i])
    assert np.array_equal(held[i], points[i]) and not np.array_equal(held[j], points[j])
