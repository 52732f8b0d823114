"""Where u and v begin: the same for the same body, however it is meshed and wherever it stands."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.errors import ArrayError, LandmarkError, NonFiniteError


@pytest.fixture(scope="module")
def found():
    return sm.volume_map(sm.samples.vertebra_population(1, seed=11, n_tets=1500).solids[0])


def apart(one, other):
    """Median degrees between angles."""
    return np.degrees(np.nanmedian(np.abs(np.angle(np.exp(1j * (one - other)))), axis=0))


def test_a_moved_and_renumbered_body_has_the_same_coordinates(found):
    solid, random = found.mesh, np.random.default_rng(3)
    Q = np.linalg.qr(random.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    order = random.permutation(solid.n_vertices)
    rank = np.argsort(order).astype(np.int32)
    copy = sm.volume_map(sm.TetMesh(solid.V[order] @ Q.T + 3.0, rank[solid.T]))
    one = sm.origin_of(found).coordinates(found.coordinates())
    other = sm.origin_of(copy).coordinates(copy.coordinates(copy.mesh.V[: solid.n_vertices]))
    assert (apart(one[order, :2], other[:, :2]) < 5.0).all()


@pytest.mark.parametrize(("seed", "growths"), [(34, (1.4, 1.7, 3.0)), (35, (1.2, 1.7))])
def test_other_maps_of_the_same_body_begin_at_the_same_place(seed, growths):
    """Terms of opposite signs that are nearly as large do not decide by turns which way to run."""
    found = sm.volume_map(sm.samples.vertebra_population(1, seed=seed, n_tets=3000).solids[0])
    here = sm.origin_of(found).coordinates(found.coordinates())
    for growth in growths:
        other = sm.volume_map(found.mesh, options=sm.VolumeOptions(growth=growth))
        there = sm.origin_of(other).coordinates(other.coordinates(found.mesh.V))
        assert (apart(here[:, :2], there[:, :2]) < 5.0).all()


def skewed(n_tets):
    """A vertebra bent, twisted and swollen on one side."""
    solid = sm.samples.vertebra_like(n_tets)
    size = np.linalg.norm(np.ptp(solid.V, axis=0))
    x, y, z = (solid.V / size).T
    turn = 1.2 * z + 0.8 * x
    a, b = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    bent = np.column_stack([a * (1.0 + 0.5 * b), b, z + 0.6 * a * b + 0.3 * a])
    return sm.TetMesh(size * bent, solid.T)


def test_other_meshes_of_the_same_body_begin_at_the_same_place():
    solid = skewed(8000)  # finer than all that are measured by it
    points = solid.V[solid.T].mean(axis=1)

    def seen(found):
        begin = sm.origin_of(found)
        assert begin.sureness[2] > 0.02
        given = found.coordinates(points)
        inside = np.isfinite(given).all(axis=1)
        assert inside.mean() > 0.99
        angles = np.full((len(points), 2), np.nan)
        angles[inside] = begin.coordinates(given[inside])[:, :2]
        return angles

    here = seen(sm.volume_map(solid))
    moved, differ = [], []
    for n_tets in (2000, 3000, 4000, 6000):
        there = seen(sm.volume_map(skewed(n_tets)))
        known = np.isfinite(here + there).all(axis=1)
        assert known.mean() > 0.98
        turn = np.exp(1j * (here - there)[known]).mean(axis=0)
        moved.append(np.degrees(np.abs(np.angle(turn))))
        differ.append(apart(here[known], there[known]))
    # The maps themselves differ; the origin does not move farther than their points.
    assert (np.array(moved) < np.array(differ)).all()
    assert (np.median(moved, axis=0) < [1.5, 3.0]).all()
    assert (np.median(differ, axis=0) < [4.0, 10.0]).all()


def test_the_origin_does_not_depend_on_where_the_map_began(found):
    """Coordinates turned and reversed beforehand come out the same."""

    class Turned(sm.VolumeMap):
        def coordinates(self, points=None):
            uvs = np.array(found.coordinates(points))
            uvs[:, 0], uvs[:, 1] = 1.3 - uvs[:, 0], 4.0 - uvs[:, 1]
            return uvs

    turned = Turned(**{field.name: getattr(found, field.name) for field in fields(found)})
    here, there = sm.origin_of(found), sm.origin_of(turned)
    assert here.sign == -there.sign and min(here.sureness) > 1e-3
    one, other = here.coordinates(found.coordinates()), there.coordinates(turned.coordinates())
    assert (apart(one[:, :2], other[:, :2]) < 1e-6).all()
    assert np.allclose(one[:, 2], other[:, 2], equal_nan=True)


def test_two_landmarks_decide(found):
    centers = found.mesh.V[found.mesh.T[[5, 700]]].mean(axis=1)
    for marks in (centers, centers[::-1]):
        origin = sm.origin_of(found, marks)
        uvs = origin.coordinates(found.coordinates(marks))
        assert np.abs(np.sin(uvs[0, :2] / 2.0)).max() < 1e-9
        assert uvs[1, 0] < np.pi


def test_landmarks_that_decide_nothing_are_named(found):
    with pytest.raises(ArrayError):
        sm.origin_of(found, found.mesh.V[:3])
    with pytest.raises(LandmarkError) as caught:
        sm.origin_of(found, np.array([found.mesh.V[0], [1e3, 0.0, 0.0]]))
    assert 1 in caught.value.ids
    with pytest.raises(LandmarkError, match="the same point"):
        sm.origin_of(found, found.mesh.V[[5, 5]])


def test_points_outside_stay_lost(found):
    points = np.vstack([found.mesh.V[:3], [1e3, 0.0, 0.0]])
    origin = sm.origin_of(found)
    uvs = origin.coordinates(found.coordinates(points))
    assert np.isfinite(uvs[:3]).all() and np.isnan(uvs[3]).all()
    with pytest.raises(NonFiniteError, match="at vertex 0"):
        origin.coordinates([[0.0, np.nan, 0.5]])
