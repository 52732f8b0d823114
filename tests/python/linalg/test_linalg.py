"""Linear solvers: closed forms, SciPy's factorisation as second computation, honest failures."""

from __future__ import annotations

import hashlib
import itertools
import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stretchmap import _core
from stretchmap.errors import MissingDependencyError, OptionError, SolverError

BACKENDS = ["direct", "multigrid", "jacobi"]
try:
    _core.linalg.SpdSolver(sp.identity(1, format="csr"), "cholmod")
    BACKENDS.append("cholmod")
except MissingDependencyError:
    pass


# ------------------------------------------------------------------------------ test systems


def cube(m):
    """Vertices and tets of the unit cube, m^3 cells of six tets each, and the inner vertices."""
    ids = np.arange((m + 1) ** 3).reshape(m + 1, m + 1, m + 1)
    points = np.stack(np.meshgrid(*[np.linspace(0, 1, m + 1)] * 3, indexing="ij"), -1)
    tets = []
    for path in itertools.permutations(np.eye(3, dtype=int)):
        corners = np.vstack([[0, 0, 0], np.cumsum(path, axis=0)])
        tet = [ids[i : i + m, j : j + m, k : k + m].ravel() for i, j, k in corners]
        if np.linalg.det(np.array(path)) < 0:
            tet[2], tet[3] = tet[3], tet[2]
        tets.append(np.stack(tet, 1))
    inner = ids[1:-1, 1:-1, 1:-1].ravel()
    return points.reshape(-1, 3), np.vstack(tets), inner


def area_vectors(points, tets):
    """Twice the inward area vector opposite each corner (k, 4, 3), and the volumes."""
    a, b, c, d = (points[tets[:, i]] for i in range(4))
    g = np.stack(
        [
            np.cross(d - b, c - b),
            np.cross(c - a, d - a),
            np.cross(d - a, b - a),
            np.cross(b - a, c - a),
        ],
        1,
    )
    return g, np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6


def laplacian(points, tets, weight_volumes=None):
    """P1 stiffness matrix; with the volumes of another shape, the stretch Laplacian."""
    g, volume = area_vectors(points, tets)
    size = np.abs(volume) if weight_volumes is None else weight_volumes
    local = np.einsum("eic,ejc->eij", g, g) / (36 * size)[:, None, None]
    rows, columns = np.repeat(tets, 4, 1), np.tile(tets, (1, 4))
    n = len(points)
    return sp.csr_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))


def restrict(matrix, ids):
    inner = matrix[ids][:, ids].tocsr()
    inner.sort_indices()
    return inner


def squeezed(points, tets, noise, seed=0):
    """Stretch Laplacian of a strongly and unevenly stretched, noisy image."""
    volume = np.abs(area_vectors(points, tets)[1])
    h = volume.mean() ** (1 / 3)
    image = points * np.exp(1.5 * np.sin(3 * np.pi * (points - points.min(0)) / np.ptp(points)))
    image = image + noise * h * np.random.default_rng(seed).standard_normal(points.shape)
    return laplacian(image, tets, volume)


def neo_hookean(points, tets, image, poisson):
    """Element Hessians (k, 12, 12) of mu/2 |F|^2 - mu log J + lambda/2 log^2 J, made positive."""
    g, volume = area_vectors(points, tets)
    gradients = g / (6 * volume)[:, None, None]
    deformation = np.einsum("eia,eib->eab", image[tets], gradients)
    lame, mu = poisson / ((1 + poisson) * (1 - 2 * poisson)), 1 / (2 * (1 + poisson))
    inverse, log_det = np.linalg.inv(deformation), np.log(np.linalg.det(deformation))
    eye = np.eye(3)
    tangent = mu * np.einsum("ik,JL->iJkL", eye, eye)[None]
    tangent = tangent + lame * np.einsum("eJi,eLk->eiJkL", inverse, inverse)
    twist = np.einsum("eLi,eJk->eiJkL", inverse, inverse)
    tangent = tangent + (mu - lame * log_det)[:, None, None, None, None] * twist
    values, vectors = np.linalg.eigh(tangent.reshape(-1, 9, 9))
    tangent = np.einsum("eab,eb,ecb->eac", vectors, np.maximum(values, 1e-6), vectors)
    spread = np.einsum("eiJ,cd->ecJid", gradients, eye).reshape(-1, 9, 12)
    return np.einsum("e,eab,eac,ebd->ecd", volume, tangent, spread, spread, optimize=True)


