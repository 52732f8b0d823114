"""Volume maps: Algorithm 5.1 against oracles, and the certified route."""

from __future__ import annotations

import dataclasses
import functools
from itertools import pairwise

import igl
import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

import stretchmap as sm
from shapes import mug
from stretchmap import _core, samples
from stretchmap.base import budget
from stretchmap.certificate.findings import require_certified
from stretchmap.errors import (
    ArrayError,
    CertificationError,
    DegenerateError,
    KindError,
    NonFiniteError,
    OptionError,
    SelfIntersectionError,
    SolverError,
)
from stretchmap.mesh.meshes import TetMesh
from stretchmap.volume import vsem

RNG = np.random.default_rng(11)


@pytest.fixture(scope="module")
def bumpy():
    return samples.bumpy_torus(4000)


def boundary_flags(solid):
    fixed = np.zeros(solid.n_vertices, np.uint8)
    fixed[solid.boundary_vertices] = 1
    return fixed


def laplacian_pair(T, fixed, rest, geometry, c, x, **options):
    """L_II and -L_IB x_B, rows in the order of the vertices."""
    matrix, rhs, rows = _core.testing.tet_laplacian(T, fixed, rest, geometry, c, x, **options)
    order = np.argsort(rows)
    assert (rows[order] == np.flatnonzero(fixed == 0)).all()
    return sp.csr_matrix(matrix)[order][:, order], rhs[order]


def full_laplacian(V, T, rest, geometry=None, c=0.0):
    """Every vertex free, so that L_II is all of L."""
    held = np.zeros(len(V), np.uint8)
    return laplacian_pair(T, held, rest, V if geometry is None else geometry, c, V)[0]


def dihedral_laplacian(V, T):
    """(5.8) as printed: sixths of edge lengths times cotangents of opposite dihedral angles."""
    rows, cols, values = [], [], []
    for i, j, k, m in [(0, 1, 2, 3), (0, 2, 1, 3), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 0, 2),
                       (2, 3, 0, 1)]:  # fmt: skip
        a, b, c, d = (V[T[:, x]] for x in (i, j, k, m))
        axis = d - c
        length = np.linalg.norm(axis, axis=1)
        e = axis / length[:, None]
        p = (a - c) - np.einsum("ij,ij->i", a - c, e)[:, None] * e
        q = (b - c) - np.einsum("ij,ij->i", b - c, e)[:, None] * e
        cot = np.einsum("ij,ij->i", p, q) / np.linalg.norm(np.cross(p, q), axis=1)
        w = length * cot / 6.0
        rows += [T[:, i], T[:, j]]
        cols += [T[:, j], T[:, i]]
        values += [-w, -w]
    n = len(V)
    L = sp.csr_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), (n, n)
    )
    return L - sp.diags(np.asarray(L.sum(axis=1)).ravel())


def test_laplacian_is_libigls_and_the_dihedral_one(bumpy):
    V, T = bumpy.V, bumpy.T
    ours = full_laplacian(V, T, bumpy.tet_volumes)
    scale = np.abs(ours).max()
    assert np.abs(ours + igl.cotmatrix(V, T)).max() < 1e-12 * scale
    assert np.abs(ours - dihedral_laplacian(V, T)).max() < 1e-11 * scale


def test_laplacian_with_boundary_is_the_matching_part_of_the_full_one(bumpy):
    V, T = bumpy.V, bumpy.T
    rest = bumpy.tet_volumes
    full = full_laplacian(V, T, rest)
    fixed = boundary_flags(bumpy)
    x = RNG.standard_normal(V.shape)
    inner, rhs = laplacian_pair(T, fixed, rest, V, 0.0, x)
    free, held = np.flatnonzero(fixed == 0), np.flatnonzero(fixed)
    assert np.abs(inner - full[free][:, free]).max() < 1e-13 * np.abs(full).max()
    assert np.allclose(rhs, -full[free][:, held] @ x[held], atol=1e-12 * np.abs(full).max())


