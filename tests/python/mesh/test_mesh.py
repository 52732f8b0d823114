"""Arrays at the edge, boundary maps, sizes, orientation repair and diagnosis."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import shapes
from stretchmap import _core, samples
from stretchmap.errors import (
    ConnectivityError,
    GenusError,
    IndexRangeError,
    MeshError,
    NonManifoldError,
    OpenSurfaceError,
    OrientationError,
)
from stretchmap.mesh.meshes import TetMesh, TriMesh

few = settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture
def torus() -> TriMesh:
    return TriMesh(*shapes.torus())


@pytest.fixture
def ring() -> TetMesh:
    return TetMesh(*shapes.cubes(shapes.RING))


def turn(elements, ids):
    turned = elements.copy()
    turned[ids] = turned[ids][:, [1, 0, *range(2, elements.shape[1])]]
    return turned


# ---------------------------------------------------------------------------------------- arrays


@pytest.mark.parametrize("dtype", ["i1", "u1", "<i2", ">i2", ">u4", "<i8", ">i8", "u8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_any_integer_type_and_order(dtype, order, torus):
    points = np.asarray(torus.V, dtype=">f8", order=order)
    faces = np.asarray(torus.F.astype(dtype), order=order)
    kept = points.copy(), faces.copy()
    mesh = TriMesh(points, faces)
    assert mesh.V.dtype == np.float64 and mesh.V.dtype.isnative
    assert mesh.F.dtype == np.int32 and mesh.F.flags.c_contiguous and mesh.V.flags.c_contiguous
    np.testing.assert_array_equal(mesh.F, torus.F)
    np.testing.assert_array_equal(points, kept[0])
    np.testing.assert_array_equal(faces, kept[1])


def test_lists_strides_and_views(torus, ring):
    wide = np.zeros((torus.n_vertices, 6))
    wide[:, ::2] = torus.V
    np.testing.assert_array_equal(TriMesh(wide[:, ::2], torus.F.tolist()).V, torus.V)
    assert TetMesh(ring.V.astype(np.float32), ring.T[::-1]).volume == pytest.approx(8)


def test_the_mesh_is_immutable_and_apart_from_its_input(torus):
    points, faces = shapes.torus()
    mesh = TriMesh(points, faces)
    points[0], faces[0] = 9, 0
    np.testing.assert_array_equal(mesh.V, torus.V)
    np.testing.assert_array_equal(mesh.F, torus.F)
    for array in (mesh.V, mesh.F, mesh.edges, mesh.face_areas):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(AttributeError, match="immutable"):
        mesh.V = points
    with pytest.raises(AttributeError, match="immutable"):
        del mesh.V


def test_pickle(ring):
    turned = TetMesh(ring.V, turn(ring.T, [1, 2]), orient=True)
    back = pickle.loads(pickle.dumps(turned))
    assert back.n_turned == 2
    np.testing.assert_array_equal(back.T, turned.T)
    np.testing.assert_array_equal(back.surface.F, turned.surface.F)


def test_hints(torus):
    for arrays, hint in [
        ((torus.V.T, torus.F), r"V\.T"),
        ((torus.V, torus.F.T), r"F\.T"),
        ((torus.V[:, :2], torus.F), "column of zeros"),
        ((torus.V, torus.F.astype(float)), r"astype\(int\)"),
        ((torus.V, np.zeros((5, 4), int)), "TetMesh"),
        ((torus.V, torus.F + 1), "1-based"),
    ]:
        with pytest.raises(MeshError, match=hint):
            TriMesh(*arrays)
    with pytest.raises(MeshError, match="TriMesh"):
        TetMesh(torus.V, torus.F)


def test_indices_beyond_32_bits_are_not_wrapped(torus):
    faces = torus.F.astype(np.int64)
    faces[3, 1] += 2**32
    with pytest.raises(IndexRangeError) as caught:
        TriMesh(torus.V, faces)
    assert caught.value.ids == (3,)


# --------------------------------------------------------------------------- topology and sizes


def test_sizes_against_numpy(ring, torus):
    x = ring.V[ring.T]
    np.testing.assert_allclose(ring.tet_volumes, np.linalg.det(x[:, 1:] - x[:, :1]) / 6)
    assert ring.volume == pytest.approx(8)
    assert ring.surface.volume == pytest.approx(8)
    assert ring.surface.area == pytest.approx(4 * 3 + 4 + 8 + 8)
    y = torus.V[torus.F]
    normals = np.cross(y[:, 1] - y[:, 0], y[:, 2] - y[:, 0])
    np.testing.assert_allclose(torus.face_areas, np.linalg.norm(normals, axis=1) / 2)
    assert torus.volume == pytest.approx(np.einsum("ij,ij->", y[:, 0], normals) / 6)


def test_enclosed_volume_far_from_the_origin(torus):
    far = TriMesh(torus.V + 1e8, torus.F)
    assert far.volume == pytest.approx(torus.volume, rel=1e-6)


def test_volume_converges_to_that_of_the_torus():
    exact = 2 * np.pi**2 * 0.4**2
    errors = [abs(TriMesh(*shapes.torus(k, k)).volume - exact) for k in (20, 40, 80)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2, atol=0.1)


@pytest.mark.parametrize("filled", [shapes.RING, shapes.DOUBLE, shapes.SHELL])
def test_boundary_maps_both_ways(filled):
    solid = TetMesh(*shapes.cubes(filled))
    surface = solid.surface
    inside = np.setdiff1d(np.arange(solid.n_vertices), solid.boundary_vertices)
    np.testing.assert_array_equal(
        solid.boundary_index[solid.boundary_vertices], np.arange(surface.n_vertices)
    )
    assert (solid.boundary_index[inside] == -1).all()
    np.testing.assert_array_equal(surface.V, solid.V[solid.boundary_vertices])
    faces = solid.boundary_vertices[surface.F]
    rows = np.concatenate(
        [solid.T[:, list(c)] for c in ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))]
    )
    unique, counts = np.unique(np.sort(rows, axis=1), axis=0, return_counts=True)
    np.testing.assert_array_equal(np.unique(np.sort(faces, axis=1), axis=0), unique[counts == 1])
    owners = solid.T[solid.boundary_tets]
    assert (faces[:, :, None] == owners[:, None, :]).any(axis=2).all()
    assert surface.volume == pytest.approx(solid.volume)
    centers = solid.V[owners].mean(axis=1)
    x = solid.V[faces]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    assert (np.einsum("ij,ij->i", x[:, 0] - centers, normals) > 0).all()


def test_edges_and_neighbors_against_numpy(ring):
    pairs = np.concatenate([ring.T[:, [i, j]] for i in range(4) for j in range(i)])
    np.testing.assert_array_equal(ring.edges, np.unique(np.sort(pairs, axis=1), axis=0))
    surface = ring.surface
    pairs = np.concatenate([surface.F[:, [i, (i + 1) % 3]] for i in range(3)])
    np.testing.assert_array_equal(surface.edges, np.unique(np.sort(pairs, axis=1), axis=0))
    twin = _core.testing.tet_neighbors(ring.T, ring.n_vertices)
    half = np.flatnonzero(twin >= 0)
    np.testing.assert_array_equal(twin[twin[half]], half)
    opposite = np.sort(np.stack([np.delete(ring.T[h // 4], h % 4) for h in half]), axis=1)
    across = np.sort(np.stack([np.delete(ring.T[h // 4], h % 4) for h in twin[half]]), axis=1)
    np.testing.assert_array_equal(opposite, across)
    assert (twin < 0).sum() == surface.n_faces


# ------------------------------------------------------------------------------------- topology


@pytest.mark.parametrize(
    ("filled", "euler", "genus"),
    [
        (shapes.BALL, 1, [0]),
        (shapes.RING, 0, [1]),
        (shapes.DOUBLE, -1, [2]),
        (shapes.SHELL, 2, [0, 0]),
        (shapes.thick_ring_with_bubble(), 1, [1, 0]),
    ],
)
def test_topology_of_known_solids(filled, euler, genus):
    solid = TetMesh(*shapes.cubes(filled))
    found = solid.diagnose()
    assert found.ok and "no defects" in found.summary()
    assert found.euler.tolist() == [euler]
    assert sorted(found.genus.tolist()) == sorted(genus)
    if genus == [1]:
        solid.require_solid_torus()
        solid.surface.require_genus_one()
        return
    with pytest.raises(GenusError) as caught:
        solid.require_solid_torus()
    if len(genus) == 1:
        assert f"genus {genus[0]}" in str(caught.value)
        assert solid.surface.genus == genus[0]
        solid.surface.require_closed()
        with pytest.raises(GenusError, match=f"genus {genus[0]}"):
            solid.surface.require_genus_one()
    else:
        cavity = solid.V[list(caught.value.ids)]
        assert len(cavity) == 8 and np.ptp(cavity, axis=0).max() == 1
        assert "cavities" in str(caught.value)


def test_surface_properties(torus):
    assert (torus.euler, torus.genus, torus.n_components) == (0, 1, 1)
    two = TriMesh(
        np.vstack([torus.V, torus.V + 5]), np.vstack([torus.F, torus.F + torus.n_vertices])
    )
    assert (two.euler, two.genus, two.n_components) == (0, 2, 2)
    with pytest.raises(ConnectivityError, match="2 components of 192, 192 faces") as caught:
        two.require_closed()
    assert caught.value.ids == tuple(range(192, 384))
    with pytest.raises(OpenSurfaceError):
        _ = TriMesh(torus.V, torus.F[1:]).genus


def test_several_defects_are_all_listed_and_one_is_raised(torus):
    points = np.vstack([torus.V, [[7, 7, 7]]])
    faces = np.vstack([turn(torus.F, [20])[1:], torus.F[5]])
    mesh = TriMesh(points, faces)
    found = mesh.diagnose()
    names = [defect.name for defect in found.defects]
    assert names == ["duplicates", "border_edges", "misoriented", "unreferenced"]
    assert found.duplicates.tolist() == [191]
    assert found.misoriented.tolist() == [19]
    assert found.unreferenced.tolist() == [96]
    border = {tuple(edge) for edge in found.border_edges.tolist()}
    a, b, c = sorted(torus.F[0].tolist())
    assert border == {(a, b), (b, c), (a, c)}
    text = found.summary()
    assert all(defect.message in text for defect in found.defects)
    with pytest.raises(MeshError, match="also found: border edges, misoriented, unreferenced"):
        mesh.require_closed()


# ---------------------------------------------------------------------------------- orientation


@few
@given(st.sets(st.integers(0, 191)))
def test_repair_of_a_surface(torus, turned):
    ids = sorted(turned)
    mesh = TriMesh(torus.V, turn(torus.F, ids), orient=True)
    assert mesh.n_turned == len(ids)
    mesh.require_genus_one()
    assert mesh.volume == pytest.approx(torus.volume)


@few
@given(st.sets(st.integers(0, 47)))
def test_repair_of_a_solid(ring, turned):
    ids = sorted(turned)
    broken = TetMesh(ring.V, turn(ring.T, ids))
    assert broken.diagnose().misoriented.tolist() == ids
    mesh = TetMesh(ring.V, broken.T, orient=True)
    assert mesh.n_turned == len(ids)
    mesh.require_solid_torus()
    np.testing.assert_allclose(mesh.tet_volumes, ring.tet_volumes)


def test_inside_out(torus):
    mesh = TriMesh(torus.V, torus.F[:, ::-1])
    with pytest.raises(OrientationError, match=r"inside out.*orient=True") as caught:
        mesh.require_genus_one()
    assert caught.value.ids == tuple(range(192))
    assert TriMesh(mesh.V, mesh.F, orient=True).volume == pytest.approx(torus.volume)


def test_an_open_surface_goes_with_the_majority(torus):
    faces = turn(torus.F[:100], [3, 50])
    assert TriMesh(torus.V, faces).diagnose().misoriented.tolist() == [3, 50]
    assert TriMesh(torus.V, faces, orient=True).n_turned == 2


def test_a_fold_is_not_turned_away():
    """A vertex pulled through the opposite faces: consistent, and negative all the same."""
    points, tets = shapes.cubes(shapes.box(4, 4, 4))
    center = int(np.flatnonzero((points == 2).all(axis=1))[0])
    points[center] = [3.4, 2.1, 2.2]
    x = points[tets]
    negative = np.flatnonzero(np.linalg.det(x[:, 1:] - x[:, :1]) < 0)
    assert len(negative) > 0
    for orient in (False, True):
        solid = TetMesh(points, tets, orient=orient)
        assert solid.n_turned == 0
        found = solid.diagnose()
        np.testing.assert_array_equal(found.inverted, negative)
        assert len(found.misoriented) == 0
        with pytest.raises(OrientationError, match="folded"):
            solid.require_solid_torus()


def test_klein_bottle_cannot_be_oriented():
    points, faces = shapes.torus(12, 8)
    u, v = np.divmod(faces, 8)
    # Glue the last strip with the tube direction reversed.
    seam = (u.max(axis=1) == 11) & (u.min(axis=1) == 0)
    v = np.where(seam[:, None] & (u == 0), -v % 8, v)
    mesh = TriMesh(points, u * 8 + v)
    assert mesh.euler == 0
    assert len(mesh.diagnose().not_orientable) > 0
    for orient in (False, True):
        with pytest.raises(OrientationError, match="not orientable"):
            TriMesh(mesh.V, mesh.F, orient=orient).require_closed()


# ------------------------------------------------------------------------------------ invariance


def signature(mesh):
    found = mesh.diagnose()
    return (
        sorted((d.name, len(d.ids)) for d in found.defects),
        sorted(found.euler.tolist()),
        sorted(found.genus.tolist()),
    )


@few
@given(
    seed=st.integers(0, 2**31),
    scale=st.floats(1e-6, 1e6),
    shift=st.floats(-1e3, 1e3),
    mirror=st.booleans(),
    broken=st.booleans(),
)
def test_diagnosis_does_not_depend_on_labels_or_position(ring, seed, scale, shift, mirror, broken):
    rng = np.random.default_rng(seed)
    tets = turn(ring.T, [3, 17])[:-1] if broken else ring.T
    points = np.vstack([ring.V, ring.V[:1]]) if broken else ring.V
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation)) * (-1 if mirror else 1)
    rank = rng.permutation(len(points)).astype(np.int32)
    moved = np.empty_like(points)
    moved[rank] = scale * (points @ rotation.T + shift)
    renamed = rank[tets][rng.permutation(len(tets))]
    if mirror:
        renamed = turn(renamed, slice(None))
    before, after = TetMesh(points, tets), TetMesh(moved, renamed)
    assert signature(after) == signature(before)
    assert signature(after.surface) == signature(before.surface)
    np.testing.assert_allclose(
        np.sort(after.tet_volumes), scale**3 * np.sort(before.tet_volumes), atol=1e-9 * scale**3
    )


@pytest.mark.parametrize("scale", [1e-90, 1e-9, 1.0, 1e9, 1e40])
def test_flatness_is_relative(scale, ring):
    """A tet a ten-millionth as high as wide passes at any scale, one a 1e-14th does not."""
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1.0]])
    for height, degenerate in [(1e-7, False), (1e-10, False), (1e-14, True), (0.0, True)]:
        points = flat * [scale, scale, scale * height]
        found = TetMesh(points, [[0, 1, 2, 3]]).diagnose()
        assert (len(found.degenerate) == 1) == degenerate


def test_flatness_knows_the_rounding_of_the_coordinates():
    """Far away the same height is lost among the digits."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1e-9]])
    assert len(TetMesh(points, [[0, 1, 2, 3]]).diagnose().degenerate) == 0
    assert len(TetMesh(points + 1e7, [[0, 1, 2, 3]]).diagnose().degenerate) == 1


