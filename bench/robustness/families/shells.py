"""Thin walls: cups with a handle by exact CSG, and solids of cubes cut along their diagonals."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from curves import random_rotation
from manifold3d import Manifold
from numpy.typing import NDArray
from surfaces import TETS_PER_FACE, Rejected

from stretchmap import TetMesh, TriMesh, prepare
from stretchmap.samples.solids import cut_cells

from . import Family
from .drilled import surface_of

Cells = NDArray[np.bool_]


def cup(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """A cup or jar, often conical, with a bent handle; its wall is 6 to 20 % of its radius."""
    height, top = rng.uniform(1.0, 3.0), rng.uniform(0.8, 1.2)
    bottom, wall = top * rng.uniform(0.6, 1.0), rng.uniform(0.06, 0.2)
    solid = Manifold.cylinder(height, bottom, top, 64, True)
    room = Manifold.cylinder(height, bottom - wall, top - wall, 64, True).translate((0, 0, wall))
    middle, reach = 0.5 * (top + bottom), 0.3 * height
    t = np.linspace(-1.5, 1.5, 16)
    centers = np.column_stack([middle + 0.5 * np.cos(t), 0.0 * t, reach * np.sin(t)])
    balls = [Manifold.sphere(rng.uniform(0.8, 1.4) * wall, 24).translate(c) for c in centers]
    handle = Manifold()
    for pair in pairwise(balls):
        handle += Manifold.batch_hull(list(pair))
    half = 0.5 * wall
    inside = Manifold.cylinder(height, bottom - half, top - half, 64, True)
    surface = surface_of(solid - room + (handle - inside))
    turned = TriMesh(surface.V @ random_rotation(rng).T, surface.F)
    # Both sides of a thin wall cross when they are remeshed by themselves.
    return prepare(turned, faces=int(n_tets / TETS_PER_FACE)).solid


def mug(rng: np.random.Generator, n: int) -> Cells:
    """A square one; its handle reaches three cells out."""
    wall, height = int(rng.integers(1, 3)), int(rng.uniform(0.6, 1.5) * n) + 3
    filled = np.ones((n + 4, n, height), bool)
    filled[n:] = False
    filled[wall : n - wall, wall : n - wall, wall:] = False
    filled[n : n + 3, n // 2, [1, height - 2]] = True
    filled[n + 2, n // 2, 1 : height - 1] = True
    return filled


def bowl(rng: np.random.Generator, n: int) -> Cells:
    """One cell thick, with a hole somewhere in its bottom."""
    filled = np.ones((n, n, int(rng.uniform(0.6, 1.2) * n) + 2), bool)
    filled[1:-1, 1:-1, 1:] = False
    filled[tuple(rng.integers(2, n - 2, size=2))][0] = False
    return filled


def basket(rng: np.random.Generator, n: int) -> Cells:
    """A bowl with a handle over it."""
    height = int(rng.uniform(0.4, 0.8) * n) + 2
    filled = np.zeros((n, n, height + 6), bool)
    filled[:, :, :height] = True
    filled[1:-1, 1:-1, 1:height] = False
    filled[[0, -1], n // 2, height : height + 5] = True
    filled[:, n // 2, height + 4] = True
    return filled


def pipe(rng: np.random.Generator, n: int) -> Cells:
    """A square one, one cell thick."""
    filled = np.ones((n, n, int(rng.uniform(0.5, 3.0) * n) + 1), bool)
    filled[1:-1, 1:-1] = False
    return filled


def cut_grid(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """One of these in cubes of six tets each, about as many as asked for or as a thin wall has."""
    shape: Callable[[np.random.Generator, int], Cells] = (mug, bowl, basket, pipe)[rng.integers(4)]
    n = max(int(math.sqrt(n_tets / 30.0) / 1.5), 6)
    filled = shape(rng, n)
    if filled.sum() > n_tets:
        raise Rejected("too many cells")
    return TetMesh(*cut_cells(filled), orient=True)


FAMILIES = (
    Family("thin_shells", "cups with a handle; even triangles", True, cup),
    Family("cut_grids", "mugs, bowls, baskets, pipes of cubes cut along diagonals", True, cut_grid),
)
