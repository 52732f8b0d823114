"""Plates, boxes and cylinders with a straight or slanted hole, cut by exact CSG (manifold3d)."""

from __future__ import annotations

import math

import numpy as np
from curves import random_rotation
from manifold3d import CrossSection, Manifold, Mesh64
from surfaces import even_surface, genus_one

from stretchmap import TriMesh

from . import Family


def body(rng: np.random.Generator) -> tuple[Manifold, float, float]:
    """A plate, box, cylinder or prism about the z-axis; its least half width and its height."""
    kind = rng.choice(["plate", "box", "cylinder", "prism", "ball"])
    if kind == "plate":
        sides = (rng.uniform(1.0, 3.0), rng.uniform(1.0, 3.0), rng.uniform(0.05, 0.2))
    else:
        sides = tuple(rng.uniform(0.8, 2.0, size=3))
    if kind in ("plate", "box"):
        return Manifold.cube(sides, True), 0.5 * min(sides[:2]), sides[2]
    if kind == "ball":
        return Manifold.sphere(0.7, int(rng.integers(12, 48))), 0.6, 1.4
    corners = int(rng.integers(24, 64) if kind == "cylinder" else rng.integers(3, 8))
    top = rng.uniform(0.5, 1.0)
    solid = Manifold.cylinder(sides[2], 0.8, 0.8 * top, corners, True)
    return solid, 0.8 * top * math.cos(math.pi / corners), sides[2]


def drilled(rng: np.random.Generator) -> Manifold:
    """A body less a round or polygonal hole, through its middle or near its edge, often slanted."""
    solid, half, height = body(rng)
    radius = half * rng.uniform(0.1, 0.6)
    corners = int(rng.choice([3, 4, 6, 16, 32, 48]))
    hole = Manifold.cylinder(10.0 * (height + half), radius, radius, corners, True)
    room = half - radius
    reach = room * rng.uniform(0.0, 0.8)
    if rng.random() < 0.6:
        # So steep that the hole still leaves by the other side.
        steepest = math.degrees(math.atan2(room - reach, 0.5 * height))
        hole = hole.rotate((rng.uniform(0.2, 0.9) * steepest, 0.0, 0.0))
    turn = rng.uniform(0.0, 360.0)
    cut = solid - hole.translate((reach, 0.0, 0.0)).rotate((0.0, 0.0, turn))
    if rng.random() < 0.3:
        groove = CrossSection.circle(0.25 * half, 16).extrude(10.0).translate((0.0, 0.0, -5.0))
        cut = cut - groove.translate((1.05 * (half + reach), 0.3 * half, 0.0))
    return cut


def cad(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """The triangulation CSG leaves: long triangles, edges cut only where they are too long."""
    cut = drilled(rng)
    coarse = math.sqrt(cut.surface_area() / n_tets)
    surface = surface_of(cut.refine_to_length(coarse * rng.uniform(3.0, 12.0)))
    return TriMesh(surface.V @ random_rotation(rng).T, surface.F)


def even(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """Remeshed to even triangles; sharp edges get rounded off."""
    surface = even_surface(surface_of(drilled(rng)), n_tets)
    return TriMesh(surface.V @ random_rotation(rng).T, surface.F)


def surface_of(solid: Manifold) -> TriMesh:
    """Its surface, refused by `genus_one` if the hole did not go through or cut an edge."""
    mesh: Mesh64 = solid.to_mesh64()
    return genus_one(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts))


FAMILIES = (
    Family("drilled_even", "plates, boxes, cylinders, drilled; even triangles", True, even),
    Family("drilled_cad", "the same with the long triangles of CSG", False, cad),
)
