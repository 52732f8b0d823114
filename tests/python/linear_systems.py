"""Linear systems of meshes: Poisson, elasticity, and how far a solution is off."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp

from stretchmap import _core
from stretchmap.errors import MissingDependencyError

BACKENDS = ["direct", "multigrid", "jacobi"]
try:
    _core.linalg.SpdSolver(sp.identity(1, format="csr"), "cholmod")
    BACKENDS.append("cholmod")
except MissingDependencyError:
    pass


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


def block_solver(blocks, modes=None, preconditioner="multigrid", ordered=False):
    n = blocks.shape[0] // 3
    return _core.testing.BlockSolver(
        blocks.indptr.astype(np.int32),
        blocks.indices.astype(np.int32),
        blocks.data.ravel().copy(),
        np.ascontiguousarray(_core.testing.translations(n) if modes is None else modes),
        preconditioner,
        ordered,
    )


def relative_residual(matrix, x, b):
    return np.linalg.norm(b - matrix @ x, axis=0) / np.linalg.norm(b, axis=0)


def path_matrix(n=400):
    return sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], (n, n), format="csr")
