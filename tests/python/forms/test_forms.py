"""Harmonic and holomorphic forms: Laplacian, closedness, Hodge star, genus 2, other weights."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import coo_matrix

import shapes
import tubes
from stretchmap import (
    TetMesh,
    TriMesh,
    _core,
    harmonic_forms,
    holomorphic_forms,
    homology_basis,
    samples,
)
from stretchmap.errors import DegenerateError, OptionError
from stretchmap.forms.harmonic import CLAMP


def random_torus(seed=0, nu=20, nv=9):
    points, faces = tubes.tube(tubes.circle, nu, nv, radius=0.9)
    return TriMesh(
        points + np.random.default_rng(seed).normal(scale=0.05, size=points.shape), faces
    )


def smooth_plate(n):
    """Genus 2: a plate with two holes, n cells per bar."""
    return TetMesh(*shapes.cubes(shapes.DOUBLE.repeat(n, 0).repeat(n, 1).repeat(n, 2))).surface


def plate(n=2):
    """The same with rough faces."""
    surface = smooth_plate(n)
    noise = np.random.default_rng(1).uniform(-0.15, 0.15, surface.V.shape)
    return TriMesh(surface.V + noise, surface.F)


def along(surface, form):
    """(m, 3) form along the half-edges of each face."""
    sign = np.where(surface.F < np.roll(surface.F, -1, axis=1), 1, -1)
    return form[surface.topology.edge.reshape(-1, 3)] * sign


def divergence(surface, weights, form):
    """(n,) sum over the edges at a vertex of weight times form, (3.3)."""
    i, j = surface.edges.T
    flow = weights * form
    return np.bincount(i, flow, surface.n_vertices) - np.bincount(j, flow, surface.n_vertices)


# ---------------------------------------------------------------- Laplacian


def test_laplacian_is_that_of_libigl():
    igl = pytest.importorskip("igl")
    for surface in (random_torus(), plate()):
        weights = _core.forms.cotangent_weights(surface.topology, surface.V)
        ours = _core.testing.weighted_laplacian(surface.topology, weights)
        theirs = -igl.cotmatrix(surface.V, surface.F)
        assert abs(ours - theirs).max() < 1e-12 * abs(theirs).max()


def test_weights_are_half_the_cotangents():
    surface = random_torus(3)
    expected = np.zeros(len(surface.edges))
    lookup = {tuple(edge): e for e, edge in enumerate(surface.edges.tolist())}
    for face in surface.F.tolist():
        for k in range(3):
            apex, i, j = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
            a, b = surface.V[i] - surface.V[apex], surface.V[j] - surface.V[apex]
            angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
            expected[lookup[min(i, j), max(i, j)]] += 0.5 / np.tan(angle)
    assert np.allclose(
        _core.forms.cotangent_weights(surface.topology, surface.V), expected, rtol=1e-9
    )


def test_a_face_without_area_is_named():
    points, faces = shapes.torus()
    points[faces[5, 2]] = points[faces[5, 1]]
    surface = TriMesh(points, faces)
    with pytest.raises(DegenerateError) as caught:
        _core.forms.cotangent_weights(surface.topology, surface.V)
    assert 5 in caught.value.ids


# ---------------------------------------------------------------- harmonic forms


@pytest.mark.parametrize("surface", [random_torus(), plate()], ids=["torus", "genus 2"])
def test_harmonic_forms_are_closed_coclosed_and_keep_their_periods(surface):
    basis = homology_basis(surface)
    harmonic = harmonic_forms(surface, basis)
    weights = _core.forms.cotangent_weights(surface.topology, surface.V)
    assert harmonic.forms.shape == (2 * basis.genus, len(surface.edges))
    assert not harmonic.potentials[0].any()
    i, j = surface.edges.T
    rebuilt = basis.dual_forms + (harmonic.potentials[j] - harmonic.potentials[i]).T
    assert np.allclose(harmonic.forms, rebuilt, atol=1e-14)
    for k, form in enumerate(harmonic.forms):
        assert np.abs(along(surface, form).sum(axis=1)).max() < 1e-13
        assert np.abs(divergence(surface, weights, form)).max() < 1e-12
        for loop, period in zip(basis.generators, np.eye(2 * basis.genus)[k], strict=True):
            points = np.append(loop, loop[0])
            steps = [
                form[edge_id(surface, a, b)] * (1 if a < b else -1) for a, b in pairwise(points)
            ]
            assert sum(steps) == pytest.approx(period, abs=1e-13)
    assert np.allclose(harmonic.gram, (harmonic.forms * weights) @ harmonic.forms.T, atol=1e-12)


def edge_id(surface, a, b):
    key = surface.edges[:, 0].astype(np.int64) * surface.n_vertices + surface.edges[:, 1]
    return np.searchsorted(key, min(a, b) * surface.n_vertices + max(a, b))


def test_harmonic_forms_have_least_energy_in_their_class():
    surface = random_torus(5)
    harmonic = harmonic_forms(surface)
    weights = _core.forms.cotangent_weights(surface.topology, surface.V)
    i, j = surface.edges.T
    rng = np.random.default_rng(0)
    for _ in range(5):
        h = rng.normal(size=surface.n_vertices)
        moved = harmonic.forms[0] + 1e-3 * (h[j] - h[i])
        assert (weights * moved**2).sum() > harmonic.gram[0, 0]


# ---------------------------------------------------------------- Hodge star


def test_vector_proxies_return_the_form_and_star_is_a_quarter_turn():
    surface = random_torus(2)
    form = harmonic_forms(surface).forms[1]
    vectors = _core.testing.form_vectors(surface.topology, surface.V, form)
    corners = surface.V[surface.F]
    edges = np.roll(corners, -1, axis=1) - corners
    assert np.allclose(np.einsum("fd,fkd->fk", vectors, edges), along(surface, form), atol=1e-13)
    normals = np.cross(edges[:, 0], edges[:, 1])
    assert np.abs(np.einsum("fd,fd->f", vectors, normals)).max() < 1e-14


@pytest.mark.parametrize("surface", [random_torus(), plate()], ids=["torus", "genus 2"])
def test_both_ways_to_the_products_agree(surface):
    """b of (3.10) is the Gram matrix in cotangent weights, c the integer wedge matrix."""
    basis = homology_basis(surface)
    forms = holomorphic_forms(surface, basis)
    assert np.allclose(forms.star, basis.harmonic.gram, rtol=1e-10, atol=1e-12)
    wedge = _core.homology.wedge_matrix(surface.topology, basis.dual_forms.astype(float))
    assert np.allclose(forms.wedge, wedge, atol=1e-11)
    areas = _core.forms.chart_areas(
        surface.topology, basis.harmonic.forms[0], basis.harmonic.forms[1]
    )
    assert areas.sum() == pytest.approx(wedge[0, 1], abs=1e-11)


def test_genus_one_star_squares_to_minus_the_determinant():
    surface = random_torus(4, 40, 18)
    basis = homology_basis(surface)
    mu = holomorphic_forms(surface, basis).coefficients
    assert np.allclose(mu @ mu, -np.linalg.det(basis.harmonic.gram) * np.eye(2), atol=1e-10)


def test_holomorphic_basis_at_genus_two():
    errors = []
    for n in (2, 4, 8):
        surface = smooth_plate(n)
        basis = homology_basis(surface)
        forms = holomorphic_forms(surface, basis)
        mu = forms.coefficients
        assert mu.shape == (4, 4)
        errors.append(np.abs(mu @ mu + np.eye(4)).max())
        weights = _core.forms.cotangent_weights(surface.topology, surface.V)
        for real, imag in zip(forms.real, forms.imag, strict=True):
            for form in (real, imag):
                assert np.abs(along(surface, form).sum(axis=1)).max() < 1e-11
                assert np.abs(divergence(surface, weights, form)).max() < 1e-10
        # Four complex forms span the two-dimensional space of holomorphic forms: to the accuracy of
        # the discrete star only two singular values stay, and the real forms alone have rank four.
        periods = np.eye(4) + 1j * mu
        values = np.linalg.svd(periods, compute_uv=False)
        assert values[2] < 2 * errors[-1] < 0.5 * values[1]
        # Riemann's relations: the period matrix is symmetric, its imaginary part definite.
        tau = period_matrix(basis, periods)
        assert np.abs(tau - tau.T).max() < 2 * errors[-1]
        assert np.linalg.eigvalsh(tau.imag + tau.imag.T).min() > 0
    assert errors[0] > 1.5 * errors[1] > 2.25 * errors[2]


def period_matrix(basis, periods):
    """Periods over the handles of the two forms normalised over the tunnels."""
    over_tunnels = periods @ basis.tunnel_classes.T
    over_handles = periods @ basis.handle_classes.T
    return np.linalg.lstsq(over_tunnels, over_handles, rcond=None)[0]


def test_genus_zero_has_no_forms():
    surface = TetMesh(*shapes.cubes(shapes.BALL)).surface
    forms = holomorphic_forms(surface)
    assert forms.real.shape == (0, len(surface.edges)) and forms.coefficients.shape == (0, 0)


# ---------------------------------------------------------------- other weights


def test_intrinsic_delaunay_keeps_the_surface():
    surface = random_torus(7, 24, 10)
    basis = homology_basis(surface)
    lengths = _core.mesh.edge_lengths(surface.topology, surface.V)
    weights = _core.forms.cotangent_weights(surface.topology, surface.V)
    edges, flipped, eta, n_flips = _core.forms.intrinsic_delaunay(
        surface.topology, lengths, basis.dual_forms
    )
    assert n_flips >= (weights < 0).sum() > 0
    assert flipped.min() > -1e-12 and len(edges) == len(surface.edges)
    # The sum of u_i L u_j is an energy: flips can only lower it (Rippa's theorem).
    n = surface.n_vertices
    before, after = energy(n, surface.edges, weights), energy(n, edges, flipped)
    for seed in range(5):
        u = np.random.default_rng(seed).normal(size=n)
        assert u @ (after @ u) < u @ (before @ u)
    # The carried forms are those of the same class: solving there and back has the same periods.
    moved = harmonic_forms(surface, basis, weights="intrinsic_delaunay")
    assert moved.n_flips == n_flips and moved.n_negative == (weights < 0).sum()
    assert np.abs(np.vstack([along(surface, f).sum(axis=1) for f in moved.forms])).max() < 1e-13
    assert (np.diag(moved.gram) < np.diag(basis.harmonic.gram)).all()
    assert eta.shape == basis.dual_forms.shape


def energy(n, edges, weights):
    i, j = edges.T
    rows, cols = np.concatenate([i, j, i, j]), np.concatenate([j, i, i, j])
    return coo_matrix(
        (np.concatenate([-weights, -weights, weights, weights]), (rows, cols)), (n, n)
    )


def test_no_flips_on_a_delaunay_surface():
    # Half a cell of twist per section: triangles close to equilateral.
    surface = TriMesh(*tubes.tube(tubes.circle, 20, 10, radius=0.9, twist=-1))
    basis = homology_basis(surface)
    plain = harmonic_forms(surface, basis)
    assert plain.n_negative == 0
    for weights in ("intrinsic_delaunay", "clamped"):
        other = harmonic_forms(surface, basis, weights=weights)
        assert other.n_flips == 0 and other.weights == weights
    flipped = harmonic_forms(surface, basis, weights="intrinsic_delaunay")
    assert np.allclose(flipped.forms, plain.forms, atol=1e-12)


def test_clamped_weights_are_solved_for():
    surface = random_torus(7, 24, 10)
    clamped = harmonic_forms(surface, weights="clamped")
    weights = np.maximum(_core.forms.cotangent_weights(surface.topology, surface.V), CLAMP)
    assert np.abs(divergence(surface, weights, clamped.forms[0])).max() < 1e-12
    with pytest.raises(OptionError, match="weights must be"):
        harmonic_forms(surface, weights="uniform")


def test_many_vertices_are_solved_by_multigrid_as_well_as_by_factors():
    surface = samples.torus_surface(330, 160)  # more than 50,000 vertices
    harmonic = harmonic_forms(surface)
    weights = _core.forms.cotangent_weights(surface.topology, surface.V)
    for form in harmonic.forms:
        assert np.abs(along(surface, form).sum(axis=1)).max() < 1e-12
        assert np.abs(divergence(surface, weights, form)).max() < 1e-9 * np.abs(form).max()