def assemble_blocks(local, tets, n, missing, frames=None):
    """Block matrix of element matrices (k, 12, 12), identity in the missing unknowns."""
    if frames is not None:
        q = frames[tets]
        local = np.einsum(
            "eiba,eibjd,ejdc->eiajc", q, local.reshape(-1, 4, 3, 4, 3), q, optimize=True
        )
    unknowns = (3 * tets[:, :, None] + np.arange(3)).reshape(-1, 12)
    rows, columns = np.repeat(unknowns, 12, 1), np.tile(unknowns, (1, 12))
    matrix = sp.csr_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * n, 3 * n))
    keep = np.ones(3 * n)
    keep[missing] = 0
    matrix = sp.diags(keep) @ matrix @ sp.diags(keep) + sp.diags(1 - keep)
    blocks = sp.bsr_matrix(matrix, blocksize=(3, 3))
    blocks.sort_indices()
    return blocks


def block_solver(blocks, modes=None, preconditioner="multigrid"):
    n = blocks.shape[0] // 3
    return _core.testing.BlockSolver(
        blocks.indptr.astype(np.int32),
        blocks.indices.astype(np.int32),
        blocks.data.ravel().copy(),
        np.ascontiguousarray(_core.testing.translations(n) if modes is None else modes),
        preconditioner,
    )


def relative_residual(matrix, x, b):
    return np.linalg.norm(b - matrix @ x, axis=0) / np.linalg.norm(b, axis=0)


@pytest.fixture(scope="module")
def solid():
    """A cube of 2744 cells: points, tets, inner vertices."""
    return cube(14)


@pytest.fixture(scope="module")
def deformed_solid():
    """The Hessian of a deformed cube whose surface is held, for a given Poisson ratio."""
    points, tets, inner = cube(8)
    image = points + 0.08 * np.sin(2 * np.pi * points[:, [1, 2, 0]])
    image += 0.003 * np.random.default_rng(3).standard_normal(points.shape)
    assert (area_vectors(image, tets)[1] > 0).all()
    held = np.setdiff1d(np.arange(len(points)), inner)
    missing = (3 * held[:, None] + np.arange(3)).ravel()

    def system(poisson):
        local = neo_hookean(points, tets, image, poisson)
        return assemble_blocks(local, tets, len(points), missing), image, missing

    return system


# ------------------------------------------------------------------------------ scalar systems