def test_laplacian_does_not_depend_on_the_kernel_or_the_numbering():
    # Enough vertices for several chunks, numbered at random, and a boundary that splits rows.
    solid = samples.bumpy_torus(30000)
    V, T, rest = solid.V, solid.T, solid.tet_volumes
    shuffle = RNG.permutation(len(V))
    V2, T2 = np.empty_like(V), shuffle[T].astype(np.int32)
    V2[shuffle] = V
    fixed, fixed2 = boundary_flags(solid), np.zeros(len(V), np.uint8)
    fixed2[shuffle] = fixed
    args = (T2, fixed2, rest, V2, 3.0, V2)
    first, first_rhs = laplacian_pair(*args)
    for lanes in (1, 4):
        other, other_rhs = laplacian_pair(*args, lanes=lanes)
        assert np.array_equal(first.data, other.data)
        assert np.array_equal(first_rhs, other_rhs)
    # Against the matrix of the mesh as it was numbered before.
    plain, plain_rhs = laplacian_pair(T, fixed, rest, V, 3.0, V)
    rank = np.argsort(shuffle[np.flatnonzero(fixed == 0)])
    scale = np.abs(plain.data).max()
    assert np.abs(plain[rank][:, rank] - first).max() < 1e-13 * scale
    assert np.allclose(plain_rhs[rank], first_rhs, atol=1e-13 * scale)


@pytest.mark.parametrize("c", [0.0, 10.0])
def test_inexact_steps_lead_to_the_map_of_exact_ones(c):
    # 20 steps on one hierarchy of grids or two against exact factors at every step.
    solid = samples.bumpy_torus(30000)
    fixed = boundary_flags(solid)
    V = solid.V / solid.volume ** (1 / 3)
    start = V + 0.2 * np.sin(3.0 * V[:, [1, 2, 0]])
    run = functools.partial(
        vsem.minimize_volumetric_stretch, V, solid.T, fixed, start, c=c, max_iter=20, tol=0.0
    )
    ours, exact = run(solver="multigrid"), run(solver="direct")
    energies = [np.array([r.energy for r in result.history]) for result in (ours, exact)]
    assert len(energies[0]) == 21 and (np.diff(energies[0]) < 0.0).all()
    assert energies[0][-1] == pytest.approx(energies[1][-1], rel=1e-7)
    assert np.abs(ours.image - exact.image).max() < 1e-4
    assert [r.flips for r in ours.history] == [r.flips for r in exact.history]


def test_stretch_energy_identities(bumpy):
    V, T = bumpy.V, bumpy.T
    f = V + 0.02 * RNG.standard_normal(V.shape)
    rest, image = bumpy.tet_volumes, _core.mesh.tet_volumes(f, T)
    L = full_laplacian(V, T, rest, geometry=f)
    energy = _core.volume.tet_stretch_energy(image, rest)
    assert energy == pytest.approx(0.5 * np.trace(f.T @ (L @ f)), rel=1e-12)
    assert energy == pytest.approx(1.5 * (image**2 / rest).sum(), rel=1e-14)
    assert energy >= 1.5 * image.sum() ** 2 / rest.sum()


def test_affine_images_attain_the_lower_bound(bumpy):
    A = np.array([[1.2, 0.3, 0.0], [0.0, 0.8, 0.1], [0.2, 0.0, 1.1]])
    f = np.ascontiguousarray(bumpy.V @ A.T)
    image = _core.mesh.tet_volumes(f, bumpy.T)
    energy = _core.volume.tet_stretch_energy(image, bumpy.tet_volumes)
    bound = 1.5 * image.sum() ** 2 / bumpy.tet_volumes.sum()
    assert energy == pytest.approx(bound, rel=1e-12)


@pytest.mark.parametrize("c", [0.0, 10.0])
def test_vsem_step_solves_the_paper_system(bumpy, c):
    """One step against an independent assembly and SciPy's direct solver."""
    V, T = bumpy.V, bumpy.T
    fixed = boundary_flags(bumpy)
    x = V.copy()
    x[fixed == 0] += 0.01 * RNG.standard_normal((int((fixed == 0).sum()), 3))
    rest = bumpy.tet_volumes
    stretch = _core.volume.VolumetricStretch(T, fixed, rest, "direct")
    moved, solved = stretch.step(x, c, 1e-12)
    # (5.6) folded into the rest volumes.
    regularized = rest + c * np.abs(_core.mesh.tet_volumes(x, T))
    L = full_laplacian(V, T, regularized, geometry=x)
    free, held = np.flatnonzero(fixed == 0), np.flatnonzero(fixed)
    expected = sp.linalg.spsolve(sp.csc_matrix(L[free][:, free]), -L[free][:, held] @ x[held])
    assert np.allclose(moved[free], expected, atol=1e-9)
    assert np.array_equal(moved[held], x[held])
    assert max(solved.residual) < 1e-12


