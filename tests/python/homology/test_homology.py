"""Homology: periods, linking numbers, labels by two routes, shortest loops."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

import shapes
import tubes
from stretchmap import TetMesh, TriMesh, _core, homology_basis
from stretchmap.errors import (
    ArrayError,
    GenusError,
    MeshError,
    SelfIntersectionError,
    SolverError,
)
from stretchmap.homology.integer import complement, integer_inverse, integer_kernel, reduced_basis

RING = np.arange(40) * 2 * np.pi / 40


def lines(nu, nv):
    """The two grid lines of a tube: the long way round and the short way."""
    return np.arange(nu) * nv, np.arange(nv)


@pytest.fixture(scope="module")
def double():
    return TetMesh(*shapes.cubes(shapes.DOUBLE.repeat(2, 0).repeat(2, 1).repeat(2, 2)))


# ---------------------------------------------------------------- exact integer algebra


def test_integer_kernel_spans_a_gapless_lattice():
    assert np.array_equal(integer_kernel([[2, 4]]) % 2, [[0, 1]])
    kernel = integer_kernel([[6, 10, 15]])
    assert kernel.shape == (2, 3)
    assert not (kernel @ [6, 10, 15]).any()
    minors = np.cross(kernel[0], kernel[1])
    assert np.gcd.reduce(minors) == 1
    assert integer_kernel(np.zeros((0, 3), int)).shape == (3, 3)
    assert integer_kernel(np.eye(2, dtype=int)).shape == (0, 2)


@given(st.integers(-50, 50), st.integers(-50, 50))
def test_complement_makes_a_unimodular_pair(p, q):
    if np.gcd(p, q) != 1:
        with pytest.raises(ValueError, match="primitive"):
            complement([p, q])
    else:
        assert round(np.linalg.det([complement([p, q]), [p, q]])) == 1


def test_integer_inverse_refuses_what_has_none():
    assert np.array_equal(integer_inverse([[2, 1], [1, 1]]), [[1, -1], [-1, 2]])
    with pytest.raises(ValueError, match="inverse"):
        integer_inverse([[2, 0], [0, 1]])


def test_reduced_basis_keeps_the_lattice_and_finds_its_short_vectors():
    rows = np.array([[1, 7, 0], [3, 22, 1]])
    reduced = reduced_basis(rows, np.eye(3))
    change = np.linalg.lstsq(rows.T.astype(float), reduced.T, rcond=None)[0]
    assert np.allclose(change, np.rint(change)) and abs(round(np.linalg.det(change))) == 1
    assert sorted((reduced**2).sum(axis=1)) == [2, 26]


# ---------------------------------------------------------------- generators and dual forms


@pytest.mark.parametrize(
    ("filled", "genus"),
    [
        (shapes.BALL, 0),
        (shapes.RING, 1),
        (shapes.DOUBLE, 2),
        (shapes.box(7, 5, 1, holes=((1, 1, 0), (3, 1, 0), (5, 1, 0), (1, 3, 0), (3, 3, 0))), 5),
    ],
)
def test_generators_and_forms_are_dual(filled, genus):
    surface = TetMesh(*shapes.cubes(filled)).surface
    basis = homology_basis(surface)
    assert basis.genus == genus and len(basis.generators) == 2 * genus
    for j, loop in enumerate(basis.generators):
        assert len(set(loop.tolist())) == len(loop)
        assert np.array_equal(basis.classes(loop), np.eye(2 * genus, dtype=int)[j])
    # Closed on every face.
    along = basis.dual_forms[:, surface.topology.edge.reshape(-1, 3)]
    sign = np.where(surface.F < np.roll(surface.F, -1, axis=1), 1, -1)
    assert not (along * sign).sum(axis=2).any()
    if genus:
        assert abs(round(np.linalg.det(basis.intersection))) == 1
    assert not (basis.intersection + basis.intersection.T).any()


def test_torus_forms_have_unit_periods_and_positive_orientation():
    surface = TriMesh(*shapes.torus(14, 9))
    basis = homology_basis(surface)
    forms = basis.torus_forms
    assert forms.dtype == np.int32
    assert np.array_equal(_core.homology.periods(surface.topology, forms, basis.longitude), [1, 0])
    assert np.array_equal(_core.homology.periods(surface.topology, forms, basis.meridian), [0, 1])
    wedge = _core.homology.wedge_matrix(surface.topology, forms.astype(float))
    assert np.array_equal(wedge, [[0, 1], [-1, 0]])
    # The angles themselves: u advances along the longitude exactly as v does along the meridian.
    long, short = lines(14, 9)
    u, v = (_core.homology.periods(surface.topology, forms, loop) for loop in (long, short))
    assert abs(u[0]) == 1 and u[1] == 0 and v[0] == 0 and u[0] == v[1]


# ---------------------------------------------------------------- linking numbers


def gauss_integral(p, q):
    """Solid angles of all pairs of segments over 4 pi: an independent second computation."""
    a, b = p[:, None] - q, np.roll(p, -1, axis=0)[:, None] - q
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)

    def half(x, y, z):
        n = [np.linalg.norm(w, axis=2) for w in (x, y, z)]
        dots = [(v * w).sum(axis=2) for v, w in ((x, y), (y, z), (z, x))]
        below = n[0] * n[1] * n[2] + dots[0] * n[2] + dots[1] * n[0] + dots[2] * n[1]
        return np.arctan2((x * np.cross(y, z)).sum(axis=2), below)

    return -(half(a, b, c) + half(a, c, d)).sum() / (2 * np.pi)


def torus_knot(n, p, q, tube=0.4, start=0.0):
    t = 2 * np.pi * np.arange(n) / n
    rho = 1 + tube * np.cos(q * t + start)
    return np.stack([rho * np.cos(p * t), rho * np.sin(p * t), tube * np.sin(q * t + start)], 1)


def test_linking_numbers_of_known_links():
    def ring(a, b, center):
        return np.outer(np.cos(RING), a) + np.outer(np.sin(RING), b) + center

    x, y, z = np.eye(3)
    flat = ring(x, y, 0)
    assert _core.testing.linking_number(flat, ring(x, z, x + 0.1 * y)) == -1
    assert _core.testing.linking_number(flat, ring(z, x, x + 0.1 * y)) == 1
    assert _core.testing.linking_number(flat, ring(x, z, 3 * x)) == 0
    # A curve that winds five times round the first while going round it once.
    rho = 1 + 0.3 * np.cos(5 * RING)
    coil = np.stack([rho * np.cos(RING), rho * np.sin(RING), 0.3 * np.sin(5 * RING)], axis=1)
    expected = tubes.projected_linking(flat, coil)
    assert abs(expected) == 5
    assert _core.testing.linking_number(flat, coil) == expected
    assert gauss_integral(flat, coil) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_linking_numbers_of_random_polygons(seed):
    p, q = np.random.default_rng(seed).normal(size=(2, 30, 3))
    number = _core.testing.linking_number(p, q)
    assert gauss_integral(p, q) == pytest.approx(number, abs=1e-9)
    assert tubes.projected_linking(p, q) == number == _core.testing.linking_number(q, p)
    assert _core.testing.linking_number(p[::-1].copy(), q) == -number


@pytest.mark.timing
def test_linking_numbers_of_long_polygons():
    """All pairs of 1e5 by 1e5 segments would take minutes."""
    n = 100_000
    axis, knot = torus_knot(n, 1, 0, 1e-3), torus_knot(n, 2, 3)
    jagged = torus_knot(n, 2, 3, start=1.3)
    jagged += np.random.default_rng(0).normal(scale=1 / n, size=(n, 3))
    start = time.perf_counter()
    assert abs(_core.testing.linking_number(axis, torus_knot(n, 1, 2000))) == 2000
    assert abs(_core.testing.linking_number(knot, jagged)) == 6  # two strands of each, p q
    assert _core.testing.linking_number(axis, torus_knot(n, 1, 0, 1e-3, 0.1)) == 0
    assert time.perf_counter() - start < 5.0


def test_polygons_that_touch_have_no_linking_number():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    with pytest.raises(SolverError, match="touch"):
        _core.testing.linking_number(square, square + np.array([0.5, 0, 0]))


@pytest.mark.parametrize("curve", [tubes.circle, tubes.trefoil, tubes.figure_eight])
@pytest.mark.parametrize("twist", [0, 1, -2, 5])
def test_linking_matrix_of_framed_tubes(curve, twist):
    nu, nv = 140, 8
    points, faces = tubes.tube(curve, nu, nv, twist=twist)
    surface = TriMesh(points, faces)
    long, short = lines(nu, nv)
    matrix = _core.homology.linking_matrix(surface.topology, surface.V, [long, short])
    center = curve(2 * np.pi * np.arange(nu) / nu)
    framing = {"circle": 0, "trefoil": -3, "figure_eight": 0}[curve.__name__] - twist
    assert tubes.projected_linking(points[long], center) == framing
    assert np.array_equal(matrix, [[framing, -1], [0, 0]])

    basis = homology_basis(surface)
    meridian = basis.classes(short)
    assert np.array_equal(np.abs(basis.torus_classes[1]), np.abs(meridian))
    # The tunnel class is the long line less its framing: it links nothing pushed outward.
    tunnel = basis.classes(long) * (basis.classes(long) @ basis.intersection @ meridian)
    seifert = tunnel + framing * meridian
    assert np.array_equal(np.abs(basis.tunnel_classes[0]), np.abs(seifert))


def test_twisted_torus_has_a_seifert_longitude_of_class_1_2():
    points, faces = tubes.tube(tubes.circle, 60, 10, twist=-2)
    surface = TriMesh(points, faces)
    basis = homology_basis(surface)
    forms = np.linalg.inv([basis.classes(loop) for loop in lines(60, 10)]).T
    assert np.array_equal(np.abs(np.rint(forms @ basis.tunnel_classes[0])), [1, 2])
    # Neither is the longitude the long grid line: that one would leave a double Dehn twist.
    assert np.array_equal(basis.torus_classes[0], basis.tunnel_classes[0])


def test_numbering_start_and_scale_do_not_matter():
    points, faces = tubes.tube(tubes.trefoil, 100, 7, twist=1)
    rng = np.random.default_rng(3)
    reference = homology_basis(TriMesh(points, faces))
    for scale in (1e-6, 1.0, 1e6):
        order = rng.permutation(len(points))
        rank = np.argsort(order)
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        moved = TriMesh(scale * points[order] @ turn + 3 * scale, rank[faces])
        basis = homology_basis(moved)
        for name in ("meridian", "longitude"):
            loop, same = getattr(reference, name), getattr(basis, name)
            assert basis.length(same) == pytest.approx(scale * reference.length(loop), rel=1e-9)
            # The same class, up to turning both round.
            found = reference.classes(order[same])
            assert np.array_equal(np.abs(found), np.abs(reference.classes(loop)))


# ---------------------------------------------------------------- handle and tunnel by two routes


@pytest.mark.parametrize("filled", [shapes.RING, shapes.DOUBLE], ids=["ring", "double"])
def test_solid_and_linking_agree(filled):
    solid = TetMesh(*shapes.cubes(filled))
    by_linking, by_solid = homology_basis(solid.surface), homology_basis(solid.surface, solid)
    assert np.array_equal(by_linking.handle_classes, by_solid.handle_classes)
    assert np.array_equal(by_linking.tunnel_classes, by_solid.tunnel_classes)


def test_rings_linked_like_a_chain():
    solid = TetMesh(*shapes.cubes(linked_chain()))
    surface = solid.surface
    basis, by_solid = homology_basis(surface), homology_basis(surface, solid)
    assert basis.genus == 2
    stacked = np.vstack([basis.handle_classes, by_solid.handle_classes])
    assert np.linalg.matrix_rank(stacked) == 2
    # Tunnel i runs along ring i and goes once round the other ring, else it would not bound
    # outside: the off-diagonal Seifert form of the two long directions is one in size.
    mixed = basis.tunnel_classes @ basis.linking @ basis.tunnel_classes.T
    assert not mixed.any()
    pairing = basis.tunnel_classes @ basis.intersection @ basis.handle_classes.T
    assert np.array_equal(pairing, np.eye(2, dtype=int))
    along = [_core.testing.linking_number(*center_lines())]
    assert np.abs(along) == 1


def linked_chain():
    """Two square rings of cubes, each through the hole of the other, and a bridge between them."""
    filled = np.zeros((10, 7, 7), bool)
    filled[0:7, 0:7, 3] = True
    filled[1:6, 1:6, 3] = False
    filled[3:10, 3, [0, 6]] = True
    filled[[3, 9], 3, :] = True
    filled[7:9, 3, 3] = True
    return filled


def center_lines():
    first = np.array([[0, 0, 3], [6, 0, 3], [6, 6, 3], [0, 6, 3]], float)
    second = np.array([[3, 3, 0], [9, 3, 0], [9, 3, 6], [3, 3, 6]], float)
    return first, second


@pytest.mark.parametrize("name", ["bob_small", "kitten_small", "twisted_tdem", "knot_8000"])
def test_solid_and_linking_agree_on_meshes(name, load_solid):
    solid = load_solid(name)
    by_linking, by_solid = homology_basis(solid.surface), homology_basis(solid.surface, solid)
    assert np.array_equal(by_linking.torus_classes, by_solid.torus_classes)
    knotted = {"knot_8000": 8, "twisted_tdem": 1}.get(name, 0)
    longitude, meridian = by_linking.torus_classes
    gap = by_linking.tunnel_classes[0] - longitude
    assert np.array_equal(np.abs(gap), knotted * np.abs(meridian))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
@example(91)  # a generator that cuts the corner of a triangle on its left
def test_solid_cohomology_does_not_depend_on_numbering(seed):
    points, tets = shapes.cubes(shapes.DOUBLE)
    order = np.random.default_rng(seed).permutation(len(points))
    solid = TetMesh(points[order], np.argsort(order)[tets])
    basis = homology_basis(solid.surface, solid)
    assert np.array_equal(basis.handle_classes @ basis.linking, np.zeros((2, 4)))


def test_cohomology_of_a_knot_complement_is_linking_with_the_knot():
    """A block with a trefoil cut out: the tets alone, with relations to solve, against Gauss."""
    n, side = 20, 7.4
    cells = (np.stack(np.indices((n, n, n)), axis=-1) + 0.5) / n * side - side / 2
    knot = tubes.trefoil(np.linspace(0, 2 * np.pi, 400, endpoint=False))
    points, tets = shapes.cubes(cKDTree(knot).query(cells)[0] > 0.35)
    order = np.random.default_rng(0).permutation(len(points))
    solid = TetMesh(points[order] / n * side - side / 2, np.argsort(order)[tets])

    ids = {tuple(x): i for i, x in enumerate(np.rint(points[order]).astype(int).tolist())}
    edges = set(map(tuple, solid.edges.tolist()))
    rng = np.random.default_rng(1)
    loops = []
    while len(loops) < 40:
        loop = [ids.get(x) for x in rectangle(rng, n)]
        steps = zip(loop, loop[1:] + loop[:1], strict=True)
        if None not in loop and all((min(s), max(s)) in edges for s in steps):
            loops.append(np.array(loop, dtype=np.int32))
    relations, values = _core.homology.solid_cohomology(
        solid.T, solid.edges, solid.n_vertices, loops
    )
    cohomology = integer_kernel(relations)
    assert len(relations) and cohomology.shape[0] == 1
    found = values @ cohomology[0]
    linking = [_core.testing.linking_number(solid.V[loop], knot) for loop in loops]
    assert np.abs(linking).max() >= 2  # some rectangle goes round two strands
    assert np.array_equal(found, linking) or np.array_equal(-found, linking)


def rectangle(rng, n):
    """A rectangle of grid points in a random axis plane."""
    axis = rng.integers(3)
    low, high = np.sort(rng.integers(0, n + 1, (2, 2)), axis=0)
    high = np.maximum(high, low + 1)
    a, b = (np.arange(low[k], high[k]) for k in (0, 1))
    sides = [
        [(x, low[1]) for x in a],
        [(high[0], y) for y in b],
        [(x + 1, high[1]) for x in a[::-1]],
        [(low[0], y + 1) for y in b[::-1]],
    ]
    level = rng.integers(0, n + 1)
    return [tuple(np.insert(xy, axis, level).tolist()) for side in sides for xy in side]


# ---------------------------------------------------------------- shortest loops


def brute_force(basis, target, length, reach=4):
    """Shortest length in a class: Dijkstra from every vertex in a window of the cover."""
    surface = basis.surface
    n, width = surface.n_vertices, 2 * reach + 1
    i, j = surface.edges.T
    a, b = (x.ravel() for x in np.indices((width, width)))
    rows, cols, data = [], [], []
    for e in range(len(i)):
        p, q = a + basis.dual_forms[0, e], b + basis.dual_forms[1, e]
        inside = (p >= 0) & (p < width) & (q >= 0) & (q < width)
        rows.append((a * width + b)[inside] * n + i[e])
        cols.append((p * width + q)[inside] * n + j[e])
        data.append(np.full(inside.sum(), length[e]))
    size = n * width * width
    graph = coo_matrix(
        (np.concatenate(data), (np.concatenate(rows), np.concatenate(cols))), (size, size)
    )
    start = (reach - target // 2) @ [width, 1]
    end = (reach - target // 2 + target) @ [width, 1]
    distance = dijkstra(graph, directed=False, indices=start * n + np.arange(n))
    return distance[np.arange(n), end * n + np.arange(n)].min()


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("target", [(1, 0), (0, 1), (1, 1), (1, -2), (2, 1), (2, 0)])
def test_shortest_loop_is_shortest(target, seed):
    points, faces = tubes.tube(tubes.circle, 11, 5, radius=0.8, twist=1)
    points += np.random.default_rng(seed).normal(scale=0.06, size=points.shape)
    basis = homology_basis(TriMesh(points, faces))
    loop = basis.shortest_loop(np.array(target))
    assert np.array_equal(basis.classes(loop), target)
    length = _core.mesh.edge_lengths(basis.surface.topology, basis.surface.V)
    shortest = brute_force(basis, np.array(target), length)
    assert basis.length(loop) == pytest.approx(shortest, rel=1e-12)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("target", [(1, 0), (0, 1), (1, -1)])
def test_shortest_loop_in_any_metric(target, seed):
    """Lengths over three orders: loops run to and fro, touch themselves, share shortcuts."""
    surface = TriMesh(*tubes.tube(tubes.circle, 9, 7, radius=0.8))
    basis = homology_basis(surface)
    lengths = np.random.default_rng(seed).uniform(0.1, 1.0, len(surface.edges)) ** 3
    crossing = basis.generators[target[0] != 0]
    target = np.array(target, dtype=np.int32)
    loop = _core.homology.shortest_loop(
        surface.topology, lengths, basis.dual_forms, target, crossing.tolist()
    )
    assert np.array_equal(basis.classes(np.array(loop)), target)
    steps = np.sort(np.column_stack([loop, np.roll(loop, -1)]), axis=1)
    edge = {tuple(e): k for k, e in enumerate(surface.edges.tolist())}
    found = sum(lengths[edge[tuple(step)]] for step in steps.tolist())
    assert found == pytest.approx(brute_force(basis, target, lengths), rel=1e-12)


def test_loops_of_a_frame_of_cubes(double):
    basis = homology_basis(double.surface, double)
    assert len(basis.handle_loops) == len(basis.tunnel_loops) == 2
    for loop, target in zip(basis.handle_loops, basis.handle_classes, strict=True):
        assert np.array_equal(basis.classes(loop), target)
        assert basis.length(loop) == pytest.approx(8)  # round a bar of section 2 by 2
    for loop, target in zip(basis.tunnel_loops, basis.tunnel_classes, strict=True):
        assert np.array_equal(basis.classes(loop), target)
        assert basis.length(loop) == pytest.approx(8)  # round a hole of 2 by 2
    pairing = basis.tunnel_classes @ basis.intersection @ basis.handle_classes.T
    assert np.array_equal(pairing, np.eye(2, dtype=int))


@pytest.mark.parametrize(
    ("name", "handle", "tunnel"),
    [("kitten_21584", 0.4661, 1.5106), ("rocker_arm_25182", 2.0576, 2.3290)],
)
def test_loops_against_the_published_lengths(name, handle, tunnel, load_surface):
    """Table 3.1, whose units are not known: the ratio of the two."""
    basis = homology_basis(load_surface(name))
    ratio = basis.length(basis.tunnel_loops[0]) / basis.length(basis.handle_loops[0])
    assert ratio == pytest.approx(tunnel / handle, rel=0.02)


# ---------------------------------------------------------------- refusals and output


def test_refusals(double):
    sphere = TetMesh(*shapes.cubes(shapes.BALL)).surface
    basis = homology_basis(sphere)
    assert basis.genus == 0 and basis.handle_loops == ()
    with pytest.raises(GenusError, match="genus 0"):
        _ = basis.torus_forms
    with pytest.raises(GenusError, match="genus 0"):
        _ = basis.meridian
    basis = homology_basis(double.surface)
    with pytest.raises(GenusError, match="genus 2"):
        _ = basis.longitude
    with pytest.raises(ArrayError, match="not all zero"):
        basis.shortest_loop(np.zeros(4, int))
    with pytest.raises(ArrayError, match="boundary of the solid"):
        homology_basis(sphere, double)
    points, faces = shapes.torus()
    with pytest.raises(MeshError, match="inside out"):
        homology_basis(TriMesh(points, faces[:, ::-1]))
    with pytest.raises(MeshError):
        homology_basis(TriMesh(points, faces[1:]))


def test_a_surface_that_crosses_itself_is_told_unless_the_solid_is_given(caplog):
    """A tube wound twice round the same circle is a solid torus, but not an embedded one."""

    def twice(t):
        rho = 2 + 0.05 * np.cos(t)
        return np.stack([rho * np.cos(2 * t), rho * np.sin(2 * t), 0 * t], axis=-1)

    solid = solid_tube(twice, 60)
    with pytest.raises(SelfIntersectionError, match="self-intersections"):
        homology_basis(solid.surface)
    basis = homology_basis(solid.surface, solid)
    assert "the solid decides" in caplog.text
    assert basis.linking is None and basis.tunnel_classes is None
    assert basis.torus_forms.shape[0] == 2
    with pytest.raises(SelfIntersectionError):
        _ = basis.tunnel_loops


def solid_tube(curve, n):
    """A ring of 2 by 2 bars of cubes swept along a curve."""
    points, tets = shapes.cubes(np.ones((n, 2, 2), bool))
    t = 2 * np.pi * points[:, 0] / n
    outward = curve(t) / np.linalg.norm(curve(t), axis=1, keepdims=True)
    swept = curve(t) + 0.3 * (points[:, 1:2] - 1) * outward
    swept[:, 2] += 0.3 * (points[:, 2] - 1)
    ids = np.arange(len(points))  # sections are sorted alike: glue the last one to the first
    ids[points[:, 0] == n] = np.flatnonzero(points[:, 0] == 0)
    kept, tets = np.unique(ids[tets], return_inverse=True)
    return TetMesh(swept[kept], tets.reshape(-1, 4), orient=True)


def test_summary_and_file(tmp_path):
    basis = homology_basis(TriMesh(*shapes.torus()))
    assert "handle lengths" in basis.summary() and "genus" in basis.summary()
    basis.save(tmp_path / "basis.npz")
    with np.load(tmp_path / "basis.npz") as data:
        assert np.array_equal(data["torus_forms"], basis.torus_forms)
        assert np.array_equal(data["meridian"], basis.meridian)
        assert len(data["generator_1"]) == len(basis.generators[1])