@pytest.mark.parametrize("backend", BACKENDS)
def test_poisson_on_a_line_is_exact_at_the_nodes(backend):
    """-u'' = 1 with u(0) = u(1) = 0: the P1 solution is x (1 - x) / 2 at the nodes."""
    n, h = 99, 0.01
    matrix = sp.diags([-1 / h, 2 / h, -1 / h], [-1, 0, 1], (n, n), format="csr")
    solver = _core.linalg.SpdSolver(matrix, backend)
    x, report = solver.solve(np.full((n, 1), h), np.zeros((n, 1)), 1e-12)
    nodes = h * np.arange(1, n + 1)
    assert solver.backend == backend
    assert report.converged
    np.testing.assert_allclose(x[:, 0], nodes * (1 - nodes) / 2, rtol=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
def test_harmonic_extension_of_a_linear_function_is_linear(backend, solid):
    points, tets, inner = solid
    matrix = laplacian(points, tets)
    outer = np.setdiff1d(np.arange(len(points)), inner)
    rhs = -(matrix[inner][:, outer] @ points[outer])
    x, report = _core.linalg.SpdSolver(restrict(matrix, inner), backend).solve(
        rhs, np.zeros_like(rhs), 1e-11
    )
    np.testing.assert_allclose(x, points[inner], atol=1e-9)
    assert max(report.residual) <= 1e-11


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("noise", [0.1, 0.6])
def test_stretched_weights_agree_with_a_factorization(backend, noise, solid):
    """Weights over five orders of magnitude, a third of them of the wrong sign."""
    points, tets, inner = solid
    matrix = restrict(squeezed(points, tets, noise), inner)
    off_diagonal = matrix - sp.diags(matrix.diagonal())
    assert (off_diagonal.data > 0).mean() > 0.1
    assert matrix.diagonal().max() > 1e4 * matrix.diagonal().min()
    rhs = np.random.default_rng(1).standard_normal((len(inner), 3))
    x, report = _core.linalg.SpdSolver(matrix, backend).solve(rhs, np.zeros_like(rhs), 1e-11, 5000)
    expected = splu(matrix.tocsc()).solve(rhs)
    assert np.linalg.norm(x - expected) < 1e-7 * np.linalg.norm(expected)
    residual = relative_residual(matrix, x, rhs)
    np.testing.assert_allclose(report.residual, residual, rtol=1e-2, atol=1e-16)


def test_multigrid_iterations_hardly_grow_with_the_mesh():
    steps = []
    for m in (8, 16, 32):
        points, tets, inner = cube(m)
        matrix = restrict(laplacian(points, tets), inner)
        rhs = np.random.default_rng(0).standard_normal((len(inner), 3))
        _, report = _core.linalg.SpdSolver(matrix, "multigrid").solve(rhs, np.zeros_like(rhs), 1e-8)
        steps.append(report.iterations)
    assert steps[-1] <= 15
    assert steps[-1] <= steps[0] + 5


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("k", [1, 2, 3, 4, 7])
def test_columns_are_independent(backend, k):
    points, tets, inner = cube(8)
    matrix = restrict(laplacian(points, tets), inner)
    rhs = np.random.default_rng(k).standard_normal((len(inner), k))
    rhs[:, 0] = 0.0
    solver = _core.linalg.SpdSolver(matrix, backend)
    x, report = solver.solve(rhs, np.ones_like(rhs), 1e-10)
    assert len(report.residual) == k
    assert not x[:, 0].any()
    np.testing.assert_allclose(x, splu(matrix.tocsc()).solve(rhs), atol=1e-8)


def test_warm_start(solid):
    points, tets, inner = solid
    matrix = restrict(laplacian(points, tets), inner)
    rhs = np.random.default_rng(0).standard_normal((len(inner), 3))
    solver = _core.linalg.SpdSolver(matrix, "multigrid")
    x, cold = solver.solve(rhs, np.zeros_like(rhs), 1e-8)
    again, report = solver.solve(rhs, x, 1e-8)
    assert report.iterations == 0
    np.testing.assert_array_equal(again, x)
    _, warm = solver.solve(rhs, x * (1 + 1e-4), 1e-8)
    assert 0 < warm.iterations < cold.iterations


@pytest.mark.parametrize("backend", BACKENDS)
def test_refactor_follows_the_values(backend, solid):
    """New values on the old analysis: as accurate as a new solver, and no slower for long."""
    points, tets, inner = solid
    rhs = np.random.default_rng(0).standard_normal((len(inner), 3))
    first = restrict(squeezed(points, tets, 0.0), inner)
    second = restrict(squeezed(points, tets, 0.5, seed=1), inner)
    assert (first.indices == second.indices).all()
    solver = _core.linalg.SpdSolver(first, backend)
    solver.solve(rhs, np.zeros_like(rhs), 1e-9, 5000)
    fresh = _core.linalg.SpdSolver(second, backend).solve(rhs, np.zeros_like(rhs), 1e-9, 5000)[1]
    for _ in range(2):
        solver.refactor(second.data)
        x, report = solver.solve(rhs, np.zeros_like(rhs), 1e-9, 5000)
        assert relative_residual(second, x, rhs).max() <= 1e-9
    assert report.iterations <= 2 * fresh.iterations + 2
    with pytest.raises(SolverError, match="number of values"):
        solver.refactor(second.data[:-1])


@pytest.mark.parametrize("backend", BACKENDS)
def test_units_do_not_matter(backend, solid):
    """Powers of two far outside single precision's range change the digits not at all."""
    points, tets, inner = solid
    matrix = restrict(laplacian(points, tets), inner)
    rhs = np.random.default_rng(0).standard_normal((len(inner), 3))
    x, _ = _core.linalg.SpdSolver(matrix, backend).solve(rhs, np.zeros_like(rhs), 1e-9)
    solver = _core.linalg.SpdSolver((matrix * 2.0**-200).tocsr(), backend)
    y, _ = solver.solve(rhs * 2.0**200, np.zeros_like(rhs), 1e-9)
    np.testing.assert_array_equal(y, x * 2.0**400)


def test_an_old_preconditioner_serves_for_a_small_change(solid):
    points, tets, inner = solid
    rhs = np.random.default_rng(0).standard_normal((len(inner), 3))
    first = restrict(squeezed(points, tets, 0.20), inner)
    second = restrict(squeezed(points, tets, 0.21), inner)
    solver = _core.linalg.SpdSolver(first, "multigrid")
    _, fresh = solver.solve(rhs, np.zeros_like(rhs), 1e-9)
    solver.refactor(second.data, keep_preconditioner=True)
    x, kept = solver.solve(rhs, np.zeros_like(rhs), 1e-9)
    assert relative_residual(second, x, rhs).max() <= 1e-9
    assert fresh.iterations <= kept.iterations <= 2 * fresh.iterations


def test_numbering_of_the_unknowns_does_not_matter(solid):
    points, tets, inner = solid
    matrix = restrict(squeezed(points, tets, 0.3), inner)
    rhs = np.random.default_rng(0).standard_normal((len(inner), 2))
    shuffle = np.random.default_rng(1).permutation(len(inner))
    x, a = _core.linalg.SpdSolver(matrix, "multigrid").solve(rhs, np.zeros_like(rhs), 1e-11)
    y, b = _core.linalg.SpdSolver(restrict(matrix, shuffle), "multigrid").solve(
        rhs[shuffle], np.zeros_like(rhs), 1e-11
    )
    np.testing.assert_allclose(y, x[shuffle], rtol=0, atol=1e-7 * abs(x).max())
    assert abs(a.iterations - b.iterations) <= 4


def test_components_and_uncoupled_unknowns():
    """Two pieces and a row that stands alone."""
    points, tets, inner = cube(8)
    piece = restrict(laplacian(points, tets), inner)
    matrix = sp.block_diag([piece, sp.csr_matrix([[2.0]]), 1e-6 * piece]).tocsr()
    rhs = np.random.default_rng(0).standard_normal((matrix.shape[0], 1))
    x, _ = _core.linalg.SpdSolver(matrix, "multigrid").solve(rhs, np.zeros_like(rhs), 1e-12)
    np.testing.assert_allclose(x, splu(matrix.tocsc()).solve(rhs[:, 0])[:, None], rtol=1e-6)


def test_choice_of_backend(load_solid):
    """A surface and a small solid are factored, a large solid is not."""
    solid = load_solid("rocker_arm_25182")
    inner = np.flatnonzero(solid.boundary_index < 0)
    matrix = restrict(laplacian(solid.V, solid.T), inner)
    assert _core.linalg.SpdSolver(matrix).backend == "multigrid"
    points, tets, few = cube(8)
    assert _core.linalg.SpdSolver(restrict(laplacian(points, tets), few)).backend == "direct"
    n = 150
    line = sp.diags([-1.0, 2.1, -1.0], [-1, 0, 1], (n, n))
    surface = sp.kronsum(line, line).tocsr()
    assert surface.shape[0] == 22500
    assert _core.linalg.SpdSolver(surface).backend == "direct"


def test_paper_size_solid(load_solid):
    """The boundary's coordinates extended into a scanned shape: few steps, checked afterwards."""
    solid = load_solid("rocker_arm_25182")
    inner = np.flatnonzero(solid.boundary_index < 0)
    matrix = laplacian(solid.V, solid.T)
    rhs = -(matrix[inner][:, solid.boundary_vertices] @ solid.V[solid.boundary_vertices])
    solver = _core.linalg.SpdSolver(restrict(matrix, inner), "multigrid")
    x, report = solver.solve(rhs, np.zeros_like(rhs), 1e-10)
    assert report.iterations <= 25
    # The coordinates themselves are harmonic.
    np.testing.assert_allclose(x, solid.V[inner], atol=1e-7 * np.ptp(solid.V))


# ------------------------------------------------------------------------------ failures


def path_matrix(n=400):
    return sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], (n, n), format="csr")


