"""Disks drawn with straight edges, and what lies behind necks of three edges."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

import stretchmap as sm
from stretchmap import _core
from stretchmap.area.flat import unfolded_turns
from stretchmap.errors import ArrayError

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


def disk(n: int, seed: int) -> np.ndarray:
    """(2 n - 5, 3) faces of a triangle with the corners 0, 1, 2 and random vertices inside."""
    rng = np.random.default_rng(seed)
    points = np.vstack([CORNERS, rng.dirichlet([0.5, 0.5, 0.5], n - 3) @ CORNERS])
    faces = Delaunay(points).simplices.astype(np.int32)
    return np.where(doubled_areas(points, faces)[:, None] > 0.0, faces, faces[:, ::-1])


def nested(rings: int) -> np.ndarray:
    """Faces of triangles in triangles, the outermost 0, 1, 2."""
    outer, inner = 3 * np.arange(rings - 1)[:, None], 3 * np.arange(1, rings)[:, None]
    sides = [
        [[low + k, low + (k + 1) % 3, high + (k + 1) % 3], [low + k, high + (k + 1) % 3, high + k]]
        for low, high in zip(outer, inner, strict=True)
        for k in range(3)
    ]
    faces = np.reshape(sides, (-1, 3)).tolist()
    return np.array([*faces, [3 * rings - 3, 3 * rings - 2, 3 * rings - 1]], np.int32)


def doubled_areas(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = points[faces].transpose(1, 0, 2)
    one, other = b - a, c - a
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]


@pytest.mark.parametrize("faces", [*(disk(n, n) for n in (4, 5, 9, 60, 3000)), nested(400)])
def test_every_face_has_room_and_looks_the_same_way(faces):
    n = int(faces.max()) + 1
    shares = _core.area.straight_drawing(faces, n, [0, 1, 2])
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_array_equal(shares[:3], np.eye(3))
    assert (shares[3:] > 0.0).all()
    whole = shares * (2 * n - 5)
    np.testing.assert_allclose(whole, np.round(whole), atol=1e-9)
    areas = doubled_areas(shares @ CORNERS, faces)
    assert areas.min() > 0.99 / (2 * n - 5) ** 2
    assert abs(areas.sum() - 1.0) < 1e-9


def test_the_corners_alone_are_a_drawing():
    shares = _core.area.straight_drawing(np.array([[2, 0, 1]], np.int32), 3, [1, 2, 0])
    np.testing.assert_array_equal(shares, np.eye(3)[[2, 0, 1]])


@pytest.mark.parametrize(
    ("faces", "n", "corners"),
    [
        (disk(9, 1)[1:], 9, [0, 1, 2]),  # open
        (disk(9, 1)[:, ::-1], 9, [0, 1, 2]),  # the other way round
        (disk(9, 1), 9, [0, 2, 1]),
        (disk(9, 1), 9, [0, 1, 3]),
        (disk(9, 1), 9, [0, 1, 1]),
        (disk(9, 1), 9, [0, 1, 9]),
        (disk(9, 1), 8, [0, 1, 2]),
        (disk(9, 1) + 1, 9, [0, 1, 2]),
        (disk(9, 1) - 1, 9, [0, 1, 2]),
        (np.repeat(disk(9, 1)[:1], 13, axis=0), 9, [0, 1, 2]),
        (np.empty((0, 3), np.int32), 2, [0, 1, 2]),
    ],
)
def test_all_else_is_refused(faces, n, corners):
    with pytest.raises(ArrayError, match="not a disk with three vertices"):
        _core.area.straight_drawing(np.ascontiguousarray(faces), n, corners)


def needle(rings: int) -> sm.TriMesh:
    """A torus with a needle of three edges round on one of its faces."""
    torus = sm.samples.torus_surface(24, 12)
    row = int(torus.V[torus.F].mean(axis=1)[:, 2].argmax())
    corners, n = torus.V[torus.F[row]], len(torus.V)
    middle = corners.mean(axis=0)
    up = np.linspace(0.0, 1.0, rings + 1)[1:, None, None] * [0.0, 0.0, 1.5]
    V = np.vstack([torus.V, (middle + 0.7 * (corners - middle) + up).reshape(-1, 3)])
    number = np.r_[torus.F[row], n + np.arange(3 * rings)]
    return sm.TriMesh(V, np.vstack([np.delete(torus.F, row, axis=0), number[nested(rings + 1)]]))


@pytest.mark.parametrize(("rings", "refine"), [(150, True), (400, False)])
def test_a_needle_of_three_edges_round_is_mapped(rings, refine):
    surface = needle(rings)
    conformal = sm.conformal_map(surface)
    chart = _core.area.SurfaceChart(surface.topology, conformal.forms)
    turns = unfolded_turns(surface, conformal)
    areas = _core.area.turn_areas(chart, turns)
    assert areas.min() > 1e-30 and abs(areas.sum() - 1.0) < 1e-9
    assert sm.area_map(surface, refine=refine).certificate.certified