def test_vsem_steps_start_where_the_last_ones_lead():
    """Steps change ever more alike: what the last three did spares most iterations, no accuracy."""
    solid = sm.samples.vertebra_like(12_000)
    V, T, fixed = solid.V / solid.volume ** (1 / 3), solid.T, boundary_flags(solid)
    rest = _core.mesh.tet_volumes(V, T)
    start = V * [1.3, 1.0, 0.8] + 0.1 * np.sin(3.0 * V[:, [1, 2, 0]])
    iterations, exact = [], []
    iterative, direct = (
        _core.volume.VolumetricStretch(T, fixed, rest, backend)
        for backend in ("multigrid", "direct")
    )
    x, _ = iterative.harmonic(V, start, 1e-10)
    y, _ = direct.harmonic(V, start, 1e-10)
    for _ in range(12):
        x, solved = iterative.step(x, 10.0, 1e-9, follow=True)
        y, _ = direct.step(y, 10.0, 1e-9)
        iterations.append(solved.iterations)
        exact.append(np.abs(x - y).max())
    assert max(iterations[8:]) <= 0.6 * max(iterations[:3])
    assert max(exact) < 1e-7


def test_vsem_energy_falls_at_every_step_and_flips_are_reported(bumpy):
    result = sm.volume_map(bumpy, c=0.0, max_iter=8, options=sm.VolumeOptions(tol=0.0))
    energies = [record.energy for record in result.history]
    assert all(b < a for a, b in pairwise(energies))
    volumes = _core.mesh.tet_volumes(np.ascontiguousarray(result.image), bumpy.T)
    assert result.distortion.flips == np.count_nonzero(volumes <= 0.0)
    assert volumes.sum() == pytest.approx(bumpy.volume, rel=1e-12)
    assert not result.converged and result.stop_reason == "most iterations done"


def test_algorithm_starts_from_faces_of_nearly_exact_area(bumpy):
    """Its boundary map is an area map whose faces, and so its rings, are a little less exact."""
    boundary = sm.area_map(bumpy.surface, tol=0.01, finish="face")
    own = sm.volume_map(bumpy, c=10.0, max_iter=3)
    given = sm.volume_map(bumpy, c=10.0, max_iter=3, start=boundary)
    assert boundary.distortion.element_std <= 0.01 and boundary.distortion.ring_std < 0.01
    assert (own.image == given.image).all()


def test_algorithm_begins_with_the_harmonic_map_of_a_stretched_solid_as_it_is(bumpy):
    """The certified route undoes a stretch of all tets, the published method does not."""
    solid = sm.TetMesh(bumpy.V * [20.0, 1.0, 1.0], bumpy.T)
    boundary = sm.area_map(solid.surface, keep_best=True)
    result = sm.volume_map(solid, c=0.0, max_iter=1, start=boundary)
    L = igl.cotmatrix(solid.V, solid.T).tocsr()
    held = solid.boundary_vertices
    free = np.setdiff1d(np.arange(solid.n_vertices), held)
    harmonic = np.zeros((solid.n_vertices, 3))
    harmonic[held] = boundary.image
    harmonic[free] = spsolve(L[free][:, free].tocsc(), -L[free][:, held] @ boundary.image)
    shares = [np.abs(_core.mesh.tet_volumes(X, solid.T)) for X in (solid.V, harmonic)]
    enclosed = _core.mesh.enclosed_volume(boundary.image, solid.surface.F)
    rest, volumes = shares[0] / solid.volume, shares[1] / enclosed
    assert result.history[0].energy == pytest.approx(1.5 * (volumes**2 / rest).sum(), rel=1e-5)


