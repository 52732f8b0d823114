"""Knotted tubes and components of links."""

from __future__ import annotations

import numpy as np
from curves import clearance, fourier_loop, perimeter, torus_knot
from surfaces import Rejected, even_surface, polygonize, tube

from stretchmap import TriMesh

from . import Family

_KNOTS = [(2, 3), (3, 2), (2, 5), (3, 4), (2, 7), (5, 2), (3, 5), (4, 3)]
# Components of torus links: closed curves that are no knot, wound round one another's axis.
_COMPONENTS = [(1, 1), (1, 2), (1, 3), (2, 1), (3, 1), (1, 5)]


def knots(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """A tube as thick as the curve leaves room for, or thinner, its radius varying."""
    kind = rng.choice(["torus knot", "component", "random"])
    if kind == "random":
        curve = fourier_loop(rng, int(rng.integers(3, 7)), rng.uniform(0.5, 1.1), 300)
    else:
        p, q = (_KNOTS if kind == "torus knot" else _COMPONENTS)[rng.integers(6)]
        curve = torus_knot(p, q, 1.0, rng.uniform(0.3, 0.6), 400)
        curve = curve * np.array([1.0, 1.0, rng.uniform(0.7, 1.6)])
    radius = clearance(curve) * rng.uniform(0.5, 0.85)
    if perimeter(curve) / radius > 250.0:
        raise Rejected(f"{kind}: too long and thin")
    t = np.linspace(0.0, 2.0 * np.pi, len(curve), endpoint=False)
    radii = radius * (1.0 + rng.uniform(0.0, 0.15) * np.cos(int(rng.integers(1, 9)) * t))
    surface = polygonize(tube(curve, radii), radius / 4.0)
    # Fewer than a dozen vertices round a tube are another matter (see the coarse family).
    return even_surface(surface, max(n_tets, 6.0 * perimeter(curve) / radius * 12.0))


FAMILIES = (Family("knots", "knots and components of links, even triangles", True, knots),)
