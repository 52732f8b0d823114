"""Volume maps with a prescribed boundary."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from shapes import RING, cubes
from stretchmap import samples
from stretchmap.base.budget import Budget
from stretchmap.errors import (
    ArrayError,
    CertificationError,
    DegenerateError,
    GenusError,
    NonFiniteError,
    OptionError,
    OrientationError,
    SelfIntersectionError,
)
from stretchmap.mesh.meshes import TetMesh

RNG = np.random.default_rng(5)


@pytest.fixture(scope="module")
def ball():
    return samples.ball(4)


def check(solid, boundary, result):
    ids, n = solid.boundary_vertices, solid.n_vertices
    assert sm.certify(result.solid, result.image).certified
    np.testing.assert_array_equal(result.image[ids], boundary)
    np.testing.assert_array_equal(result.solid.V[:n], solid.V)
    np.testing.assert_array_equal(result.solid.boundary_vertices, ids)


def on_cube(points):
    """Points of a sphere pushed out to a cube: whole faces of the image lie in a plane."""
    return points / np.abs(points).max(axis=1, keepdims=True)


def squeezed(points, power):
    """A ball with its upper end drawn into a tip of a size far below that of its triangles."""
    x, y, z = points.T
    share = 1.0 / (1.0 + np.exp(-power * (z - 0.4)))
    factor = np.exp(-power * share)
    return np.column_stack([x * factor, y * factor, z * factor + 2.0 * (1.0 - factor)])


def test_a_ball_is_mapped_to_a_cube(ball):
    boundary = on_cube(ball.surface.V)
    result = sm.fill(ball, boundary)
    check(ball, boundary, result)
    assert result.converged and result.distortion.flips == 0
    assert result.torus is None and result.title == "fill"


@pytest.mark.parametrize(
    ("nu", "nv", "ratio", "turns"),
    [(24, 10, 1.3, 1), (40, 12, 1.5, 2), (60, 12, 1.5, 2), (60, 20, 1.3, 1), (60, 20, 1.3, 2)],
)
def test_a_twisted_boundary_and_hardly_a_vertex_inside(nu, nv, ratio, turns):
    """Single vertices that see hundreds of faces have no place: more are put in until there is."""
    pytest.importorskip("tetgen")
    surface = samples.torus_surface(nu, nv, R=ratio, r=1.0)
    solid = samples.tetrahedralize(surface, quality=1e6)  # tets that reach right across
    x, y, z = solid.surface.V.T
    u, v = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y) - ratio)
    w = v + turns * u
    far = ratio + np.cos(w)
    boundary = np.column_stack([far * np.cos(u), far * np.sin(u), np.sin(w)])
    result = sm.fill(solid, boundary)
    check(solid, boundary, result)
    assert result.converged


def test_the_limit_counts_the_tets_given(monkeypatch):
    """Not those they are split into, of which there are several times as many here."""
    counted, of = [], Budget.of

    def noted(time_limit, n_tets):
        counted.append((time_limit, n_tets))
        return of(time_limit, n_tets)

    monkeypatch.setattr(Budget, "of", noted)
    wall = TetMesh(*cubes(RING))
    result = sm.fill(wall, wall.surface.V, options=sm.FillOptions(time_limit=0.5))
    assert counted == [(0.5, wall.n_tets)]
    assert result.solid.n_tets > 2 * wall.n_tets


def test_a_boundary_that_moved_rigidly_moves_the_inside(ball):
    Q = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    boundary = 7.0 * ball.surface.V @ Q.T + [100.0, -20.0, 3.0]
    result = sm.fill(ball, boundary)
    moved = 7.0 * result.solid.V @ Q.T + [100.0, -20.0, 3.0]
    np.testing.assert_allclose(result.image, moved, atol=0.02)
    assert result.distortion.element_error_mean < 1e-3


@pytest.mark.parametrize("power", [5.0, 9.0])
def test_a_limb_squeezed_by_orders_of_magnitude(ball, power):
    """Faces of the tip are 1e-4 and 1e-8 of their share, which is no reason to give up."""
    boundary = squeezed(ball.surface.V, power)
    corners = boundary[ball.surface.F]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert areas.min() < np.exp(-1.6 * power) * areas.mean()
    result = sm.fill(ball, boundary)
    check(ball, boundary, result)
    assert result.converged


@pytest.mark.parametrize("solid", [samples.solid_double_torus(2), samples.solid_torus(900)])
def test_a_boundary_left_where_it_is_leaves_nothing_to_do(solid):
    result = sm.fill(solid, 2.0 * solid.surface.V)
    assert result.converged and result.stop_reason == "the energy is at its least"
    np.testing.assert_allclose(result.image, 2.0 * result.solid.V, atol=1e-12)


def test_one_handle_may_take_the_place_of_another():
    double = samples.solid_double_torus(2)
    center = 0.5 * (double.V.min(axis=0) + double.V.max(axis=0))
    half_turn = (double.surface.V - center) * [-1.0, -1.0, 1.0]
    check(double, half_turn, sm.fill(double, half_turn))


def test_a_cap_squeezed_at_once_does_not_hold_up_all_the_rest(ball):
    """The harmonic map sees the body outside far into it; that is mended where it is."""
    V = ball.surface.V / np.linalg.norm(ball.surface.V, axis=1)[:, None]
    polar, around = np.arccos(np.clip(V[:, 2], -1.0, 1.0)), np.arctan2(V[:, 1], V[:, 0])
    rest = (polar - 1.0) * (np.pi - 1e-3) / (np.pi - 1.0)
    squeezed = np.where(polar < 1.0, 1e-3 * polar, 1e-3 + rest)
    ring = np.sin(squeezed)
    boundary = np.stack([ring * np.cos(around), ring * np.sin(around), np.cos(squeezed)], axis=1)
    result = sm.fill(ball, boundary)
    check(ball, boundary, result)
    assert result.converged and result.history[0].stage == "untangle"
    assert result.history[0].energy < 20.0  # 200 with what is far too large


@pytest.mark.parametrize("solid", [samples.solid_torus(900), samples.solid_double_torus(2)])
def test_solids_of_any_genus(solid):
    V = solid.surface.V
    boundary = V + 0.1 * np.sin(2.0 * V[:, [1, 2, 0]])
    result = sm.fill(solid, boundary)
    check(solid, boundary, result)


def test_same_bits_with_any_number_of_threads(ball):
    boundary = squeezed(ball.surface.V, 4.0)
    one, two = (sm.fill(ball, boundary, threads=n).image for n in (1, 2))
    np.testing.assert_array_equal(one, two)


def test_every_step_is_reported(ball):
    seen = []
    sm.fill(ball, on_cube(ball.surface.V), progress=lambda stage, *_, **__: seen.append(stage))
    assert "frozen" in seen


def test_a_map_comes_back_from_its_file(ball, tmp_path):
    result = sm.fill(ball, on_cube(ball.surface.V))
    result.save(tmp_path / "map.npz")
    loaded = sm.load_map(tmp_path / "map.npz")
    assert loaded.title == "fill" and loaded.meta["certified"] and loaded.converged
    np.testing.assert_array_equal(loaded.image, result.image)
    assert sm.certify_file(tmp_path / "map.npz").certified


def test_images_of_the_wrong_shape_are_refused(ball):
    V = ball.surface.V
    for wrong in (V[:-1], V[:, :2], V.ravel()):
        with pytest.raises(ArrayError):
            sm.fill(ball, wrong)
    broken = V.copy()
    broken[3, 1] = np.nan
    with pytest.raises(NonFiniteError):
        sm.fill(ball, broken)


def test_an_image_inside_out_is_refused(ball):
    with pytest.raises(OrientationError, match="inside out"):
        sm.fill(ball, ball.surface.V * [1.0, 1.0, -1.0])
    with pytest.raises(OrientationError):
        sm.fill(ball, ball.surface.V * [1.0, 1.0, 0.0])


def test_an_image_that_crosses_itself_is_refused_with_its_faces(ball):
    boundary = ball.surface.V.copy()
    top, bottom = boundary[:, 2].argmax(), boundary[:, 2].argmin()
    boundary[top] = 1.5 * boundary[bottom]
    with pytest.raises(SelfIntersectionError, match="crosses itself") as caught:
        sm.fill(ball, boundary)
    faces = np.array(caught.value.ids).reshape(-1, 2)
    assert (ball.surface.F[faces] == top).any(axis=(1, 2)).all()


def test_a_solid_with_a_cavity_is_refused(ball):
    inside = np.flatnonzero((ball.boundary_index < 0)[ball.T].all(axis=1))
    hollow = TetMesh(ball.V, np.delete(ball.T, inside[:1], axis=0))
    with pytest.raises(GenusError, match="2 components"):
        sm.fill(hollow, hollow.surface.V)


def test_options_of_maps_onto_a_torus_are_refused(ball):
    for name, value in (("ratio", 2.0), ("tol", 0.1), ("vertex_exact", True), ("target_iter", 9)):
        with pytest.raises(OptionError, match=f"only volume_map takes {name}:"):
            sm.fill(ball, ball.surface.V, options=sm.VolumeOptions(**{name: value}))
    loose = sm.VolumeOptions(free_ratios=(0.5, 2.0), volume_weight=10.0)
    tight = sm.FillOptions(volume_weight=10.0)
    squeezed = ball.surface.V * [2.0, 1.0, 0.25]
    maps = [sm.fill(ball, squeezed, options=options) for options in (loose, tight)]
    assert maps[0].distortion.element_std > maps[1].distortion.element_std


def test_tets_the_boundary_decides_about_are_named_or_split():
    """Two tets glued along a face, seen as one polyhedron: no vertex lies inside."""
    V = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1.0], [0.3, 0.3, -1.0]])
    solid = TetMesh(V, [[0, 1, 2, 3], [0, 2, 1, 4]])
    boundary = V + np.array([0.0, 0.0, 2.0])
    boundary[0, 2] += 0.3
    with pytest.raises(DegenerateError) as caught:
        sm.fill(solid, boundary, options=sm.FillOptions(refine=False))
    assert set(caught.value.ids) == {0, 1}
    result = sm.fill(solid, boundary)
    check(solid, boundary, result)
    assert result.refinement.n_split == 1
    assert result.to_dict()["added_vertices"] == 1
    assert result.extra_arrays()["parent_tet"].max() == 1


def test_what_no_map_can_follow_is_refused_or_kept(monkeypatch):
    """A boundary twisted once along the meridian of a solid torus extends; a swap of meridian and
    longitude does not."""
    from stretchmap.base.torus import Torus

    solid = samples.solid_torus(600, R=3.0, r=1.0)
    torus = Torus(3.0, 1.0)
    u, v, _ = torus.coordinates(solid.surface.V)
    twisted = torus.xi(u, v + u)
    check(solid, twisted, sm.fill(solid, twisted))
    swapped = Torus(3.0, 1.0).xi(-v, u)
    steps = []
    with pytest.raises(GenusError, match="turns the solid inside out"):
        sm.fill(solid, swapped, progress=lambda *a, **k: steps.append(a))
    assert not steps
    kept = sm.fill(solid, swapped, keep_best=True)
    assert not kept.certificate.certified and not kept.converged and kept.distortion.flips > 0
    monkeypatch.setattr("stretchmap.volume.fill.require_bounding_alike", lambda *arguments: None)
    with pytest.raises(CertificationError, match="keep_best") as caught:
        sm.fill(solid, swapped)
    assert caught.value.ids