def test_a_large_run_says_how_much_memory_it_needs(bumpy, caplog, monkeypatch):
    caplog.set_level("INFO", "stretchmap")
    sm.volume_map(bumpy, c=10.0, max_iter=0)
    assert "memory" not in caplog.text
    monkeypatch.setattr("stretchmap.volume.map._LARGE", len(bumpy.T) - 1)
    monkeypatch.setattr("stretchmap.volume.map._BYTES_PER_TET", {"vsem": 2**30 / len(bumpy.T)})
    sm.volume_map(bumpy, c=10.0, max_iter=0)
    assert f"{len(bumpy.T)} tets, method vsem: about 1.0 GiB" in caplog.text


def test_solvers_agree(bumpy):
    images = [
        sm.volume_map(bumpy, c=10.0, max_iter=5, options=sm.VolumeOptions(solver=solver)).image
        for solver in ("direct", "multigrid")
    ]
    assert np.abs(images[0] - images[1]).max() < 1e-6 * np.abs(images[0]).max()


@pytest.mark.parametrize("boundary", ["frozen", "glide"])
def test_certified_route_leaves_no_flip(bumpy, boundary):
    result = sm.volume_map(bumpy, boundary=boundary)
    assert result.certificate.certified
    assert result.distortion.flips == 0
    R, r = result.torus.R, result.torus.r
    surface = result.image[bumpy.boundary_vertices]
    tube = np.hypot(np.hypot(surface[:, 0], surface[:, 1]) - R, surface[:, 2])
    assert np.allclose(tube, r, rtol=1e-12)
    for stage in ("frozen", "glide"):
        energies = [record.energy for record in result.history if record.stage == stage]
        assert all(b <= a for a, b in pairwise(energies))


def test_gliding_improves_on_frozen(bumpy):
    frozen = sm.volume_map(bumpy, boundary="frozen").distortion
    glide = sm.volume_map(bumpy, boundary="glide").distortion
    assert glide.element_error_mean < frozen.element_error_mean
    assert glide.total_distortion < frozen.total_distortion


def test_same_input_same_bits(bumpy):
    a, b = (sm.volume_map(bumpy, max_iter=4).image for _ in range(2))
    assert np.array_equal(a, b)


def test_going_on_from_a_saved_map_lowers_the_distortion_further(bumpy, tmp_path):
    from stretchmap.maps.files import load_map

    first = sm.volume_map(bumpy, max_iter=12)
    first.save(tmp_path / "map.npz")
    loaded = load_map(tmp_path / "map.npz")
    again = sm.volume_map(loaded.mesh, start=loaded)
    assert again.certificate.certified
    assert again.distortion.element_error_mean < first.distortion.element_error_mean
    assert {record.stage for record in again.history} == {"glide", "equalize"}


def test_a_boundary_map_is_no_map_of_all_where_no_vertex_is_inside():
    """Taken for one, it has its volumes asked for before its shapes: SD 2.1, at rest."""
    solid = mug(6, 1, 6)
    assert len(solid.boundary_vertices) == solid.n_vertices
    start = sm.area_map(solid.surface, ratio=1.5, keep_best=True)
    patient = sm.VolumeOptions(time_limit=0.01)  # a fast machine takes half of the default
    result = sm.volume_map(solid, start=start, options=patient)
    assert result.converged or "are held" in result.stop_reason
    assert "frozen" in {record.stage for record in result.history}
    assert result.distortion.element_std < 0.3
    again = sm.volume_map(result.mesh, start=result, options=patient)
    assert "frozen" not in {record.stage for record in again.history}


def test_a_tangled_start_is_untangled(bumpy):
    good = sm.volume_map(bumpy, boundary="frozen", max_iter=6)
    inner = np.setdiff1d(np.arange(bumpy.n_vertices), bumpy.boundary_vertices)
    image = good.image.copy()
    image[inner] += 0.15 * good.torus.r * RNG.standard_normal((len(inner), 3))
    flips = np.count_nonzero(_core.mesh.tet_volumes(image, bumpy.T) <= 0.0)
    assert flips > 10
    start = dataclasses.replace(good, image=image)
    again = sm.volume_map(bumpy, start=start, max_iter=2)
    assert again.certificate.certified
    assert any(record.stage == "untangle" for record in again.history)


