"""Random index soups: the diagnosis against definitions read aloud, and no crash on anything."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import shapes
from stretchmap.errors import MeshError
from stretchmap.mesh.meshes import TetMesh, TriMesh
from stretchmap.mesh.overconstrained import overconstrained_elements
from stretchmap.mesh.refinement import refine_overconstrained


def soup(seed: int, width: int, base: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Some elements of a sound mesh, some random ones, some copies, some turned."""
    rng = np.random.default_rng(seed)
    kept = base[rng.random(len(base)) < rng.choice([0.3, 0.8, 0.97, 1.0])]
    wild = rng.integers(0, n, (rng.integers(0, 4), width))
    elements = np.concatenate([kept, wild, kept[: rng.integers(0, 3)]])
    if len(elements) == 0:
        elements = base[:1]
    turned = rng.random(len(elements)) < 0.05
    elements[turned] = elements[turned][:, [1, 0, *range(2, width)]]
    points = rng.standard_normal((n + rng.integers(0, 2), 3))
    return points, rng.permutation(elements).astype(np.int32)


def naive_kept(elements: np.ndarray) -> tuple[list[int], list[int], list[int]]:
    """Ids of elements with a repeated vertex, of later copies, and of all others."""
    repeated, copies, kept, seen = [], [], [], set()
    for e, row in enumerate(elements.tolist()):
        if len(set(row)) < len(row):
            repeated.append(e)
        elif frozenset(row) in seen:
            copies.append(e)
        else:
            kept.append(e)
            seen.add(frozenset(row))
    return repeated, copies, kept


def groups(items: list, linked) -> int:
    """Number of connected groups of items."""
    left, count = set(range(len(items))), 0
    while left:
        count += 1
        stack = [left.pop()]
        while stack:
            i = stack.pop()
            near = [j for j in left if linked(items[i], items[j])]
            left.difference_update(near)
            stack.extend(near)
    return count


def counted(faces: list[tuple]) -> Counter:
    return Counter(tuple(sorted(pair)) for f in faces for pair in combinations(f, 2))


def fans(faces: list[tuple], vertex: int) -> int:
    """Groups of faces at a vertex, linked across shared edges at that vertex."""
    around = [set(f) - {vertex} for f in faces if vertex in f]
    return groups(around, lambda a, b: bool(a & b))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_surface_soup(seed):
    base = shapes.torus(6, 4)[1]
    points, faces = soup(seed, 3, base, 24)
    found = TriMesh(points, faces).diagnose()
    repeated, copies, kept = naive_kept(faces)
    assert found.repeated.tolist() == repeated
    assert found.duplicates.tolist() == copies
    rows = [tuple(row) for row in faces[kept].tolist()]
    edges = counted(rows)
    assert {tuple(e) for e in found.border_edges.tolist()} == {e for e in edges if edges[e] == 1}
    crowded = {e for e in edges if edges[e] > 2}
    assert {tuple(e) for e in found.nonmanifold_edges.tolist()} == crowded
    used = sorted({v for row in rows for v in row})
    assert found.nonmanifold_vertices.tolist() == [v for v in used if fans(rows, v) > 1]
    assert found.unreferenced.tolist() == sorted(set(range(len(points))) - set(used))
    assert found.euler.sum() == len(used) - len(edges) + len(rows)
    assert found.n_components == groups(rows, lambda a, b: bool(set(a) & set(b)))
    try:
        repaired = TriMesh(points, faces, orient=True).diagnose()
        assert len(repaired.not_orientable) > 0 or len(repaired.misoriented) == 0
        TriMesh(points, faces).require_genus_one()
    except MeshError as error:
        assert str(error)


def is_ball_or_half(tets: list[tuple], vertex: int) -> bool:
    """The link of a vertex is a sphere or a disk, checked as a surface of its own."""
    link = [tuple(v for v in tet if v != vertex) for tet in tets if vertex in tet]
    edges = counted(link)
    if max(edges.values()) > 2:
        return False
    corners = {v for face in link for v in face}
    if any(fans(link, v) > 1 for v in corners):
        return False
    if groups(link, lambda a, b: bool(set(a) & set(b))) > 1:
        return False
    rim = [e for e in edges if edges[e] == 1]
    loops = groups(rim, lambda a, b: bool(set(a) & set(b)))
    return loops <= 1 and len(corners) - len(edges) + len(link) == 2 - loops


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_solid_soup(seed):
    points, base = shapes.cubes(shapes.RING)
    points, tets = soup(seed, 4, base, len(points))
    solid = TetMesh(points, tets)
    found = solid.diagnose()
    repeated, copies, kept = naive_kept(tets)
    assert found.repeated.tolist() == repeated
    assert found.duplicates.tolist() == copies
    rows = [tuple(row) for row in tets[kept].tolist()]
    faces = Counter(tuple(sorted(face)) for row in rows for face in combinations(row, 3))
    crowded = {face for face in faces if faces[face] > 2}
    assert {tuple(sorted(face)) for face in found.nonmanifold_faces.tolist()} == crowded
    rim = counted([face for face in faces if faces[face] == 1])
    pinched = {edge for edge in rim if rim[edge] > 2}
    assert {tuple(edge) for edge in found.nonmanifold_edges.tolist()} == pinched
    explained = {v for item in (*crowded, *pinched) for v in item}
    used = sorted({v for row in rows for v in row})
    unsound = [v for v in used if v not in explained and not is_ball_or_half(rows, v)]
    assert found.nonmanifold_vertices.tolist() == unsound
    assert found.unreferenced.tolist() == sorted(set(range(len(points))) - set(used))
    edges = counted(rows)
    assert found.euler.sum() == len(used) - len(edges) + len(faces) - len(rows)
    assert found.n_components == groups(rows, lambda a, b: bool(set(a) & set(b)))
    TetMesh(points, tets, orient=True).diagnose()
    for action in (overconstrained_elements, refine_overconstrained, TetMesh.require_solid_torus):
        try:
            action(solid)
        except MeshError as error:
            assert str(error)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_tiny_soups(n):
    """Every element that can be made of a few vertices."""
    points = np.random.default_rng(0).random((n, 3))
    corners = np.stack(np.meshgrid(*4 * [np.arange(n)]), axis=-1).reshape(-1, 4)
    solid = TetMesh(points, corners)
    assert solid.diagnose().n_components <= 1
    assert TriMesh(points, corners[:, :3]).diagnose().n_components <= 1
    with pytest.raises(MeshError):
        solid.require_solid_torus()
    for row in corners:
        TetMesh(points, [row], orient=True).diagnose().summary()