def test_compact(torus):
    points = np.vstack([[[1, 1, 1]], torus.V, [[2, 2, 2]]])
    mesh, kept = TriMesh(points, torus.F + 1).compact()
    np.testing.assert_array_equal(mesh.V, torus.V)
    np.testing.assert_array_equal(mesh.F, torus.F)
    np.testing.assert_array_equal(kept, np.arange(1, 97))


@pytest.mark.parametrize("name", ["bob_small", "kitten_jigsaw_small", "rocker_arm_jigsaw"])
def test_meshes_on_disk_have_no_defects(name, load_solid):
    solid = load_solid(name)
    solid.require_solid_torus()
    solid.surface.require_genus_one()
    assert solid.surface.volume == pytest.approx(solid.volume, rel=1e-12)


@pytest.mark.parametrize("tet", [0, 5])
def test_a_vertex_given_twice_is_to_be_welded_and_not_its_neighbors_parted(tet):
    solid = samples.solid_torus(600)
    T = solid.T.copy()
    V = np.vstack([solid.V, solid.V[T[tet, :1]]])
    T[tet, 0] = solid.n_vertices
    message = f"faces; vertex {solid.n_vertices} exactly where others are: weld them first"
    with pytest.raises(NonManifoldError, match=message):
        TetMesh(V, T).require_solid_torus()