def test_ring_volumes_can_be_made_exact(bumpy):
    plain = sm.volume_map(bumpy, max_iter=20)
    exact = sm.volume_map(bumpy, max_iter=20, options=sm.VolumeOptions(vertex_exact=True))
    assert exact.vertex_exact and exact.certificate.certified
    inner = np.setdiff1d(np.arange(bumpy.n_vertices), bumpy.boundary_vertices)
    assert np.abs(exact.distortion.ring_ratios[inner] - 1.0).max() < 1e-9
    assert exact.distortion.element_std <= 1.25 * plain.distortion.element_std
    assert np.abs(plain.distortion.ring_ratios[inner] - 1.0).max() > 1e-6


def test_rings_that_no_free_vertex_changes_are_refused():
    """All round one free vertex is what the fixed ones enclose, wherever it is."""
    V = np.vstack([[[0.1, 0.0, 0.0]], np.eye(3), -np.eye(3)])
    T = [[0, 1 + 3 * a, 2 + 3 * b, 3 + 3 * c] for a in range(2) for b in range(2) for c in range(2)]
    star = TetMesh(V, T, orient=True)
    fixed = np.ones(7, np.uint8)
    fixed[0] = 0
    projection = _core.volume.RingProjection(star.T, fixed)
    with pytest.raises(SolverError, match="do not depend on any free vertex"):
        projection.step(star.V, np.full(7, 2.0 * star.volume), 1e-4, 100)


def test_a_ring_whose_volume_is_no_number_is_the_worst(bumpy):
    projection = _core.volume.RingProjection(bumpy.T, np.zeros(bumpy.n_vertices, np.uint8))
    rings = np.ones(bumpy.n_vertices)
    assert np.isfinite(projection.error(bumpy.V, rings))
    for i in (0, bumpy.n_vertices - 1):
        spoilt = rings.copy()
        spoilt[i] = np.nan
        assert np.isnan(projection.error(bumpy.V, spoilt))


def test_refinement_is_reported_or_refused(load_solid):
    solid = load_solid("kitten_jigsaw_small")
    with pytest.raises(DegenerateError) as caught:
        sm.volume_map(solid, options=sm.VolumeOptions(refine=False))
    assert caught.value.ids
    result = sm.volume_map(solid, max_iter=3)
    assert result.certificate.certified
    assert result.refinement is not None and result.refinement.n_split > 0
    assert np.array_equal(result.mesh.V[: solid.n_vertices], solid.V)
    assert result.to_dict()["added_vertices"] == result.refinement.n_split


@pytest.mark.parametrize(("rings", "rel"), [(True, 1e-3), (False, 1e-2)])
def test_renumbering_rotating_and_scaling_the_input_changes_nothing(bumpy, rings, rel):
    """The own boundary map stops at a tolerance; how far beyond it depends on rounding."""

    def distortion(solid):
        start = sm.area_map(solid.surface, tol=0.02) if rings else None
        return sm.volume_map(solid, c=0.0, max_iter=5, start=start).distortion

    order = RNG.permutation(bumpy.n_vertices)
    rank = np.argsort(order).astype(np.int32)
    Q = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    moved = TetMesh(37.0 * bumpy.V[order] @ Q.T + 5.0, rank[bumpy.T])
    reference, other = distortion(bumpy), distortion(moved)
    assert other.ring_std == pytest.approx(reference.ring_std, rel=rel)
    assert other.total_distortion == pytest.approx(reference.total_distortion, rel=rel)


@pytest.mark.parametrize(
    "options",
    [
        {"method": "magic"},
        {"boundary": "loose"},
        {"method": "vsem", "boundary": "glide"},
        {"method": "certified", "c": 1.0},
        {"c": -1.0},
        {"c": float("nan")},
        {"max_iter": -1},
        {"c": 1.0, "options": sm.VolumeOptions(vertex_exact=True)},
        {"c": 1.0, "options": sm.VolumeOptions(free_ratios=(0.5, 2.0))},
        {"c": 1.0, "options": sm.VolumeOptions(volume_weight=1.0)},
    ],
)
def test_bad_options_are_named(bumpy, options):
    with pytest.raises(OptionError):
        sm.volume_map(bumpy, **options)


