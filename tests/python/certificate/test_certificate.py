"""The certificate: predicates against rational arithmetic, good maps accepted, bad ones refused."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

import reference as ref
from stretchmap import TetMesh, Torus, TriMesh, _core, certify, samples
from stretchmap.certificate.checks import certify_file
from stretchmap.certificate.findings import require_certified
from stretchmap.errors import (
    ArrayError,
    CertificationError,
    FileFormatError,
    NonFiniteError,
    OptionError,
)

TORUS = Torus(3.0, 1.0)


def twisted(solid, turns_u, turns_v=1, shear=0.0):
    """The solid torus mapped by (u, v) -> (turns_u u, turns_v v + shear u)."""
    u, v, s = TORUS.coordinates(solid.V)
    return TORUS.xi(turns_u * u, turns_v * v + shear * u, s)


@pytest.fixture(scope="module")
def solid():
    return samples.solid_torus(6_000)


# Predicates


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.integers(-3, 3), min_size=12, max_size=12),
    st.lists(st.integers(-2, 2), min_size=12, max_size=12),
    st.sampled_from([1.0, 0.1, 1e-8, 1e15]),
)
def test_orient3d_is_exact_next_to_degenerate(base, ulps, scale):
    points = (np.array(base, float) + 1 / 3).reshape(4, 3) * scale
    points += np.spacing(points) * np.reshape(ulps, (4, 3))
    assert _core.testing.orient3d(*points) == ref.exact_orient3d(*points)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.integers(-3, 3), min_size=9, max_size=9),
    st.lists(st.integers(-2, 2), min_size=9, max_size=9),
    st.integers(0, 2),
)
def test_orient2d_is_exact_next_to_degenerate(base, ulps, axis):
    points = (np.array(base, float) + 0.1).reshape(3, 3)
    points += np.spacing(points) * np.reshape(ulps, (3, 3))
    lifted = np.insert(np.delete(points, axis, axis=1), 2, 0.0, axis=1)
    above = lifted[0] + [0.0, 0.0, 1.0]
    assert _core.testing.orient2d(*points, axis) == ref.exact_orient3d(*lifted, above)


def test_predicates_answer_zero_rather_than_guess_out_of_range():
    tiny = np.array([[0, 0, 0], [1e-200, 0, 0], [0, 1e-200, 0], [0, 0, 1e-200]])
    assert _core.testing.orient3d(*tiny) == 0
    assert _core.testing.orient3d(*tiny * 1e190) == 1


def meets_by_linear_program(V, a, b):
    """Whether two triangles share a point beyond common vertices, by linear programming."""
    shared = [(i, j) for i in range(3) for j in range(3) if a[i] == b[j]]
    cost = np.zeros(6)
    for i, j in shared:
        cost[i] += 1.0
        cost[3 + j] += 1.0
    equal = np.zeros((5, 6))
    equal[:3, :3], equal[:3, 3:] = V[a].T, -V[b].T
    equal[3, :3] = equal[4, 3:] = 1.0
    result = linprog(cost, A_eq=equal, b_eq=[0, 0, 0, 1, 1], bounds=(0, None))
    return result.status == 0 and (not shared or result.fun < 2.0 - 1e-7)


@pytest.mark.parametrize("shared", [0, 1, 2])
def test_triangle_pairs_against_linear_programming(shared):
    rng = np.random.default_rng(shared)
    seen = {True: 0, False: 0}
    for _ in range(250):
        V = rng.integers(0, 4, (6 - shared, 3)).astype(float)
        a, b = np.arange(3), np.r_[np.arange(shared), np.arange(3, 6 - shared)]
        b = rng.permutation(b)
        areas = [np.linalg.norm(np.cross(V[f[1]] - V[f[0]], V[f[2]] - V[f[0]])) for f in (a, b)]
        if min(areas) == 0 or len(np.unique(V, axis=0)) < len(V):
            continue
        found = len(_core.certificate.crossing_faces(V, np.array([a, b], np.int32), 10)) > 0
        assert found == meets_by_linear_program(V, a, b), (V, a, b)
        seen[found] += 1
    assert min(seen.values()) > 10


def test_crossings_do_not_depend_on_the_search_tree():
    rng = np.random.default_rng(5)
    V = rng.uniform(0, 1, (300, 3))
    F = rng.permutation(300).reshape(100, 3).astype(np.int32)
    pairs = {tuple(pair) for pair in _core.certificate.crossing_faces(V, F, 10_000)}
    brute = {
        (i, j)
        for i in range(100)
        for j in range(i + 1, 100)
        if len(_core.certificate.crossing_faces(V, F[[i, j]], 1))
    }
    assert pairs == brute and len(brute) > 20


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e75])
def test_pieces_of_a_flat_face_do_not_cross(size):
    """They are coplanar but for the rounding of their corners; what runs through them crosses."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        corners = rng.normal(size=(3, 3)) * [1.0, 1.0, 0.02]
        corners = corners @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        weights = np.array([(i, j, 8 - i - j) for i in range(9) for j in range(9 - i)]) / 8.0
        number = {tuple(w[:2]): k for k, w in enumerate((8 * weights).astype(int))}
        pieces = [
            [number[i + a, j + b] for a, b in around]
            for around in (((0, 0), (1, 0), (0, 1)), ((1, 0), (1, 1), (0, 1)))
            for i, j in number
            if all((i + a, j + b) in number for a, b in around)
        ]
        F = np.array(pieces, np.int32)
        points = size * (weights @ corners)
        assert len(F) == 64 and not len(_core.certificate.crossing_faces(points, F, 10))
        first, second, third = points[F[9]]
        normal = np.cross((second - first) / size, (third - first) / size) * size
        through = points[F[9]].mean(axis=0) + np.array([[-1.0], [1.0], [2.0]]) * normal
        through[2] += 0.5 * (second - first)
        F = np.concatenate([F, np.arange(3, dtype=np.int32)[None] + len(points)])
        found = _core.certificate.crossing_faces(np.concatenate([points, through]), F, 100)
        assert [9, 64] in found.tolist()


