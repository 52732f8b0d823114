"""Big bodies whose only handle is small: a long bone with a foramen, a cup with a tiny ear."""

from __future__ import annotations

import math

import numpy as np
from curves import random_rotation
from surfaces import RoundCone, even_surface, polygonize, tube

from stretchmap import TriMesh

from . import Family


def blob_body(rng: np.random.Generator) -> list[RoundCone]:
    """A long bone, or a few balls grown together; about 1 in size, the surface at x = z = 0."""
    if rng.random() < 0.5:
        thick = rng.uniform(0.08, 0.16)
        ends = np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
        knobs = thick * rng.uniform(1.2, 1.8, size=2)
        return [RoundCone(ends[0], ends[1], thick, thick)] + [
            RoundCone(end, end + knob * rng.normal(size=3) * 0.3, float(knob), float(knob) * 0.8)
            for end, knob in zip(ends, knobs, strict=True)
        ]
    center = RoundCone(np.zeros(3), rng.normal(size=3) * 0.1, 0.3, 0.3)
    way = rng.normal(size=(4, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    return [center] + [
        RoundCone(0.25 * w, 0.25 * w + 0.1 * w, rng.uniform(0.1, 0.25), rng.uniform(0.1, 0.25))
        for w in way
    ]


def surface_point(parts: list[RoundCone], way: np.ndarray) -> np.ndarray:
    """The point of the surface farthest along a ray from the origin."""
    t = np.linspace(0.0, 1.5, 3000)
    inside = np.min([p.distance(t[:, None] * way) for p in parts], axis=0) < 0.0
    return way * t[np.flatnonzero(inside).max(initial=0)]


def small_handle(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """The body with a small ring let into its surface, its hole 5 to 10 % of the size."""
    parts = blob_body(rng)
    way = rng.normal(size=3)
    if abs(way[0]) > 0.5 * np.linalg.norm(way):
        way[0] *= 0.2  # of a bone, a point of the shaft rather than of the knobs
    way /= np.linalg.norm(way)
    at = surface_point(parts, way)
    hole = rng.uniform(0.05, 0.10) / 2.0
    thick = hole * rng.uniform(0.5, 1.0)
    t = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)
    across = np.linalg.qr(np.column_stack([way, rng.normal(size=(3, 2))]))[0][:, 1]
    circle = (hole + thick) * (np.outer(np.cos(t), way) + np.outer(np.sin(t), across))
    # The lower part of the ring lies inside the body: hole and surface meet near the ring's center.
    parts += tube(at + circle + rng.uniform(0.2, 0.6) * hole * way, np.full(len(t), thick))
    surface = polygonize(parts, 0.22 * thick, 0.3 * thick)
    surface = even_surface(surface, max(n_tets, 25_000.0), 3.0)
    return TriMesh(surface.V @ random_rotation(rng).T, surface.F)


FAMILIES = (
    Family("small_handles", "big bodies, the hole 5 to 10 % of their size", True, small_handle),
)