def test_a_solid_that_crosses_itself_is_refused_before_the_work(bumpy):
    angle, far = 2.0 * np.arctan2(bumpy.V[:, 1], bumpy.V[:, 0]), np.hypot(*bumpy.V[:, :2].T)
    V = np.column_stack([far * np.cos(angle), far * np.sin(angle), bumpy.V[:, 2]])
    twice, steps = TetMesh(V, bumpy.T), []
    with pytest.raises(SelfIntersectionError, match="keep_best=True") as caught:
        sm.volume_map(twice, progress=lambda *a, **k: steps.append(a))
    assert not steps and np.isin(caught.value.ids, np.arange(twice.surface.n_faces)).all()
    with pytest.raises(SelfIntersectionError, match="boundary of the solid"):
        sm.fill(twice, bumpy.surface.V)
    assert sm.fill(twice, bumpy.surface.V, keep_best=True).distortion.flips == 0


def test_a_start_of_another_mesh_is_refused(bumpy):
    other = sm.area_map(samples.torus_surface(12, 8))
    with pytest.raises(KindError, match="of another surface"):
        sm.volume_map(bumpy, start=other)


@pytest.mark.parametrize("of_surface", [False, True])
def test_a_start_with_a_broken_image_is_refused_for_what_it_is(of_surface):
    solid = samples.bumpy_torus(600)
    start = sm.volume_map(solid, c=0.0, max_iter=0)
    if of_surface:
        start = start.boundary_map
    lost = np.array(start.image)
    lost[7, 1] = np.nan
    with pytest.raises(NonFiniteError, match="the image of start"):
        sm.volume_map(solid, start=dataclasses.replace(start, image=lost))
    for image in (start.image[:10], np.vstack([start.image, start.image])):
        with pytest.raises(ArrayError, match=f"the image of start has {len(image)} rows"):
            sm.volume_map(solid, start=dataclasses.replace(start, image=image))
    with pytest.raises(ArrayError, match="the image of start"):
        sm.volume_map(solid, start=dataclasses.replace(start, image=start.image[:, :2]))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("floor", 2.0),
        ("phase", 1e300),
        ("ratio", 1.0),
        ("ratio", 1.1e6),
        ("ratio", 1e300),
        ("tol", 5.0),
        ("patience", 0),
        ("untangle_iter", 1.5),
        ("time_limit", float("inf")),
        ("glide_tol", float("nan")),
        ("growth", "fast"),
        ("solver", "magic"),
        ("phase", float("inf")),
    ],
)
def test_options_name_what_they_may_be(name, value):
    with pytest.raises(OptionError, match=f"{name} must be"):
        sm.VolumeOptions(**{name: value})


def test_of_very_many_flipped_tets_a_knotted_hole_may_be_the_reason(monkeypatch):
    monkeypatch.setattr(budget, "_LEAST_SECONDS", 0.05)
    hasty = sm.VolumeOptions(time_limit=1e-9)
    with pytest.raises(CertificationError, match="hole is knotted"):
        sm.volume_map(mug(7, 1, 7), options=hasty)
    proven = sm.certify(samples.solid_torus(400), samples.solid_torus(400).V)
    crossed = dataclasses.replace(proven, certified=False, reason="2 faces cross")
    with pytest.raises(CertificationError) as caught:
        require_certified(crossed, "the map")
    assert str(caught.value).startswith("the map is not certified: 2 faces cross; keep_best=True")


def test_flat_faces_fill_the_torus_the_more_the_finer_they_are():
    filled = []
    for n_tets in (600, 20_000):
        found = sm.volume_map(sm.samples.solid_torus(n_tets))
        enclosed = found.mesh.tet_volumes.sum()  # the image has the volume of the source
        assert found.filled == pytest.approx(enclosed / found.torus.volume)
        assert found.to_dict()["filled"] == found.filled
        filled.append(found.filled)
    assert 0.7 < filled[0] < 0.9 and 0.97 < filled[1] < 1.0