# Maps that are bijections


def test_identity_and_rigid_motions(solid):
    certificate = certify(solid, solid.V, TORUS)
    assert certificate.certified, certificate.summary()
    assert certificate.checks["boundary_graph"]
    assert certificate.quantities["winding"] == 1
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    moved = certify(solid, solid.V @ turn.T + 5.0)
    assert moved.certified and moved.checks["boundary_embedded"]


def test_dehn_twist_is_a_bijection(solid):
    fine = samples.solid_torus(20_000)
    assert certify(fine, twisted(fine, 1, shear=1.0), TORUS).certified


@pytest.mark.parametrize("make", [samples.knot_tube, samples.vertebra_like, samples.ball])
def test_any_embedded_solid_onto_itself(make):
    mesh = make() if make is samples.ball else make(6_000)
    assert certify(mesh, mesh.V * [1.0, 2.0, 3.0]).certified


def test_fallback_where_the_boundary_is_no_graph():
    # Bumps seen from a circle far off their centre: embedded, but not a graph.
    bumpy = samples.bumpy_torus(6_000, amplitude=0.5, waves=(1, 5))
    certificate = certify(bumpy, bumpy.V, Torus(3.6, 0.5), tolerance=10.0)
    assert not certificate.checks["boundary_graph"]
    assert certificate.checks["boundary_embedded"]
    # Of its surface, the ids of a refusal are those of the reason, not of what failed first.
    refused = certify(bumpy.surface, bumpy.surface.V, Torus(3.6, 0.5))
    assert "folded" in refused.reason and refused.ids["boundary_graph"]
    with pytest.raises(CertificationError) as caught:
        require_certified(refused, "it")
    assert caught.value.ids == refused.ids["boundary_oriented"] != refused.ids["boundary_graph"]


def test_surface_maps(solid):
    surface = samples.torus_surface(30, 12)
    assert certify(surface, surface.V, TORUS).certified
    assert certify(samples.sphere(3), samples.sphere(3).V * [1.0, 2.0, 0.5]).certified


def test_every_mesh_on_disk_is_certified_onto_itself(load_solid):
    for name in ("kitten_jigsaw_small", "vertebra_L3_small", "rocker_arm_small"):
        mesh = load_solid(name)
        assert certify(mesh, mesh.V).certified


# Maps that are not


def test_one_inverted_tet(solid):
    inner = np.flatnonzero(solid.boundary_index < 0)[7]
    touching = np.flatnonzero((solid.T == inner).any(axis=1))
    tet = touching[0]
    others = solid.T[tet][solid.T[tet] != inner]
    image = solid.V.copy()
    image[inner] += 1.0001 * (image[others].mean(axis=0) - image[inner])
    certificate = certify(solid, image, TORUS)
    assert not certificate.certified
    assert tet in certificate.ids["image_positive"]
    assert set(certificate.ids["image_positive"]) <= set(touching)
    assert "not positive" in certificate.reason


@pytest.mark.parametrize("scale", [1e-102, 1e-150, 1e-300])
def test_what_is_too_small_for_the_tests_is_said_to_be_that(scale):
    ball = samples.ball(2)
    for tiny in (certify(ball, ball.V * scale), certify(TetMesh(ball.V * scale, ball.T), ball.V)):
        assert not tiny.certified
        assert "volume too small for exact tests" in tiny.reason and "scale" in tiny.reason
    surface = certify(ball.surface, ball.surface.V * scale)
    assert surface.reason == ("the boundary image is too small for exact tests; scale the points")


