"""Measures against closed forms, slow twins written from the formulas, and exact identities."""

import numpy as np
import pytest

import reference as ref
from stretchmap import TetMesh, Torus, TriMesh, _core, distortion, samples
from stretchmap.errors import (
    ArrayError,
    DegenerateError,
    NonFiniteError,
    OptionError,
    OrientationError,
)


def torus_grid(nu, nv, torus):
    """A regular triangulation of a torus and its angles."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij"))

    def vertex(a, b):
        return (a % nu) * nv + b % nv

    a, b, c, d = vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)
    F = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    angles = 2 * np.pi * np.stack([i / nu, j / nv], axis=1)
    return TriMesh(torus.xi(*angles.T), F), angles


def test_an_image_beyond_all_sizes_is_refused():
    solid = samples.solid_torus(600)
    with pytest.raises(ArrayError, match="beyond"):
        distortion(solid, 1e60 * solid.V)


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.fixture
def ball_of_tets(rng):
    """A vertex star: 8 octants around the origin, randomly moved a little."""
    axes = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    T = [[0, 1 + 3 * a, 2 + 3 * b, 3 + 3 * c] for a in range(2) for b in range(2) for c in range(2)]
    return TetMesh(axes + 0.1 * rng.standard_normal(axes.shape), T, orient=True)


def test_solid_against_the_formulas(ball_of_tets, rng):
    mesh = ball_of_tets
    image = mesh.V @ rng.standard_normal((3, 3)) + 0.1 * rng.standard_normal(mesh.V.shape)
    d = distortion(mesh, image)
    source = [ref.tet_volume(mesh.V[t]) for t in mesh.T]
    target = [ref.tet_volume(image[t]) for t in mesh.T]
    rings = ref.ring_ratios(mesh.T, source, target, len(mesh.V))
    ratios = (target / np.sum(target)) / (source / np.sum(source))
    np.testing.assert_allclose(d.ring_ratios, rings, rtol=1e-12)
    np.testing.assert_allclose(d.ratios, ratios, rtol=1e-12)
    assert d.total_distortion == pytest.approx(
        ref.total_distortion(mesh.T, source, target, len(mesh.V)), rel=1e-12
    )
    assert d.ring_mean == pytest.approx(rings.mean(), rel=1e-12)
    assert d.ring_std == pytest.approx(rings.std(), rel=1e-10)
    assert d.element_error_mean == pytest.approx(np.abs(ratios - 1).mean(), rel=1e-10)
    assert d.element_std == pytest.approx(ratios.std(), rel=1e-10)
    assert (d.ratio_min, d.ratio_max) == pytest.approx((ratios.min(), ratios.max()))
    assert d.flips == np.sum(np.array(target) <= 0)
    assert d.stretch_energy == pytest.approx(1.5 * np.sum(np.square(target) / source), rel=1e-12)
    for k, t in enumerate(mesh.T):
        jacobian = (image[t[1:]] - image[t[0]]).T @ np.linalg.inv((mesh.V[t[1:]] - mesh.V[t[0]]).T)
        det = np.linalg.det(jacobian)
        angle = np.sum(jacobian**2) / (3 * det ** (2 / 3)) if det > 0 else np.inf
        assert d.angles[k] == pytest.approx(angle, rel=1e-10)


def test_surface_against_the_formulas(rng):
    torus = Torus(2.0, 0.8)
    mesh, angles = torus_grid(7, 5, torus)
    image = Torus(3.0, 1.0).xi(*(angles + 0.05 * rng.standard_normal(angles.shape)).T)
    d = distortion(mesh, image, torus=Torus(3.0, 1.0))
    source = [ref.face_area(mesh.V[f]) for f in mesh.F]
    target = [ref.face_area(image[f]) for f in mesh.F]
    assert d.flips == 0
    np.testing.assert_allclose(
        d.ring_ratios, ref.ring_ratios(mesh.F, source, target, len(mesh.V)), rtol=1e-11
    )
    assert d.total_distortion == pytest.approx(
        ref.total_distortion(mesh.F, source, target, len(mesh.V)), rel=1e-10
    )
    assert d.stretch_energy == pytest.approx(np.sum(np.square(target) / source), rel=1e-11)
    energy = 0.0
    for k, face in enumerate(mesh.F):
        s1, s2 = ref.singular_values(mesh.V[face], image[face])
        assert d.angles[k] == pytest.approx(s1 / s2, rel=1e-10)
        energy += source[k] * (s1 - s2) ** 2 / 2
    assert d.conformal_energy == pytest.approx(energy, rel=1e-10)


def test_conformal_energy_is_the_cotangent_form_minus_the_area():
    igl = pytest.importorskip("igl")
    mesh, _ = torus_grid(20, 10, Torus(2.0, 0.8))
    image = mesh.V * [1.0, 1.2, 0.7]
    dirichlet = -0.5 * np.trace(image.T @ (igl.cotmatrix(mesh.V, mesh.F) @ image))
    expected = dirichlet - TriMesh(image, mesh.F).area
    assert distortion(mesh, image).conformal_energy == pytest.approx(expected, rel=1e-11)


def test_similarity_is_without_distortion(ball_of_tets, rng):
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    d = distortion(ball_of_tets, 3.0 * ball_of_tets.V @ turn.T + [1.0, 2.0, 3.0])
    assert d.flips == 0
    assert d.total_distortion < 1e-14
    assert d.ring_std < 1e-13
    assert d.angle_max - 1 < 1e-13
    assert d.stretch_energy == pytest.approx(d.stretch_bound, rel=1e-13)
    assert d.image_total == pytest.approx(27 * d.source_total, rel=1e-13)


def test_affine_map_keeps_ratios_but_not_angles(ball_of_tets):
    d = distortion(ball_of_tets, ball_of_tets.V * [2.0, 1.0, 1.0])
    assert np.abs(d.ratios - 1).max() < 1e-13
    np.testing.assert_allclose(d.angles, 6 / (3 * 2 ** (2 / 3)), rtol=1e-12)


def test_mirror_image_flips_everything(ball_of_tets):
    d = distortion(ball_of_tets, ball_of_tets.V * [1.0, 1.0, -1.0])
    assert d.flips == len(ball_of_tets.T)
    assert d.image_total < 0
    np.testing.assert_array_equal(d.flipped, np.arange(len(ball_of_tets.T)))
    assert d.angle_max == np.inf


def test_one_inverted_tet_is_found_and_not_hidden_by_the_total(ball_of_tets):
    mesh = ball_of_tets
    image = mesh.V.copy()
    image[1] = -0.2 * image[1]
    target = np.array([ref.tet_volume(image[t]) for t in mesh.T])
    d = distortion(mesh, image)
    np.testing.assert_array_equal(d.flipped, np.flatnonzero(target <= 0))
    assert d.flips == 4
    assert d.image_total == pytest.approx(target.sum())
    assert d.ratio_min < 0


def test_flipped_face_has_negative_area_in_torus_and_in_chart():
    torus = Torus(2.0, 0.8)
    mesh, angles = torus_grid(24, 12, torus)
    vertex = 5 * 12 + 4
    moved = angles.copy()
    moved[vertex] += [0.7, 0.0]
    image = torus.xi(*moved.T)
    by_torus = distortion(mesh, image, torus=torus)
    by_chart = distortion(
        mesh, image, angles=moved + 2 * np.pi * (np.arange(len(moved)) % 3)[:, None]
    )
    np.testing.assert_array_equal(by_torus.flipped, by_chart.flipped)
    assert by_torus.flips > 0
    assert set(by_torus.flipped) <= set(np.flatnonzero((mesh.F == vertex).any(axis=1)))
    assert by_torus.image_total < TriMesh(image, mesh.F).area
    assert distortion(mesh, image).flips is None
    # Dirichlet energy minus *signed* area: higher by twice the area of what is flipped.
    flipped_area = np.abs(TriMesh(image, mesh.F).face_areas[by_torus.flipped]).sum()
    assert by_torus.conformal_energy == pytest.approx(
        distortion(mesh, image).conformal_energy + 2 * flipped_area, rel=1e-11
    )


def test_stretch_energy_respects_its_bound(ball_of_tets, rng):
    for _ in range(20):
        d = distortion(ball_of_tets, ball_of_tets.V + 0.3 * rng.standard_normal((7, 3)))
        assert d.stretch_energy >= d.stretch_bound * (1 - 1e-14)


def test_relabelling_changes_nothing_but_the_order(rng):
    torus = Torus(2.0, 0.8)
    mesh, angles = torus_grid(9, 7, torus)
    image = Torus(4.0, 1.0).xi(*angles.T)
    old_of_new = rng.permutation(len(mesh.V))
    new_of_old = np.argsort(old_of_new)
    faces = rng.permutation(len(mesh.F))
    a = distortion(mesh, image)
    b = distortion(TriMesh(mesh.V[old_of_new], new_of_old[mesh.F][faces]), image[old_of_new])
    np.testing.assert_array_equal(b.angles, a.angles[faces])
    np.testing.assert_allclose(b.ring_ratios, a.ring_ratios[old_of_new], rtol=1e-13)
    assert b.ring_std == pytest.approx(a.ring_std, rel=1e-12)


def test_unused_vertex_is_left_out_of_the_ring_figures(ball_of_tets):
    mesh = TetMesh(np.vstack([ball_of_tets.V, [[9.0, 9.0, 9.0]]]), ball_of_tets.T)
    d = distortion(mesh, mesh.V)
    assert np.isnan(d.ring_ratios[-1]) and d.ring_std < 1e-14


def test_bad_input(ball_of_tets):
    mesh = ball_of_tets
    with pytest.raises(ArrayError):
        distortion(mesh, mesh.V[:, :2])
    image = mesh.V.copy()
    image[3, 1] = np.nan
    with pytest.raises(NonFiniteError) as caught:
        distortion(mesh, image)
    assert caught.value.ids == (3,)
    with pytest.raises(DegenerateError):
        distortion(mesh, np.zeros_like(mesh.V))
    inverted = mesh.T.copy()
    inverted[2] = inverted[2][[0, 1, 3, 2]]
    with pytest.raises(OrientationError) as caught:
        distortion(TetMesh(mesh.V, inverted), mesh.V)
    assert caught.value.ids == (2,)
    flat = mesh.V.copy()
    flat[mesh.T[5, 1]] = flat[mesh.T[5, 0]]
    with pytest.raises((DegenerateError, OrientationError)):
        distortion(TetMesh(flat, mesh.T), mesh.V)
    surface, angles = torus_grid(5, 5, Torus(2.0, 1.0))
    with pytest.raises(OptionError):
        distortion(surface, surface.V, torus=Torus(2.0, 1.0), angles=angles)


def test_same_bits_twice(load_solid):
    mesh = load_solid("rocker_arm_small")
    image = mesh.V + 0.01 * np.sin(7 * mesh.V[:, ::-1])
    a, b = distortion(mesh, image), distortion(mesh, image)
    assert a.to_dict() == b.to_dict()
    assert "ring std" in a.summary()


def test_deviations_of_shares_against_numpy():
    """On enough tets for several parts of the sums round the vertices."""
    solid = samples.solid_torus(40_000)
    sizes = np.random.default_rng(5).uniform(0.5, 2.0, solid.n_tets)
    shares = solid.tet_volumes / solid.tet_volumes.sum()
    rings = _core.measures.ring_sums(solid.T, shares, solid.n_vertices)
    source = 3.0 * shares
    found = _core.measures.share_deviations(solid.T, source, 3.0 * rings, sizes)
    image = np.zeros(solid.n_vertices)
    np.add.at(image, solid.T, (sizes / sizes.sum())[:, None])
    assert found.rings == pytest.approx((image / rings).std(), rel=1e-12)
    assert found.elements == pytest.approx((sizes / sizes.sum() / shares).std(), rel=1e-12)


def test_the_scatter_of_directions_against_numpy():
    rng = np.random.default_rng(6)
    directions, half = rng.normal(size=(5000, 3)), rng.normal(size=(3, 3))
    metric = half @ half.T + np.eye(3)
    found = _core.measures.direction_scatter(directions, metric)
    lengths = np.einsum("ei,ij,ej->e", directions, metric, directions)
    expected = np.einsum("ei,ej,e->ij", directions, directions, 1.0 / lengths)
    assert found == pytest.approx(expected, rel=1e-12)