@pytest.mark.parametrize("backend", BACKENDS)
def test_indefinite_is_refused(backend):
    matrix = (path_matrix() - 0.5 * sp.eye(400)).tocsr()
    rhs = np.random.default_rng(0).standard_normal((400, 1))
    with pytest.raises(SolverError, match="not positive definite"):
        _core.linalg.SpdSolver(matrix, backend).solve(rhs, np.zeros_like(rhs))


@pytest.mark.parametrize("backend", BACKENDS)
def test_bad_diagonal_is_named(backend):
    matrix = path_matrix()
    matrix[7, 7] = -1.0
    with pytest.raises(SolverError, match="row 7") as caught:
        _core.linalg.SpdSolver(matrix, backend)
    assert caught.value.ids == (7,)


@pytest.mark.parametrize("backend", BACKENDS)
def test_refusals(backend):
    skew = path_matrix().tolil()
    skew[3, 4] = -0.5
    with pytest.raises(SolverError, match="not symmetric"):
        _core.linalg.SpdSolver(skew.tocsr(), backend)
    holed = path_matrix()
    holed.data[5] = np.nan
    with pytest.raises(SolverError, match="not finite"):
        _core.linalg.SpdSolver(holed, backend)
    with pytest.raises(SolverError, match="square"):
        _core.linalg.SpdSolver(path_matrix()[:-1], backend)
    solver = _core.linalg.SpdSolver(path_matrix(), backend)
    with pytest.raises(SolverError, match="not finite"):
        solver.solve(np.full((400, 1), np.nan), np.zeros((400, 1)))
    with pytest.raises(SolverError, match="row per unknown"):
        solver.solve(np.ones((399, 1)), np.zeros((399, 1)))