@pytest.mark.parametrize("scale", [1e-90, 1e-150])
def test_tets_turned_over_are_named_before_those_that_are_too_small(scale):
    ball = samples.ball(3)
    inside = ball.boundary_index < 0
    image = np.where(inside[:, None], scale * ball.V, ball.V)
    assert "image volume too small for exact tests" in certify(ball, image).reason
    tet = np.flatnonzero(inside[ball.T].sum(axis=1) == 1)[0]
    corners = ball.T[tet]
    image[corners[inside[corners]]] = 2.0 * ball.V[corners[~inside[corners]]].mean(axis=0)
    found = certify(ball, image)
    ids = found.ids["image_positive"]
    signs = [ref.exact_orient3d(*image[ball.T[i]]) for i in ids]
    n_turned = sum(sign < 0 for sign in signs)
    assert tet in ids[:n_turned] and max(signs[:n_turned]) < 0 < min(signs[n_turned:])
    assert found.reason.startswith(f"image volume not positive: {n_turned} tets")


def test_flat_tet_is_refused(solid):
    tet = solid.T[100]
    image = solid.V.copy()
    image[tet[0]] = image[tet[1]]
    certificate = certify(solid, image)
    assert not certificate.certified and 100 in certificate.ids["image_positive"]


def test_mirror_image_is_refused(solid):
    certificate = certify(solid, solid.V * [1.0, 1.0, -1.0], TORUS)
    assert not certificate.certified
    assert len(certificate.ids["image_positive"]) > 0


def test_double_cover_with_all_tets_positive_is_refused():
    fine = samples.solid_torus(30_000)
    image = twisted(fine, 2)
    assert TetMesh(image, fine.T).tet_volumes.min() > 0
    on_torus = certify(fine, image, TORUS)
    assert on_torus.checks["image_positive"] and on_torus.checks["boundary_graph"]
    assert not on_torus.certified and not on_torus.checks["covers_once"]
    assert on_torus.quantities["winding"] == 2
    anywhere = certify(fine, image)
    assert not anywhere.certified and not anywhere.checks["boundary_embedded"]


def test_solid_overlapping_itself_with_all_tets_positive_is_refused():
    # A tube along a curve that goes round twice and crosses itself once, in the plane.
    fine = samples.solid_torus(30_000)
    u, v, s = TORUS.coordinates(fine.V)
    rho = 5.0 + 1.5 * np.cos(u) + 0.7 * s * np.cos(v)
    image = np.stack([rho * np.cos(2 * u), rho * np.sin(2 * u), 0.7 * s * np.sin(v)], axis=1)
    assert TetMesh(image, fine.T).tet_volumes.min() > 0
    certificate = certify(fine, image)
    assert not certificate.certified
    assert certificate.checks["image_positive"] and not certificate.checks["boundary_embedded"]


def test_fold_of_the_boundary_is_refused():
    surface = samples.torus_surface(30, 12)
    u, v, s = TORUS.coordinates(surface.V)
    u[100] += 0.5
    certificate = certify(surface, TORUS.xi(u, v, s), TORUS)
    assert not certificate.certified
    bad = certificate.ids["boundary_oriented"]
    assert bad and set(bad) <= set(np.flatnonzero((surface.F == 100).any(axis=1)))


def test_boundary_off_the_torus_is_refused(solid):
    image = solid.V.copy()
    vertex = solid.boundary_vertices[3]
    image[vertex] += 1e-6 * (image[vertex] - [3.0, 0.0, 0.0])
    certificate = certify(solid, image, TORUS)
    assert not certificate.certified and certificate.ids["on_torus"] == (3,)
    assert certify(solid, image, TORUS, tolerance=1e-3).certified


def test_bad_sources_are_refused(solid):
    V = solid.V.copy()
    inner = np.flatnonzero(solid.boundary_index < 0)[7]
    V[inner] += [0.0, 0.0, 2.5]
    inverted = certify(TetMesh(V, solid.T), solid.V)
    assert not inverted.certified and inverted.ids["source_positive"]
    turned = solid.T.copy()
    turned[5] = turned[5][[1, 0, 2, 3]]
    misoriented = certify(TetMesh(solid.V, turned), solid.V)
    assert not misoriented.certified and misoriented.ids["topology"] == (5,)
    open_surface = TriMesh(*(lambda s: (s.V, s.F[1:]))(samples.torus_surface(12, 6)))
    assert not certify(open_surface, open_surface.V).checks["topology"]


# The rest


