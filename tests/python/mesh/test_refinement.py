"""Splitting of overconstrained elements: nothing harmful is left, nothing else has changed."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import shapes
from stretchmap import _core
from stretchmap.errors import ArrayError, NonManifoldError
from stretchmap.mesh.meshes import TetMesh
from stretchmap.mesh.overconstrained import overconstrained_elements
from stretchmap.mesh.refinement import refine_overconstrained

JIGSAW = ["bob_jigsaw_small", "kitten_jigsaw_small", "rocker_arm_jigsaw", "petal_ring_synth_jigsaw"]


def cubes(filled) -> TetMesh:
    return TetMesh(*shapes.cubes(filled))


def capped(solid: TetMesh, faces: list[int]) -> TetMesh:
    """Put a tet on some boundary faces: a corner with three faces outside."""
    surface = solid.surface
    corners = solid.boundary_vertices[surface.F[faces]]
    normals = np.cross(
        solid.V[corners[:, 1]] - solid.V[corners[:, 0]],
        solid.V[corners[:, 2]] - solid.V[corners[:, 0]],
    )
    tips = solid.V[corners].mean(axis=1) + 0.1 * normals
    ids = np.arange(len(faces)) + solid.n_vertices
    tets = np.column_stack([corners, ids])
    return TetMesh(np.vstack([solid.V, tips]), np.vstack([solid.T, tets]))


def naive_overconstrained(solid: TetMesh) -> tuple[set, set, set]:
    """The definition read aloud: interior edges, faces and tets with boundary vertices only."""
    faces: dict[tuple, int] = {}
    for tet in solid.T.tolist():
        for k in range(4):
            face = tuple(sorted(tet[:k] + tet[k + 1 :]))
            faces[face] = faces.get(face, 0) + 1
    rim = [face for face, count in faces.items() if count == 1]
    outside = {v for face in rim for v in face}
    rim_edges = {pair for a, b, c in rim for pair in ((a, b), (b, c), (a, c))}
    edges = {
        pair
        for a, b, c in faces
        for pair in ((a, b), (b, c), (a, c))
        if outside.issuperset(pair) and pair not in rim_edges
    }
    inner = {face for face, count in faces.items() if count == 2 and outside.issuperset(face)}
    full = {tuple(tet) for tet in solid.T.tolist() if outside.issuperset(tet)}
    return edges, inner, full


def check(solid: TetMesh) -> None:
    done = refine_overconstrained(solid)
    new = done.solid
    n = solid.n_vertices
    np.testing.assert_array_equal(new.V[:n], solid.V)
    np.testing.assert_array_equal(new.V, done.prolong(solid.V))
    np.testing.assert_array_equal(new.boundary_vertices, solid.boundary_vertices)
    rows = [np.unique(np.sort(mesh.surface.F, axis=1), axis=0) for mesh in (new, solid)]
    np.testing.assert_array_equal(*rows)
    assert (np.diff(done.parent_tet) >= 0).all()
    assert new.tet_volumes.min() > 0
    shares = np.bincount(done.parent_tet, new.tet_volumes, minlength=solid.n_tets)
    np.testing.assert_allclose(shares, solid.tet_volumes, atol=1e-14 * solid.tet_volumes.max())
    assert new.n_tets == solid.n_tets + done.n_added_tets
    # What it is for.
    assert len(overconstrained_elements(new)) == 0
    outside = new.boundary_index >= 0
    assert not outside[new.T].all(axis=1).any()
    assert np.bincount(new.boundary_tets).max() == 1
    before, after = solid.diagnose(), new.diagnose()
    assert after.defects == before.defects == ()
    np.testing.assert_array_equal(after.euler, before.euler)
    np.testing.assert_array_equal(after.genus, before.genus)


@pytest.mark.parametrize("filled", [shapes.BALL, shapes.RING, shapes.DOUBLE, shapes.box(3, 3, 3)])
def test_cubes(filled):
    check(cubes(filled))


def test_corners_with_three_faces_outside():
    solid = cubes(shapes.RING)
    faces = list(range(0, solid.surface.n_faces, 7))
    spiky = capped(solid, faces)
    assert np.bincount(spiky.boundary_tets).max() == 3
    assert len(overconstrained_elements(spiky).faces) > 0
    check(spiky)
    inner = cubes(shapes.box(4, 4, 4))
    check(capped(inner, [0, 9]))


def test_overconstrained_elements_are_what_the_definition_says():
    solid = capped(cubes(shapes.box(3, 3, 2)), [0, 4, 30])
    edges, faces, tets = naive_overconstrained(solid)
    found = overconstrained_elements(solid)
    assert {tuple(edge) for edge in found.edges.tolist()} == edges
    hidden = {f for f in faces if any(set(e) <= set(f) for e in edges)}
    assert {tuple(sorted(face)) for face in found.faces.tolist()} == faces - hidden
    named = {tuple(tet) for tet in solid.T[found.tets].tolist()}
    assert tets <= named
    assert naive_overconstrained(refine_overconstrained(solid).solid) == (set(), set(), set())


def test_nothing_to_do_returns_the_input():
    solid = refine_overconstrained(cubes(shapes.RING)).solid
    again = refine_overconstrained(solid)
    assert again.solid is solid
    assert (again.n_split, again.n_added_tets) == (0, 0)


def test_same_input_same_bits_and_relabelling():
    solid = capped(cubes(shapes.RING), [3, 8])
    first, second = refine_overconstrained(solid), refine_overconstrained(solid)
    np.testing.assert_array_equal(first.solid.T, second.solid.T)
    rng = np.random.default_rng(0)
    rank = rng.permutation(solid.n_vertices).astype(np.int32)
    points = np.empty_like(solid.V)
    points[rank] = solid.V
    other = refine_overconstrained(TetMesh(points, rank[solid.T[rng.permutation(solid.n_tets)]]))
    assert other.n_split == first.n_split
    check(TetMesh(points, rank[solid.T]))


def _midpoints_in_pieces(done, solid, lengths) -> int:
    """Input tets whose pieces all have the midpoint of the longest of its edges that are halved."""
    number = {tuple(ends): k for k, ends in enumerate(done.parents.tolist())}
    seen = 0
    for tet, corners in enumerate(solid.T.tolist()):
        pairs = [(min(p), max(p)) for p in combinations(corners, 2)]
        halved = sorted((p for p in pairs if p in number), key=lambda p: -lengths(p))
        # Those of nearly one length are halved in any order.
        if len(halved) > 1 and lengths(halved[0]) > 1.05 * lengths(halved[1]):
            pieces = done.solid.T[done.parent_tet == tet]
            assert (pieces == solid.n_vertices + number[halved[0]]).any(axis=1).all()
            seen += 1
    return seen


def test_the_longest_edge_of_a_tet_is_halved_first():
    solid = cubes(shapes.RING)
    points = solid.V @ np.diag([1.0, 1.3, 1.9]) @ np.array([[1, 0.2, 0], [0, 1, 0.1], [0.3, 0, 1]])
    for V, seen in ((points, None), (solid.V, points)):
        bent = TetMesh(V, solid.T)
        done = refine_overconstrained(bent, seen)

        def length(pair):
            return np.linalg.norm(points[pair[0]] - points[pair[1]])

        assert _midpoints_in_pieces(done, bent, length) > 20
        np.testing.assert_array_equal(done.solid.V, done.prolong(V))


def test_rounding_does_not_decide_which_edge_is_halved_first():
    """Edges of a grid are as long as each other, wherever it lies."""
    solid, expected = cubes(shapes.RING), refine_overconstrained(cubes(shapes.RING)).solid.T
    rng = np.random.default_rng(5)
    for scale in (1.0, 1e-30, 3e7):
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        moved = TetMesh(scale * (solid.V @ turn + rng.standard_normal(3)), solid.T)
        np.testing.assert_array_equal(refine_overconstrained(moved).solid.T, expected)


def test_edges_from_the_longest_to_the_shortest():
    points = np.zeros((7, 3))
    points[1:6, 0] = [1.0, 1.0 + 1e-9, 5.0, 2.0, np.sqrt(2.0)]
    edges = np.array([[0, 1], [0, 6], [0, 2], [0, 3], [0, 4], [5, 0]], np.int32)
    order = _core.mesh.longest_first(points, edges)
    np.testing.assert_array_equal(order, [3, 4, 5, 0, 2, 1])  # of no length at all: the last
    assert len(_core.mesh.longest_first(points, edges[:0])) == 0
    np.testing.assert_array_equal(_core.mesh.longest_first(0.0 * points, edges), np.arange(6))


def test_prolong_wants_one_row_per_input_vertex():
    done = refine_overconstrained(cubes(shapes.RING))
    with pytest.raises(ArrayError):
        done.prolong(np.zeros(3))
    with pytest.raises(ArrayError, match="real numbers"):
        done.prolong(["a"] * (done.solid.n_vertices - done.n_split))


def test_bad_solids_are_refused():
    solid = cubes(shapes.RING)
    face = solid.T[0, :3]
    third = np.vstack([solid.T, *([*face, solid.n_vertices + k] for k in range(2))])
    points = np.vstack([solid.V, [[9, 9, 9], [8, 8, 8]]])
    with pytest.raises(NonManifoldError) as caught:
        refine_overconstrained(TetMesh(points, third))
    assert 0 in caught.value.ids


@pytest.mark.parametrize("name", JIGSAW)
def test_meshes_with_slivers(name, load_solid):
    solid = load_solid(name)
    assert len(overconstrained_elements(solid)) > 0
    check(solid)