def test_unknown_backend():
    if "cholmod" not in BACKENDS:
        with pytest.raises(MissingDependencyError, match="STRETCHMAP_CHOLMOD=ON"):
            _core.linalg.SpdSolver(path_matrix(), "cholmod")
    with pytest.raises(OptionError, match="choose auto, direct"):
        _core.linalg.SpdSolver(path_matrix(), "lu")


def test_not_converged_is_an_error_unless_asked_otherwise():
    rhs = np.ones((400, 1))
    solver = _core.linalg.SpdSolver(path_matrix(), "jacobi")
    with pytest.raises(SolverError, match="stopped at a relative residual"):
        solver.solve(rhs, np.zeros_like(rhs), 1e-10, 5)
    x, report = solver.solve(rhs, np.zeros_like(rhs), 1e-10, 5, must_converge=False)
    assert not report.converged
    assert report.iterations == 5
    np.testing.assert_allclose(report.residual, relative_residual(path_matrix(), x, rhs))


_THREADS = """
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
import test_linalg as t
points, tets, inner = t.cube(25)
matrix = t.restrict(t.squeezed(points, tets, 0.3), inner)
rhs = np.random.default_rng(0).standard_normal((len(inner), 3))
x, _ = t._core.linalg.SpdSolver(matrix, "multigrid").solve(rhs, np.zeros_like(rhs), 1e-9)
print(t.hashlib.sha256(x.tobytes()).hexdigest())
"""


