"""Random closed curves."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]


def fourier_loop(rng: np.random.Generator, modes: int, roughness: float, n: int = 400) -> Array:
    """A circle of radius 1 plus random waves, ``n`` points evenly spaced along it, shape (n, 3).

    The waves 2 .. ``modes`` + 1 have amplitudes ``roughness / k``.
    """
    t = np.linspace(0.0, 2.0 * math.pi, 8 * n, endpoint=False)
    points = np.stack([np.cos(t), np.sin(t), np.zeros_like(t)], axis=1)
    for k in range(2, modes + 2):
        wave = rng.normal(size=(2, 3)) * roughness / k
        points += np.outer(np.cos(k * t), wave[0]) + np.outer(np.sin(k * t), wave[1])
    return evenly(points, n)


def torus_knot(p: int, q: int, R: float, r: float, n: int = 600) -> Array:
    """The curve that winds ``p`` times round the axis and ``q`` times round the tube."""
    t = np.linspace(0.0, 2.0 * math.pi, 8 * n, endpoint=False)
    away = R + r * np.cos(q * t)
    points = np.stack([away * np.cos(p * t), away * np.sin(p * t), r * np.sin(q * t)], axis=1)
    return evenly(points, n)


def evenly(points: Array, n: int) -> Array:
    """``n`` points evenly spaced along a closed polygon."""
    closed = np.vstack([points, points[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], n, endpoint=False)
    return np.stack([np.interp(at, length, closed[:, k]) for k in range(3)], axis=1)


def perimeter(points: Array) -> float:
    """Length of a closed polygon."""
    return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())


def clearance(points: Array) -> float:
    """Radius a tube round an evenly spaced closed curve can have before it meets itself."""
    n = len(points)
    spacing = perimeter(points) / n
    ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    bend = np.linalg.norm(ahead + behind - 2.0 * points, axis=1).max() / spacing**2
    radius = 1.0 / max(bend, 1e-12)
    # Neighbors along the curve closer than a half circle of that radius do not count.
    apart = max(int(math.pi * radius / spacing), 2)
    pairs = cKDTree(points).query_pairs(2.0 * radius, output_type="ndarray")
    gap = np.abs(pairs[:, 0] - pairs[:, 1])
    pairs = pairs[np.minimum(gap, n - gap) >= min(apart, n // 4)]
    if len(pairs):
        distance = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1).min()
        radius = min(radius, 0.5 * float(distance))
    return radius


def random_rotation(rng: np.random.Generator) -> Array:
    """A rotation matrix, uniformly distributed."""
    q, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(upper))
    return q if np.linalg.det(q) > 0.0 else -q
