"""Wide parts that little holds together: plates on pillars, bottles with a handle."""

from __future__ import annotations

import numpy as np
from curves import random_rotation
from manifold3d import CrossSection, Manifold
from surfaces import TETS_PER_FACE

from stretchmap import TetMesh, TriMesh, prepare

from . import Family
from .drilled import surface_of


def stack(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """Two to five square plates above each other, a pillar in each gap and two in the last."""
    plates, thick = int(rng.integers(2, 6)), rng.uniform(0.1, 0.25)
    gap, radius = rng.uniform(0.3, 0.8), rng.uniform(0.06, 0.15)
    solid = Manifold()
    for level in range(plates):
        plate = Manifold.cube((2.0, 2.0, thick), True)
        solid += plate.translate((0.0, 0.0, level * (gap + thick)))
    pillar = Manifold.cylinder(gap + thick, radius, radius, 32, True)
    feet = rng.uniform(-0.8, 0.8, size=(plates - 1, 2))
    across = -np.where(feet[-1] < 0.0, -0.8, 0.8)
    for (x, y), level in zip([*feet, across], [*range(plates - 1), plates - 2], strict=True):
        solid += pillar.translate((x, y, (level + 0.5) * (gap + thick)))
    return prepared(solid, rng, n_tets)


def bottle(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """A hollow ball with a small opening and a handle; its wall is 12 to 30 % of its radius."""
    wall = rng.uniform(0.12, 0.3)
    ball = Manifold.sphere(1.0, 40)
    ball -= Manifold.sphere(1.0 - wall, 40)
    mouth = rng.uniform(0.1, 0.3)
    ball -= Manifold.cylinder(2.0, mouth, mouth, 24, True).translate((0.0, 0.0, 1.0))
    profile = CrossSection.circle(rng.uniform(0.08, 0.12), 16).translate((0.35, 0.0))
    handle = Manifold.revolve(profile, 28).rotate((90.0, 0.0, 0.0)).translate((1.05, 0.0, 0.0))
    return prepared(ball + (handle - Manifold.sphere(1.0 - 0.5 * wall, 40)), rng, n_tets)


def prepared(solid: Manifold, rng: np.random.Generator, n_tets: float) -> TetMesh:
    """Turned, and filled by way of `prepare`, as both sides of thin parts cross when remeshed."""
    surface = surface_of(solid)
    turned = TriMesh(surface.V @ random_rotation(rng).T, surface.F)
    return prepare(turned, faces=int(n_tets / TETS_PER_FACE)).solid


FAMILIES = (
    Family("stacks", "plates joined by pillars; even triangles", True, stack),
    Family("bottles", "hollow balls with an opening and a handle; even triangles", True, bottle),
)
