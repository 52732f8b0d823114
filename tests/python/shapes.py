"""Small meshes of known topology: boxes of cubes cut into tets, and a torus of revolution."""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from stretchmap import TetMesh, Torus, TriMesh, _core, samples
from stretchmap.maps.files import LoadedMap

# The six tets of a cube round its diagonal: neighbouring cubes then agree on their common square.
_KUHN = np.array(
    [
        [np.zeros(3, int), *np.cumsum(np.eye(3, dtype=int)[list(p)], axis=0)]
        for p in permutations(range(3))
    ]
)


def cubes(filled: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Tets of all filled cells of a grid, positively oriented, every point in use."""
    corners = np.argwhere(filled)[:, None, None, :] + _KUHN
    points, ids = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    tets = ids.reshape(-1, 4).astype(np.int32)
    x = points[tets].astype(float)
    negative = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    tets[negative] = tets[negative][:, [0, 1, 3, 2]]
    return points.astype(float), tets


def box(*shape: int, holes: tuple[tuple[int, int, int], ...] = ()) -> NDArray[np.bool_]:
    """All cells of a grid but the ones named."""
    filled = np.ones(shape, bool)
    for hole in holes:
        filled[hole] = False
    return filled


BALL = box(1, 1, 1)
RING = box(3, 3, 1, holes=((1, 1, 0),))
DOUBLE = box(5, 3, 1, holes=((1, 1, 0), (3, 1, 0)))
SHELL = box(3, 3, 3, holes=((1, 1, 1),))


def mug(width: int, wall: int, height: int) -> TetMesh:
    """A square one with a handle; no vertex is inside a wall of one cell."""
    filled = box(width + 4, width, height)
    filled[width:] = False
    filled[wall : width - wall, wall : width - wall, wall:] = False
    filled[width : width + 3, width // 2, [1, height - 2]] = True
    filled[width + 2, width // 2, 1 : height - 1] = True
    return TetMesh(*cubes(filled))


def thick_ring_with_bubble() -> NDArray[np.bool_]:
    """A solid torus with a cavity."""
    filled = box(7, 7, 3, holes=((1, 1, 1),))
    filled[3, 3, :] = False
    return filled


def torus(nu: int = 12, nv: int = 8) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A torus of revolution with outward faces."""
    u, v = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    a, b = 2 * np.pi * u / nu, 2 * np.pi * v / nv
    rho = 1 + 0.4 * np.cos(b)
    points = np.stack([rho * np.cos(a), rho * np.sin(a), 0.4 * np.sin(b)], axis=-1).reshape(-1, 3)
    i, j = (u + 1) % nu, (v + 1) % nv
    p, q, r, s = u * nv + v, i * nv + v, i * nv + j, u * nv + j
    lower, upper = np.stack([p, q, r], -1), np.stack([p, r, s], -1)
    return points, np.stack([lower, upper], axis=2).reshape(-1, 3).astype(np.int32)


def a_map(solid, image, torus=None):
    """A map file's content made of a solid and an image."""
    return LoadedMap(
        mesh=solid,
        image=image,
        torus=torus,
        arrays={},
        meta={},
        converged=True,
        stop_reason="",
        seconds={},
    )


def torus_grid(nu: int, nv: int, ratio: float, seed: int | None = None) -> TriMesh:
    """Torus of revolution sampled evenly in the equal-area coordinates (u, s)."""
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    u, s = 2.0 * np.pi * i.ravel() / nu, 2.0 * np.pi * j.ravel() / nv
    v = _core.area.angle_from_equal_area(s, 1.0 / ratio)
    points = Torus(ratio, 1.0).xi(u, v)
    a, b = i.ravel() * nv + j.ravel(), ((i.ravel() + 1) % nu) * nv + j.ravel()
    c = ((i.ravel() + 1) % nu) * nv + (j.ravel() + 1) % nv
    d = i.ravel() * nv + (j.ravel() + 1) % nv
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    if seed is not None:
        order = np.random.default_rng(seed).permutation(len(points))
        inverse = np.argsort(order)
        points, faces = points[order], inverse[faces]
    return TriMesh(points, faces)


def thin_wall(thickness, n_tets=12_000):
    """A short tube: the section of the solid torus pressed flat along the radius."""
    solid = samples.solid_torus(n_tets)
    x, y, z = solid.V.T
    radius = np.hypot(x, y)
    scale = (1.0 + thickness * (radius - 3.0)) / radius
    return TetMesh(np.stack([x * scale, y * scale, z], axis=1), solid.T)


def _rod(V, loop, axis, rings, step, girth=1.0):
    """Points, those of so many rings after them; rows (rings + 1, m) of loop and rings."""
    out = step * np.arange(1, rings + 1)[:, None, None] * axis / np.linalg.norm(axis)
    ring = girth * V[loop] + (1.0 - girth) * V[loop].mean(axis=0)
    rows = len(V) + np.arange(rings * len(loop)).reshape(rings, -1)
    return np.vstack([V, (ring + out).reshape(-1, 3)]), np.vstack([loop, rows])


def with_limb(surface: TriMesh, rings: int, step: float) -> TriMesh:
    """A narrower tube of so many rings, each a step on, round vertex 0; its tip comes last."""
    round_it = (surface.F == 0).any(axis=1)
    star = [np.roll(face, -int(np.argmin(face))) for face in surface.F[round_it]]
    after, loop = {int(b): int(c) for _, b, c in star}, [int(star[0][1])]
    while after[loop[-1]] != loop[0]:
        loop.append(after[loop[-1]])
    V, low = _rod(surface.V, loop, surface.V[0], rings, step, girth=0.6)
    V[0] = V[loop].mean(axis=0) + (rings + 1) * step * V[0] / np.linalg.norm(V[0])
    on = np.roll(low, -1, axis=1)
    tube = [[low[:-1], on[:-1], on[1:]], [low[:-1], on[1:], low[1:]]]
    new = [*tube, [low[-1], on[-1], np.zeros_like(low[-1])]]
    F = [surface.F[~round_it], *(np.stack(corners, axis=-1).reshape(-1, 3) for corners in new)]
    return TriMesh(np.roll(V, -1, axis=0), (np.vstack(F) - 1) % len(V))


def with_branch(solid: TetMesh, rings: int, step: float, across: bool = False) -> TetMesh:
    """A triangular rod of so many rings, each a step on, on the outermost face.

    Or from the innermost across the hole.
    """
    faces = solid.boundary_vertices[solid.surface.F]
    centers = solid.V[faces].mean(axis=1) * [1.0, 1.0, 0.0]
    far = np.linalg.norm(centers, axis=1)
    face = np.argmin(far) if across else np.argmax(far)
    a, b, c = solid.V[faces[face]]
    axis = -centers[face] if across else np.cross(b - a, c - a)
    V, rows = _rod(solid.V, faces[face], axis, rings, step)
    low, high = rows[:-1].T, rows[1:].T
    rod = np.vstack(
        [
            np.column_stack([low[0], low[1], low[2], high[0]]),
            np.column_stack([low[1], low[2], high[0], high[1]]),
            np.column_stack([low[2], high[0], high[1], high[2]]),
        ]
    )
    return TetMesh(V, np.vstack([solid.T, rod]), orient=True)