def test_same_bits_for_any_number_of_threads():
    here = os.path.dirname(__file__)
    digests = {
        subprocess.run(
            [sys.executable, "-c", _THREADS, here],
            env={**os.environ, "OMP_NUM_THREADS": str(threads)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for threads in (1, 2, 3)
    }
    assert len(digests) == 1
    assert len(digests.pop()) == len(hashlib.sha256(b"").hexdigest())


# ------------------------------------------------------------------------------ block systems


def test_modes_are_the_kernel_of_free_elasticity():
    """Without a held vertex the Hessian at rest annihilates translations and rotations."""
    points, tets, _ = cube(4)
    local = neo_hookean(points, tets, points, 0.3)
    stiffness = assemble_blocks(local, tets, len(points), [])
    modes = _core.testing.rigid_body_modes(points)
    np.testing.assert_array_equal(modes[:, :3], _core.testing.translations(len(points)))
    assert np.linalg.matrix_rank(modes) == 6
    # The clamp at 1e-6 that makes the elements definite is all that rotations see.
    assert abs(stiffness @ modes).max() < 1e-5 * abs(stiffness.data).max()


@pytest.mark.parametrize("preconditioner", ["multigrid", "jacobi"])
@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("poisson", [0.3, 0.45, 0.49])
def test_newton_systems_agree_with_a_factorization(preconditioner, rigid, poisson, deformed_solid):
    blocks, image, missing = deformed_solid(poisson)
    rhs = np.random.default_rng(0).standard_normal((len(image), 3))
    modes = (
        _core.testing.rigid_body_modes(image) if rigid else _core.testing.translations(len(image))
    )
    solver = block_solver(blocks, modes, preconditioner)
    x, report = solver.solve(rhs, np.zeros_like(rhs), 1e-9, 3000)
    expected = splu(blocks.tocsc()).solve(rhs.ravel())
    assert np.linalg.norm(x.ravel() - expected) < 1e-6 * np.linalg.norm(expected)
    np.testing.assert_allclose(x.ravel()[missing], rhs.ravel()[missing], rtol=1e-6)
    residual = relative_residual(blocks, x.reshape(-1, 1), rhs.reshape(-1, 1))
    np.testing.assert_allclose(report.residual, residual, rtol=1e-2)
    if preconditioner == "multigrid":
        assert report.iterations <= {0.3: 20, 0.45: 30, 0.49: 60}[poisson]


def test_rigid_modes_pay_where_the_boundary_glides(deformed_solid):
    """Two unknowns in a tangent frame on the surface: the modes follow the frames."""
    points, tets, inner = cube(8)
    held = np.setdiff1d(np.arange(len(points)), inner)
    normals = points[held] - 0.5
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    helper = np.eye(3)[np.abs(normals).argmin(1)]
    first = np.cross(normals, helper)
    first /= np.linalg.norm(first, axis=1)[:, None]
    frames = np.tile(np.eye(3), (len(points), 1, 1))
    frames[held] = np.stack([first, np.cross(normals, first), normals], 2)
    missing = 3 * held + 2
    local = neo_hookean(points, tets, points, 0.4)
    blocks = assemble_blocks(local, tets, len(points), missing, frames)
    blocks = sp.bsr_matrix(blocks + 1e-4 * sp.diags(blocks.diagonal()), blocksize=(3, 3))
    blocks.sort_indices()

    def in_frames(modes):
        turned = np.einsum("nba,nbk->nak", frames, modes.reshape(len(points), 3, -1))
        return turned.reshape(3 * len(points), -1)

    rhs = np.random.default_rng(0).standard_normal((len(points), 3))
    expected = splu(blocks.tocsc()).solve(rhs.ravel())
    iterations = []
    for modes in (
        _core.testing.translations(len(points)),
        in_frames(_core.testing.translations(len(points))),
        in_frames(_core.testing.rigid_body_modes(points)),
    ):
        x, report = block_solver(blocks, modes).solve(rhs, np.zeros_like(rhs), 1e-9, 3000)
        assert np.linalg.norm(x.ravel() - expected) < 1e-5 * np.linalg.norm(expected)
        iterations.append(report.iterations)
    assert iterations[0] > iterations[1] > iterations[2]


def test_block_refactor_and_warm_start(deformed_solid):
    blocks, image, _ = deformed_solid(0.3)
    stiffer, _, _ = deformed_solid(0.45)
    rhs = np.random.default_rng(0).standard_normal((len(image), 3))
    solver = block_solver(blocks)
    x, cold = solver.solve(rhs, np.zeros_like(rhs), 1e-6)
    _, warm = solver.solve(rhs, x, 1e-6)
    assert warm.iterations == 0 < cold.iterations
    solver.refactor(stiffer.data.ravel())
    y, report = solver.solve(rhs, x, 1e-8)
    np.testing.assert_allclose(
        report.residual, relative_residual(stiffer, y.reshape(-1, 1), rhs.reshape(-1, 1)), rtol=0.01
    )


@pytest.mark.parametrize("preconditioner", ["multigrid", "jacobi"])
def test_negative_curvature_is_reported_with_a_descent_direction(preconditioner, deformed_solid):
    blocks, image, _ = deformed_solid(0.3)
    lowest = 0.5 * abs(blocks).sum(1).mean()
    shifted = blocks - 0.2 * lowest * sp.eye(blocks.shape[0])
    shifted = sp.bsr_matrix(shifted, blocksize=(3, 3))
    shifted.sort_indices()
    assert sp.linalg.eigsh(shifted.tocsc(), 1, which="SA")[0][0] < 0
    rhs = np.random.default_rng(0).standard_normal((len(image), 3))
    solver = block_solver(shifted, preconditioner=preconditioner)
    x, report = solver.solve(rhs, np.zeros_like(rhs), 1e-8)
    assert report.negative_curvature
    assert not report.converged
    assert (x * rhs).sum() > 0


def test_block_failures(deformed_solid):
    blocks, image, _ = deformed_solid(0.3)
    rhs = np.ones((len(image), 3))
    solver = block_solver(blocks)
    with pytest.raises(SolverError, match="not finite"):
        solver.solve(np.full_like(rhs, np.inf), np.zeros_like(rhs))
    with pytest.raises(SolverError, match="stopped at a relative residual"):
        solver.solve(rhs, np.zeros_like(rhs), 1e-12, 2)
    values = blocks.data.copy()
    diagonal = blocks.indptr[5] + np.flatnonzero(
        blocks.indices[blocks.indptr[5] : blocks.indptr[6]] == 5
    )
    values[diagonal] *= -1
    with pytest.raises(SolverError, match="vertex 5") as caught:
        solver.refactor(values.ravel())
    assert caught.value.ids == (5,)
    with pytest.raises(OptionError, match="multigrid or jacobi"):
        block_solver(blocks, preconditioner="ilu")
    with pytest.raises(SolverError, match="near-nullspace"):
        block_solver(blocks, modes=np.ones((6, 3)))
