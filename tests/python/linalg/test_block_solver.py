"""Block systems: the kernel of elasticity, SciPy's factorization, curvature that is negative."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from linear_systems import assemble_blocks, block_solver, cube, neo_hookean, relative_residual
from stretchmap import _core
from stretchmap.errors import OptionError, SolverError


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


def chained(n, seed=0):
    """Blocks that couple each row to the next few, to some so much that sweeps in parts diverge."""
    rng = np.random.default_rng(seed)
    graph = sum(np.diag(np.ones(n - k), -k) for k in range(1, 25)) > 0
    lower = np.kron(np.where(graph, 1.0, 0.0), np.eye(3)) * rng.standard_normal((3 * n, 3 * n))
    matrix = lower @ lower.T + 1e-2 * np.eye(3 * n)
    return sp.bsr_matrix(matrix, blocksize=(3, 3))


@pytest.mark.parametrize("blocks", [chained(900), None], ids=["chained", "solid"])
def test_what_sweeps_leave_unbalanced_stands_for_a_product(blocks, deformed_solid):
    """Iterates of a loose solve, which makes no products, are those of one that does."""
    blocks = deformed_solid(0.45)[0] if blocks is None else blocks
    rhs = np.random.default_rng(1).standard_normal((blocks.shape[0] // 3, 3))
    solver = block_solver(blocks, ordered=True)
    for steps in (1, 2, 4):
        found = {
            tol: solver.solve(rhs, np.zeros_like(rhs), tol, steps, False) for tol in (0.01, 0.0099)
        }
        (loose, first), (tight, second) = found.values()
        assert first.iterations == second.iterations == steps
        np.testing.assert_allclose(loose, tight, atol=1e-5 * abs(tight).max())


def soft_groups(n, size, seed=0):
    """Blocks far stiffer in two directions than in the third, along which rows far apart couple."""
    rng = np.random.default_rng(seed)
    soft = rng.standard_normal((n, 3))
    soft /= np.linalg.norm(soft, axis=1)[:, None]
    along = np.einsum("ia,ib->iab", soft, soft)
    factors = rng.standard_normal((size, size - 1))
    coupling = factors @ factors.T + 0.1 * np.eye(size)
    coupling /= np.sqrt(np.outer(coupling.diagonal(), coupling.diagonal()))
    i, j = (rows.ravel() for rows in np.indices((size, size)))
    columns = np.arange(n).reshape(size, -1)
    rows, cols = columns[i].ravel(), columns[j].ravel()
    values = np.repeat(coupling[i, j], n // size)[:, None, None] * np.einsum(
        "ea,eb->eab", soft[rows], soft[cols]
    )
    values[rows == cols] += 100.0 * (np.eye(3) - along[rows[rows == cols]])
    order = np.lexsort((cols, rows))
    starts = size * np.arange(n + 1)
    return sp.bsr_matrix((values[order], cols[order], starts), shape=(3 * n, 3 * n))


@pytest.mark.parametrize("seed", range(4))
def test_sweeps_in_parts_are_definite_where_blocks_are_stiff_in_some_directions(seed):
    blocks = soft_groups(6000, 6, seed)
    rhs = np.random.default_rng(3).standard_normal((blocks.shape[0] // 3, 3))
    x, report = block_solver(blocks, ordered=True).solve(rhs, np.zeros_like(rhs), 1e-8, 200)
    assert report.converged and not report.negative_curvature
    assert relative_residual(blocks, x.reshape(-1, 1), rhs.reshape(-1, 1)) < 1e-7


def test_kept_sweeps_tell_nothing_of_new_values(deformed_solid):
    """They leave the old equations unbalanced: products are made with the new ones."""
    blocks, stiffer = deformed_solid(0.3)[0], deformed_solid(0.45)[0]
    rhs = np.random.default_rng(2).standard_normal((blocks.shape[0] // 3, 3))
    solver = block_solver(blocks, ordered=True)
    solver.refactor(stiffer.data.ravel(), keep_preconditioner=True)
    loose, _ = solver.solve(rhs, np.zeros_like(rhs), 0.01, 3, False)
    tight, _ = solver.solve(rhs, np.zeros_like(rhs), 0.0099, 3, False)
    np.testing.assert_allclose(loose, tight, atol=1e-5 * abs(tight).max())


@pytest.mark.parametrize("stiffness", [0.0, 1e5])
def test_stiff_springs_bring_products_back(stiffness, deformed_solid):
    """Where rounding of what replaces them shifts the residual, as it does round slivers."""
    blocks = deformed_solid(0.45)[0].tolil()
    rng = np.random.default_rng(3)
    n = blocks.shape[0] // 3
    for i in rng.choice(n, n // 20, replace=False):
        direction = rng.standard_normal(3)
        spring = stiffness * (np.eye(3) + np.outer(direction, direction))
        row = blocks[3 * i : 3 * i + 3].tocsr()
        j = rng.choice(np.unique(row.indices // 3))
        for a, b, sign in ((i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)):
            blocks[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += sign * spring
    solver = block_solver(sp.bsr_matrix(blocks, blocksize=(3, 3)), ordered=True)
    rhs = rng.standard_normal((n, 3))
    _, report = solver.solve(rhs, np.zeros_like(rhs), 0.1, 500, False)
    assert report.converged
    loose, tight = (
        solver.solve(rhs, np.zeros_like(rhs), tol, 3, False)[0] for tol in (0.01, 0.0099)
    )
    assert (loose == tight).all() == (stiffness > 0.0)


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
