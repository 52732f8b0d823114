"""Registration: exact cases, the synthetic pair with its known correspondence, contradictions."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import stretchmap as sm
from shapes import thin_wall
from stretchmap import _core, samples
from stretchmap.errors import (
    ArrayError,
    FileFormatError,
    KindError,
    LandmarkError,
    OptionError,
)
from stretchmap.maps.points import PointMap
from stretchmap.mesh.meshes import TetMesh, TriMesh
from stretchmap.mesh.split_edges import SplitSolid, split_edges
from stretchmap.registration import embed as _embed
from stretchmap.registration.affine import affine_landmark_map
from stretchmap.registration.embed import embed_boundary, unfold_boundary
from stretchmap.registration.flat_torus import FlatSurface, Gauge, choose_gauge
from stretchmap.registration.landmarks import Landmarks, read_landmarks
from stretchmap.registration.map import register
from stretchmap.registration.overlay import overlay_splits
from stretchmap.registration.suggest import landmarks_between
from stretchmap.registration.surface_problem import SurfaceProblem

RNG = np.random.default_rng(8)


@pytest.fixture(scope="module")
def pair():
    return samples.vertebra_pair(n_landmarks=30, n_tets=(9000, 12_000))


@pytest.fixture(scope="module")
def registered(pair):
    marks = (pair.source_landmarks, pair.target_landmarks)
    return register(pair.source, pair.target, marks, boundary="frozen")


def size(mesh):
    return np.linalg.norm(np.ptp(mesh.V, axis=0))


def surface_distance(points, surface):
    """Distance of points from a surface, brute force over the faces near them."""
    igl = pytest.importorskip("igl")
    return np.sqrt(igl.point_mesh_squared_distance(points, surface.V, surface.F)[0])


def test_a_solid_registered_with_itself_stays_where_it_is():
    solid = samples.vertebra_like(6000)
    for boundary in ("frozen", "glide"):
        result = register(solid, solid, boundary=boundary)
        assert result.certificate.certified
        assert result.boundary == "frozen"  # what keeps volumes need not glide
        assert np.abs(result.image - solid.V).max() < 1e-3 * size(solid)
        assert result.distortion.total_distortion < 1e-4


def test_a_moved_copy_is_found_without_landmarks():
    solid = samples.vertebra_like(6000, seed=3)
    Q = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    order = RNG.permutation(solid.n_vertices)
    rank = np.argsort(order).astype(np.int32)
    copy = TetMesh(2.5 * solid.V[order] @ Q.T + [7.0, -3.0, 1.0], rank[solid.T])
    result = register(solid, copy, boundary="frozen")
    assert np.abs(result.image - copy.V[rank]).max() < 1e-3 * size(copy)
    assert result.gauge.rule == "rigid fit" and result.gauge.residual < 1e-2


def test_the_synthetic_pair_against_the_truth(pair, registered):
    result = registered
    assert result.certificate.certified and result.distortion.flips == 0
    assert result.landmark_error < 1e-12
    assert np.array_equal(result.image[pair.source_landmarks], pair.target.V[pair.target_landmarks])
    free = register(pair.source, pair.target, boundary="frozen")
    skin = pair.source.boundary_vertices
    error, without = (
        np.linalg.norm(r.image[: pair.source.n_vertices] - pair.truth, axis=1) / size(pair.target)
        for r in (result, free)
    )
    # The truth does not preserve volume, so inside nothing comes closer than this; on the surface
    # a target edge is 0.032 long, and landmarks are 0.08 apart.
    assert error.mean() < 0.012 and error[skin].mean() < 0.007
    assert error.mean() < without.mean() and error[skin].mean() < 0.7 * without[skin].mean()
    assert result.distortion.ring_std < 0.12 and result.distortion.total_distortion < 0.07


def test_the_boundary_goes_to_the_boundary(pair, registered):
    ids = pair.source.boundary_vertices
    distance = surface_distance(registered.image[ids], pair.target.surface)
    assert distance.max() < 1e-9 * size(pair.target)
    assert registered.image[:, 2].max() <= pair.target.V[:, 2].max() + 1e-9


def test_there_and_back(registered):
    both = PointMap(registered)
    points = registered.mesh.V[registered.mesh.T].mean(axis=1)
    there = both.forward(points)
    assert there.inside.all()
    assert np.abs(both.inverse(there.points).points - points).max() < 1e-9 * size(registered.mesh)


def test_landmarks_as_points_and_files(pair, tmp_path):
    ids = pair.source_landmarks, pair.target_landmarks
    points = [m.V[i] for m, i in zip((pair.source, pair.target), ids, strict=True)]
    shift = 1e-4 * size(pair.source) * np.array([1.0, 0.0, 0.0])
    given = Landmarks.of(pair.source, pair.target, points[0] + shift, points[1])
    assert np.array_equal(given.source, ids[0]) and np.array_equal(given.target, ids[1])
    assert np.allclose(given.snapped[:, 0], np.linalg.norm(shift)) and not given.snapped[:, 1].any()
    by_id, by_point = tmp_path / "ids.csv", tmp_path / "points.csv"
    by_id.write_text("source,target\n" + "\n".join(f"{a},{b}" for a, b in zip(*ids, strict=True)))
    np.savetxt(by_point, np.hstack(points), delimiter=",", fmt="%.17g")
    for path in (by_id, by_point):
        read = read_landmarks(path, pair.source, pair.target)
        assert np.array_equal(read.source, ids[0]) and np.array_equal(read.target, ids[1])


@pytest.mark.parametrize("text", ["", "a,b\n", "1,2,3\n", "1,2\n1,x\n", "1.5,2\n"])
def test_bad_landmark_files_are_named(pair, tmp_path, text):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(FileFormatError):
        read_landmarks(path, pair.source, pair.target)


def test_bad_landmarks_are_named(pair):
    source, target = pair.source, pair.target
    boundary = source.boundary_vertices
    inner = np.setdiff1d(np.arange(source.n_vertices), boundary)[:1]
    with pytest.raises(LandmarkError, match="not on the boundary"):
        Landmarks.of(source, target, inner, target.boundary_vertices[:1])
    with pytest.raises(LandmarkError, match="no vertex") as caught:
        Landmarks.of(source, target, [boundary[0], 10**6], target.boundary_vertices[:2])
    assert caught.value.ids == (1,)
    with pytest.raises(LandmarkError, match="same source vertex") as caught:
        Landmarks.of(source, target, boundary[[5, 3, 5]], target.boundary_vertices[:3])
    assert caught.value.ids == (0, 2)
    with pytest.raises(ArrayError):
        Landmarks.of(source, target, boundary[:3], target.boundary_vertices[:2])
    with pytest.raises(ArrayError):
        Landmarks.of(source, target, np.zeros((3, 2)), boundary[:3])
    for options in ({"landmark_map": "wild"}, {"max_iter": -1}, {"tol": -1.0}):
        with pytest.raises(OptionError):
            register(source, target, **options)


def test_the_gauge_is_recovered(pair):
    flat = FlatSurface.of(pair.source.surface)
    for sign, twist, shift in [(1, 0, (0.3, 0.6)), (-1, 1, (0.0, 0.25)), (-1, -1, (0.7, 0.1))]:
        moved = flat.changed(Gauge(sign, twist, shift, 0.0, ""))
        ids = np.arange(0, pair.source.surface.n_vertices, 29, dtype=np.int32)
        for belong in (None, (ids, pair.source.surface.V[ids])):
            found = choose_gauge(flat, moved, belong)
            assert (found.sign, found.twist) == (sign, twist)
            off = np.array(found.shift) - shift
            assert np.abs(off - np.round(off)).max() < 2e-3
            assert found.residual < 1e-2


def test_affine_map_takes_landmarks_to_landmarks_and_is_periodic():
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(5)), axis=-1).reshape(-1, 2)
    source = (grid + 0.3 * RNG.random((25, 2))) / 5
    target = source + 0.01 * RNG.standard_normal((25, 2))
    assert np.allclose(affine_landmark_map(source, target, source), target, atol=1e-12)
    y = RNG.random((400, 2))
    mapped = affine_landmark_map(source, target, y)
    whole = RNG.integers(-2, 3, (400, 2))
    assert np.allclose(affine_landmark_map(source, target, y + whole), mapped + whole, atol=1e-9)
    # The same motion of all landmarks, taken the short way round, is a shift.
    assert np.allclose(
        affine_landmark_map(source, source + np.array([0.9, 0.3]), y), y + np.array([-0.1, 0.3])
    )


def test_affine_registration_of_the_pair(pair):
    result = register(
        pair.source,
        pair.target,
        (pair.source_landmarks, pair.target_landmarks),
        landmark_map="affine",
        keep_best=True,
    )
    assert result.landmark_map == "affine" and result.landmark_error < 1e-12


def test_contradicting_landmarks_name_the_pair(pair):
    """Two neighbouring landmarks exchanged: no map without a fold takes both."""
    a, b = pair.source_landmarks.copy(), pair.target_landmarks
    near = cKDTree(pair.source.V[a]).query(pair.source.V[a], k=2)
    first = int(np.argmin(near[0][:, 1]))
    second = int(near[1][first, 1])
    a[[first, second]] = a[[second, first]]
    with pytest.raises(LandmarkError) as caught:
        register(pair.source, pair.target, (a, b), landmark_map="affine")
    assert set(caught.value.ids) == {first, second}


@pytest.mark.filterwarnings("error")
def test_where_all_vertices_are_held_there_is_no_step():
    flat = FlatSurface.of(samples.torus_surface(12, 8))
    problem = SurfaceProblem(flat, flat)
    problem.held[:] = True
    for tangent in (False, True):
        assert not problem.newton_step(flat.turns, flat.surface.V, tangent).any()


def test_a_step_is_shortened_only_where_faces_would_fold():
    flat = FlatSurface.of(samples.torus_surface(24, 12))
    problem = SurfaceProblem(flat, flat)
    step = np.full_like(flat.turns, 0.01)
    step[40] = 0.3, -0.2
    assert _core.area.turn_areas(flat.chart, flat.turns + step).min() < 0.0
    taken = problem.unfolded(flat.turns, step)
    areas = _core.area.turn_areas(flat.chart, flat.turns)
    assert (_core.area.turn_areas(flat.chart, flat.turns + taken) > 0.05 * areas).all()
    near = np.unique(flat.surface.F[(flat.surface.F == 40).any(axis=1)])
    others = np.setdiff1d(np.arange(len(step)), near)
    assert np.array_equal(taken[others], step[others]) and np.abs(taken[40]).max() > 0.0


@pytest.mark.parametrize("seed", [5, 23])
def test_processes_of_the_target_are_not_cut_off(seed):
    """However far apart two shapes are: a face that spans a process stands for all of it."""
    smooth = samples.solid_torus(3000)
    spiky = samples.vertebra_like(3000, seed=seed)
    result = register(smooth, spiky, boundary="frozen", keep_best=True)
    assert result.surface_distance < 0.06


def test_landmarks_by_rule(pair):
    free = register(pair.source, pair.target)
    marks = landmarks_between(free, 32)
    assert len(marks) == 32 and len(set(marks.source)) == len(set(marks.target)) == 32
    with pytest.raises(LandmarkError):
        landmarks_between(free, 10**5)
    with pytest.raises(OptionError, match="n must be"):
        landmarks_between(free, "3")
    with pytest.raises(OptionError, match="no target solid"):
        landmarks_between(sm.fill(pair.source, pair.source.surface.V))
    with pytest.raises(KindError, match="needs the map of a solid"):
        landmarks_between(sm.area_map(pair.source.surface))


def test_suggested_landmarks_are_vertices_of_the_source(pair, tmp_path):
    free = register(pair.source, pair.target)
    free.save(tmp_path / "free.npz")
    loaded = sm.load_map(tmp_path / "free.npz")
    given = free.mesh.n_vertices // 2  # as if all others had been put in
    n_split = free.mesh.n_vertices - given
    refined = replace(free, refinement=SimpleNamespace(n_split=n_split))
    whole, part = landmarks_between(free, 30), landmarks_between(refined, 30)
    assert max(whole.source) >= given
    assert max(part.source) < given
    np.testing.assert_array_equal(landmarks_between(loaded, 30).source, whole.source)
    meta = loaded.meta | {"added_vertices": n_split - 1, "boundary_splits": 1}
    np.testing.assert_array_equal(
        landmarks_between(replace(loaded, meta=meta), 30).source, part.source
    )


def test_saving(registered, tmp_path):
    registered.save(tmp_path / "r.npz")
    loaded = sm.load_map(tmp_path / "r.npz")
    assert np.array_equal(loaded.image, registered.image)
    assert np.array_equal(loaded.arrays["target_T"], registered.target.T)
    assert loaded.meta["landmarks"] == 30 and loaded.meta["certified"]
    assert "landmark error" in registered.summary()


def test_a_boundary_image_that_crosses_itself_is_refined():
    """Chords of a coarse polygon leave the thin wall on the other side."""
    source, target = samples.solid_torus(400), FlatSurface.of(thin_wall(0.02).surface)
    flat = FlatSurface.of(source.surface)
    y = flat.turns
    y = y + np.stack([0.04 * np.cos(2 * np.pi * y[:, 1]), 0.0 * y[:, 1]], axis=1)
    points, n = target.points(y), len(y)
    assert len(_core.certificate.crossing_faces(points, source.surface.F, 1000)) > 50
    held = np.arange(0, n, 20, dtype=np.int32)
    result = embed_boundary(SplitSolid.of(source), target, flat.at(y), points, held)
    solid = result.split.solid
    surface = solid.surface
    assert not len(result.crossings)
    assert not len(_core.certificate.crossing_faces(result.points, surface.F, 1000))
    assert solid.n_vertices > source.n_vertices and solid.diagnose().ok
    assert np.array_equal(solid.V[: source.n_vertices], source.V)
    assert np.array_equal(result.points[held], points[held])
    assert solid.volume == pytest.approx(source.volume, rel=1e-12)
    assert surface.area == pytest.approx(source.surface.area, rel=1e-12)
    assert surface_distance(result.points, target.surface).max() < 1e-9


def test_faces_that_the_affine_map_turns_over_are_refined():
    source = samples.solid_torus(3000)
    flat = FlatSurface.of(source.surface)
    y = flat.turns

    def shear(at):  # one to one, with a kink that coarse faces do not follow
        across = 3.0 * (at[:, 1] - at[:, 0])
        return at + 0.3 * np.abs(np.mod(across, 1.0) - 0.5)[:, None]

    faces = source.surface.F
    assert (flat_areas(shear(y), faces) <= 0.0).any()
    split, bent, folded = unfold_boundary(SplitSolid.of(source), flat, shear)
    solid = split.solid
    assert not len(folded) and (flat_areas(bent.turns, solid.surface.F) > 0.0).all()
    assert np.array_equal(bent.turns[: len(y)], shear(y))
    assert solid.diagnose().ok and solid.volume == pytest.approx(source.volume, rel=1e-12)


def flat_areas(y, F):
    sides = y[F[:, 1:]] - y[F[:, :1]]
    return 0.5 * np.linalg.det(sides - np.round(sides))


def test_flat_tori_have_no_squeezed_faces():
    for surface in (samples.vertebra_like(6000).surface, thin_wall(0.2, 6000).surface):
        flat = FlatSurface.of(surface)
        shares = flat_areas(flat.turns, surface.F) * surface.area / surface.face_areas
        assert shares.min() > 0.05 and shares.max() < 10.0


def test_contradicting_landmarks_name_the_pair_with_the_smooth_map_too(pair):
    a, b = pair.source_landmarks.copy(), pair.target_landmarks
    near = cKDTree(pair.source.V[a]).query(pair.source.V[a], k=2)
    first = int(np.argmin(near[0][:, 1]))
    second = int(near[1][first, 1])
    a[[first, second]] = a[[second, first]]
    with pytest.raises(LandmarkError) as caught:
        register(pair.source, pair.target, (a, b))
    print(first, second, caught.value)
    assert {first, second} & set(caught.value.ids)


def test_faces_cut_along_the_target_end_on_its_surface():
    """Cut all faces as long as there is anything to cut: the image is the target, face for face."""
    source, target = samples.solid_torus(400), FlatSurface.of(samples.bumpy_torus(1500).surface)
    image = FlatSurface.of(source.surface)
    image = image.at(image.turns + np.array([0.013, 0.17]))
    points, solid = target.points(image.turns), source
    gap = [abs(_core.mesh.enclosed_volume(points, source.surface.F) / target.surface.volume - 1.0)]
    for _ in range(60):
        faces = np.arange(solid.surface.n_faces)
        edges, shares, where = overlay_splits(image, target, points, faces)
        if not len(edges):
            break
        split = split_edges(solid, solid.boundary_vertices[edges], shares)
        solid = split.solid
        image = image.split(solid.surface, edges[split.kept], where[split.kept])
        points = target.points(image.turns)
        assert (flat_areas(image.turns, solid.surface.F) > 0.0).all()
        gap.append(
            abs(_core.mesh.enclosed_volume(points, solid.surface.F) / target.surface.volume - 1.0)
        )
    assert not len(edges) and gap[0] > 1e-2 and gap[-1] < 1e-9
    there = TriMesh(points, solid.surface.F)
    assert there.area == pytest.approx(target.surface.area, rel=1e-9)
    assert np.array_equal(solid.V[: source.n_vertices], source.V)
    assert solid.n_vertices > source.n_vertices


def test_edges_longer_than_half_a_turn_are_split_where_they_run():
    """A Dehn twist or two make edges of the finest torus as long as that."""
    solid = samples.solid_torus(400)
    flat = FlatSurface.of(solid.surface)
    twisted = flat.changed(Gauge(1, 9, (0.3, 0.6), 0.0, ""))
    edges = solid.surface.edges[::5]
    ways = twisted.ways(edges)
    assert np.abs(ways).max() > 0.5
    assert np.allclose(twisted.ways(edges[:, ::-1]), -ways, atol=1e-12)
    split, kept = SplitSolid.of(solid).split(
        solid.boundary_vertices[edges], np.full(len(edges), 0.3)
    )
    where = twisted.turns[edges[kept, 0]] + 0.3 * ways[kept]
    finer = twisted.split(split.solid.surface, edges[kept], where)
    areas = _core.area.turn_areas(finer.chart, finer.turns)  # of a form that is closed
    assert areas.min() > 0.0 and areas.sum() == pytest.approx(1.0, rel=1e-12)
    # Taken back, it is what the surface split without a twist is.
    plain = flat.split(
        split.solid.surface, edges[kept], flat.turns[edges[kept, 0]] + 0.3 * flat.ways(edges[kept])
    )
    assert np.allclose(
        finer.ways(finer.surface.edges), plain.ways(finer.surface.edges) @ [[1, 9], [0, 1]]
    )


def test_mirrored_landmarks_that_fold_no_face_stretch_edges_beyond_half_a_turn():
    pair = samples.vertebra_pair(n_landmarks=8, n_tets=(800, 1000))
    mirrored = TetMesh(pair.target.V * [-1, 1, 1], pair.target.T, orient=True)
    marks = pair.source_landmarks, pair.target_landmarks
    result = register(pair.source, mirrored, marks, boundary="frozen", keep_best=True)
    assert result.landmark_error < 1e-12


def test_crossing_faces_are_cut_along_the_target_where_following_it_fails(monkeypatch):
    monkeypatch.setattr(_embed, "_PATIENCE", 0)  # do not even try
    test_a_boundary_image_that_crosses_itself_is_refined()


def test_a_landmark_far_from_the_surface_is_refused_with_its_distance():
    solid = samples.solid_torus(400)
    near = solid.V[solid.boundary_vertices[:2]] * 1.01
    far = near + np.array([[0.0, 0.0, 1e9], [0.0, 0.0, 0.0]])
    with pytest.raises(LandmarkError, match=r"landmark 0 lies 1e\+09 from .* of the source") as e:
        Landmarks.of(solid, solid, far, near)
    assert e.value.ids == (0,)
    assert Landmarks.of(solid, solid, near, near).snapped.max() < 0.1
    with pytest.raises(LandmarkError, match=r"at most 0.001 of that"):
        Landmarks.of(solid, solid, near, near, within=1e-3)
    assert len(Landmarks.of(solid, solid, far, near, within=1e12)) == 2
