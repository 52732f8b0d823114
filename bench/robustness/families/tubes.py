"""Tubes round closed curves with branches and blobs: the look of segmented anatomy."""

from __future__ import annotations

import numpy as np
from curves import fourier_loop
from surfaces import RoundCone, even_surface, polygonize, tube

from stretchmap import TriMesh

from . import Family


def shape(rng: np.random.Generator) -> tuple[list[RoundCone], float]:
    """A loop whose radius varies, branches that end in blobs; and its mean radius."""
    loop = fourier_loop(rng, int(rng.integers(1, 5)), rng.uniform(0.0, 0.35), 150)
    mean = rng.uniform(0.12, 0.26)
    t = np.linspace(0.0, 2.0 * np.pi, len(loop), endpoint=False)
    waves = rng.normal(size=3) * 0.2
    radii = mean * np.exp(sum(w * np.cos((k + 1) * t + k) for k, w in enumerate(waves)))
    parts = tube(loop, radii)
    for _ in range(rng.integers(1, 11)):
        at = int(rng.integers(len(loop)))
        point, way = loop[at], rng.normal(size=3)
        thickness = float(radii[at]) * rng.uniform(0.3, 0.9)
        for _ in range(rng.integers(1, 4)):
            way = way / np.linalg.norm(way) + 0.4 * rng.normal(size=3)
            end = point + way * rng.uniform(0.15, 0.55)
            thinner = thickness * rng.uniform(0.6, 1.0)
            parts.append(RoundCone(point, end, thickness, thinner))
            point, thickness = end, thinner
        if rng.random() < 0.4:
            blob = thickness * rng.uniform(1.3, 2.2)
            parts.append(RoundCone(point, point, blob, blob))
    return parts, mean


def even_tubes(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """Marching cubes remeshed to even triangles, half of them with a few slivers left."""
    parts, mean = shape(rng)
    sampling = rng.choice([1.5, 8.0])
    return even_surface(polygonize(parts, mean / 8.0, 0.3 * mean), n_tets, sampling)


def raw_tubes(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """The triangles of marching cubes as they are, slivers among them."""
    parts, mean = shape(rng)
    # A first, coarse grid tells how fine it has to be; there are about four tets per face.
    coarse = polygonize(parts, mean / 4.0, 0.3 * mean)
    cell = mean / 4.0 * (4.0 * coarse.n_faces / n_tets) ** 0.5
    return polygonize(parts, cell, 0.3 * mean)


FAMILIES = (
    Family("even_tubes", "tubes with branches and blobs, even triangles", True, even_tubes),
    Family("raw_tubes", "the same straight from marching cubes, slivers", False, raw_tubes),
)