def test_sheets_that_welding_does_not_part_are_to_be_parted():
    """Two cubes meet in an edge; a third one has a corner where another has one."""
    V, T = shapes.cubes(np.eye(2, dtype=bool)[..., None])
    W, U = shapes.cubes(shapes.BALL)
    found = TetMesh(
        np.vstack([V, W + np.array([2.0, 2.0, 1.0])]), np.vstack([T, U + len(V)])
    ).diagnose()
    assert len(found.coincident) == 1 and "separate the sheets" in found.defects[0].message


def test_vertices_that_should_be_welded_are_named():
    solid = samples.bumpy_torus(1200)
    single = TetMesh(solid.V[solid.T].reshape(-1, 3), np.arange(4 * solid.n_tets).reshape(-1, 4))
    with pytest.raises(ConnectivityError, match="exactly where others are: weld them first"):
        single.require_solid_torus()
    assert len(single.diagnose().summary()) < 2000
    # A seam: the vertices of one cut plane twice.
    ahead = solid.V[solid.T].mean(axis=1)[:, 1] > 0.0
    on = np.isin(np.arange(solid.n_vertices), solid.T[ahead]) & np.isin(
        np.arange(solid.n_vertices), solid.T[~ahead]
    )
    seam = np.flatnonzero(on & (solid.V[:, 0] > 0.0))
    T = solid.T.copy()
    copies = np.arange(solid.n_vertices)
    copies[seam] = solid.n_vertices + np.arange(len(seam))
    T[ahead] = copies[T[ahead]]
    cut = TetMesh(np.vstack([solid.V, solid.V[seam]]), T)
    found = cut.diagnose()
    assert found.ok and len(found.coincident) == len(seam) and "weld" in found.summary()
    with pytest.raises(GenusError, match=r"no hole; .*weld them first"):
        cut.require_solid_torus()
    open_surface = TriMesh(solid.surface.V[solid.surface.F].reshape(-1, 3),
                           np.arange(3 * solid.surface.n_faces).reshape(-1, 3))  # fmt: skip
    with pytest.raises(OpenSurfaceError, match="weld"):
        open_surface.diagnose().require()
    assert not len(solid.diagnose().coincident)