def test_same_answer_when_relabelled(solid):
    rng = np.random.default_rng(1)
    new = rng.permutation(len(solid.V))
    V = np.empty_like(solid.V)
    V[new] = solid.V
    relabelled = TetMesh(V, new[solid.T][rng.permutation(len(solid.T))])
    assert certify(relabelled, V, TORUS).certified


def test_files(tmp_path, solid):
    path = tmp_path / "map.npz"
    np.savez(path, V=solid.V, T=solid.T, image=solid.V)
    assert certify_file(path).certified
    assert certify_file(path, TORUS).checks["boundary_graph"]
    np.savez(path, V=solid.V, T=solid.T, image=solid.V * [1, 1, -1], torus=[3.0, 1.0])
    certificate = certify_file(path)
    assert not certificate.certified and "on_torus" in certificate.checks
    np.savez(path, V=solid.V, T=solid.T)
    with pytest.raises(FileFormatError):
        certify_file(path)


def test_of_one_source_many_maps_are_certified_with_one_search_for_crossings(monkeypatch):
    crossed = samples.solid_torus(600)
    moved = crossed.V.copy()
    moved[crossed.boundary_vertices[0]] *= -1.0  # across the hole, through all that is there
    solids = [samples.solid_torus(600), TetMesh(moved, crossed.T)]
    search, searched = _core.certificate.crossing_faces, []
    monkeypatch.setattr(
        _core.certificate,
        "crossing_faces",
        lambda V, F, most: searched.append(V) or search(V, F, most),
    )
    for solid, embedded in zip(solids, (True, False), strict=True):
        searched.clear()
        found = [certify(solid, crossed.V, torus) for torus in (TORUS, TORUS, None)]
        assert [c.checks["source_embedded"] for c in found] == 3 * [embedded]
        assert len({c.ids.get("source_embedded") for c in found}) == 1
        assert sum(V is solid.surface.V for V in searched) == 1


def test_bad_arguments(solid):
    with pytest.raises(ArrayError):
        certify(solid, solid.V[1:])
    with pytest.raises(NonFiniteError):
        certify(solid, np.full_like(solid.V, np.nan))
    with pytest.raises(OptionError):
        certify(solid, solid.V, tolerance=-1.0)


def test_report(solid):
    import json

    certificate = certify(solid, solid.V, TORUS)
    assert json.loads(json.dumps(certificate.to_dict()))["certified"] is True
    assert "image positive" in certificate.summary()


def test_wide_faces_of_a_fat_torus_are_judged_as_their_points_say():
    """Faces over up to 175 degrees of u: proven just where the normal looks outward all along."""
    rng, R = np.random.default_rng(4), 1.05
    seen = set()
    for _ in range(4000):
        wide = np.radians(rng.uniform(60.0, 175.0))
        u = rng.uniform(0.0, 2.0 * np.pi) + wide * np.array([0.0, rng.uniform(0.0, 1.0), 1.0])
        v = np.pi + rng.uniform(-1.0, 1.0, 3)
        way = np.column_stack([np.cos(u), np.sin(u), 0.0 * u])
        points = way * (R + np.cos(v))[:, None]
        points[:, 2] = np.sin(v)
        faces = np.array([[0, 1, 2] if rng.random() < 0.5 else [0, 2, 1]], np.int32)
        a, b, c = points[faces[0]]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        along = np.linspace(u[0], u[2], 2001)
        circle = R * (normal[0] * np.cos(along) + normal[1] * np.sin(along))
        outward = float((normal @ a - circle).min())
        if abs(outward) < 1e-5:
            continue
        proven = not len(_core.certificate.torus_graph(points, faces, R).bad)
        assert proven == (outward > 0.0)
        narrow = bool((way @ way.sum(axis=0) > 0.0).all())
        strictly = not len(_core.certificate.torus_graph(points, faces, R, strict=True).bad)
        assert strictly == (proven and narrow)
        seen.add((proven, narrow))
    assert seen == {(True, True), (True, False), (False, True), (False, False)}


def test_a_heap_of_faces_is_no_square_of_them():
    surface = samples.torus_surface(200, 100)
    heap = surface.V.copy()
    heap[:9000] = heap[0]
    start = time.process_time()
    assert len(_core.certificate.crossing_faces(heap, surface.F, 1000)) == 1000
    assert time.process_time() - start < 5.0
    small = samples.torus_surface(30, 12)
    turned = small.V.copy()
    turned[[0, 5]] *= -1.0
    pairs = _core.certificate.crossing_faces(turned, small.F, 10**6)
    assert len(pairs) > 7
    np.testing.assert_array_equal(_core.certificate.crossing_faces(turned, small.F, 7), pairs[:7])
