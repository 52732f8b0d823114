"""Scalar systems: closed forms, SciPy's factorization as second computation, honest failures."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

import linear_systems
from linear_systems import (
    BACKENDS,
    cube,
    laplacian,
    path_matrix,
    relative_residual,
    restrict,
    squeezed,
)
from stretchmap import _core
from stretchmap.errors import MissingDependencyError, OptionError, SolverError


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
import hashlib, sys, numpy as np
sys.path.insert(0, sys.argv[1])
import linear_systems as t
points, tets, inner = t.cube(25)
matrix = t.restrict(t.squeezed(points, tets, 0.3), inner)
rhs = np.random.default_rng(0).standard_normal((len(inner), 3))
x, _ = t._core.linalg.SpdSolver(matrix, "multigrid").solve(rhs, np.zeros_like(rhs), 1e-9)
print(hashlib.sha256(x.tobytes()).hexdigest())
"""


def test_same_bits_for_any_number_of_threads():
    here = os.path.dirname(linear_systems.__file__)
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
