"""Rings with many spikes: blunt cones that are remeshed, and thorns of single vertices."""

from __future__ import annotations

import numpy as np
from curves import fourier_loop, perimeter
from surfaces import RoundCone, even_edge, genus_one, polygonize, remesh, tube

from stretchmap import TriMesh

from . import Family


def spiky(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """A ring with 10 to 40 pointed cones in random directions, blunt as the triangles are wide."""
    loop = fourier_loop(rng, 2, rng.uniform(0.0, 0.2), 120)
    radius = rng.uniform(0.2, 0.4)
    n_spikes = int(rng.integers(10, 40))
    n_tets = max(n_tets, 15_000.0)
    # Spikes add about half as much again to the area of the ring.
    edge = even_edge(1.5 * perimeter(loop) * 2.0 * np.pi * radius, n_tets)
    parts = tube(loop, np.full(len(loop), radius))
    for _ in range(n_spikes):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        start = loop[rng.integers(len(loop))]
        tip = 0.75 * edge
        base = max(radius * rng.uniform(0.2, 0.4), 1.5 * tip)
        # From the surface of the tube on, not from its middle.
        parts.append(
            RoundCone(
                start + 0.8 * radius * way, start + radius * rng.uniform(1.4, 2.6) * way, base, tip
            )
        )
    return remesh(polygonize(parts, 0.5 * edge), edge)


def thorny(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """A ring of even triangles, single vertices of which are pulled out by 1 to 5 edges."""
    loop = fourier_loop(rng, 2, rng.uniform(0.0, 0.2), 120)
    radius = rng.uniform(0.25, 0.4)
    smooth = polygonize(tube(loop, np.full(len(loop), radius)), radius / 8.0)
    edge = even_edge(smooth.area, n_tets)
    surface = remesh(smooth, edge)
    corners = surface.V[surface.F]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.zeros((surface.n_vertices, 3))
    np.add.at(normal, surface.F.ravel(), np.repeat(across, 3, axis=0))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    chosen = rng.random(surface.n_vertices) < rng.uniform(0.005, 0.05)
    pull = np.where(chosen, rng.uniform(1.0, 5.0, surface.n_vertices), 0.0) * edge
    return genus_one(surface.V + pull[:, None] * normal, surface.F)


FAMILIES = (
    Family("spiky", "rings with many blunt spikes, even triangles", True, spiky),
    Family("thorny", "rings with vertices pulled out to thorns", False, thorny),
)
