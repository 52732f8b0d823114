"""Things with one hole: gears, frames, keys, beads, blocks, stars, funnels, rackets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from manifold3d import CrossSection, Manifold, OpType
from numpy.typing import NDArray
from surfaces import Rejected

from stretchmap import TetMesh

from . import Family
from .pillars import prepared


def ring_of(centers: NDArray[np.float64], radii: Sequence[float]) -> Manifold:
    """The hulls of every two balls that follow each other round a closed polygon."""
    balls = [
        Manifold.sphere(float(radius), 12).translate(tuple(center))
        for center, radius in zip(centers, radii, strict=True)
    ]
    hulls = [Manifold.batch_hull(list(pair)) for pair in pairwise([*balls, balls[0]])]
    return Manifold.batch_boolean(hulls, OpType.Add)


def polygon(radii: NDArray[np.float64], angles: NDArray[np.float64]) -> CrossSection:
    """About the origin, counterclockwise."""
    corners = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    return CrossSection([[tuple(corner) for corner in corners]])


def gear(rng: np.random.Generator) -> Manifold:
    """Six to 24 teeth, often slanted."""
    teeth, depth = int(rng.integers(6, 24)), rng.uniform(0.08, 0.35)
    outline = np.tile([1.0 - depth, 1.0 - depth, 1.0, 1.0], teeth)
    places = (np.arange(teeth)[:, None] + [0.0, 0.3, 0.45, 0.85]).ravel()
    section = polygon(outline, 2.0 * math.pi * places / teeth)
    section -= CrossSection.circle(rng.uniform(0.15, 0.55), 40)
    return section.extrude(rng.uniform(0.15, 0.8), 12, rng.uniform(0.0, 40.0))


def star(rng: np.random.Generator) -> Manifold:
    """A prism over a star, twisted and narrowing."""
    points, inner = int(rng.integers(4, 12)), rng.uniform(0.3, 0.6)
    radii = np.tile([inner, 1.0], points)
    section = polygon(radii, math.pi * np.arange(2 * points) / points)
    section -= CrossSection.circle(inner * rng.uniform(0.3, 0.7), 30)
    top = (rng.uniform(0.4, 1.0),) * 2
    return section.extrude(rng.uniform(0.2, 2.0), 16, rng.uniform(0.0, 90.0), top)


def frame(rng: np.random.Generator) -> Manifold:
    """Rectangular, with blocks set on and notches cut in."""
    wide, high, thick = rng.uniform(1.0, 3.0), rng.uniform(1.0, 2.0), rng.uniform(0.1, 0.4)
    bar = rng.uniform(0.1, 0.3)
    solid = Manifold.cube((wide + 2.0 * bar, high + 2.0 * bar, thick), True)
    solid -= Manifold.cube((wide, high, 2.0 * thick), True)
    for _ in range(int(rng.integers(2, 7))):
        block = Manifold.cube(tuple(rng.uniform(0.3, 1.5, 3) * bar), True)
        side, level = rng.choice([-1.0, 1.0], 2)
        at = (rng.uniform(-0.5, 0.5) * wide, 0.5 * side * (high + bar), 0.5 * level * thick)
        notch = rng.random() < 0.4
        solid = solid - block.translate(at) if notch else solid + block.translate(at)
    return solid


def key(rng: np.random.Generator) -> Manifold:
    """Flat, with notches in its blade."""
    bow = CrossSection.circle(0.5, 32) - CrossSection.circle(rng.uniform(0.1, 0.35), 24)
    length = rng.uniform(1.2, 3.0)
    outline = bow + CrossSection.square((length, 0.25)).translate((0.42, -0.12))
    for place in range(int(rng.integers(2, 7))):
        notch = CrossSection.square((rng.uniform(0.05, 0.12), rng.uniform(0.05, 0.15)))
        outline -= notch.translate((0.8 + place * (length - 0.5) / 7.0, -0.13))
    return outline.extrude(rng.uniform(0.06, 0.15))


def beads(rng: np.random.Generator) -> Manifold:
    """Balls of very different size on a closed thread."""
    count = int(rng.integers(8, 22))
    t = 2.0 * math.pi * np.arange(count) / count
    lift = rng.uniform(0.0, 0.5) * np.sin(rng.integers(1, 4) * t)
    centers = rng.uniform(1.0, 1.6) * np.column_stack(
        [np.cos(t), rng.uniform(0.6, 1.0) * np.sin(t), lift]
    )
    solid = ring_of(centers, [rng.uniform(0.05, 0.15)] * count)
    for center in centers:
        radius = min(rng.uniform(0.12, 0.45), 0.5 * float(np.linalg.norm(center)))
        solid += Manifold.sphere(radius, 24).translate(tuple(center))
    return solid


def block(rng: np.random.Generator) -> Manifold:
    """A slanted hole goes through it, and round pockets into it."""
    solid = Manifold.cube(tuple(rng.uniform(1.0, 2.0, 3)), True)
    hole = Manifold.cylinder(5.0, rng.uniform(0.1, 0.3), -1.0, 24, True)
    solid -= hole.rotate((*rng.uniform(-15.0, 15.0, 2), 0.0))
    for direction in rng.standard_normal((int(rng.integers(3, 9)), 3)):
        at = direction / np.linalg.norm(direction) * [0.8, 0.8, 0.6]
        solid -= Manifold.sphere(rng.uniform(0.08, 0.25), 16).translate(tuple(at))
    return solid


def funnel(rng: np.random.Generator) -> Manifold:
    """A pipe that opens into a wide rim."""
    level = np.linspace(0.0, 1.0, 18)
    radius = 0.15 + rng.uniform(0.3, 1.6) * level ** rng.uniform(1.0, 8.0)
    inside = np.column_stack([radius, rng.uniform(1.0, 3.0) * level])
    outside = np.add(inside, (rng.uniform(0.05, 0.12), 0.0))
    corners = np.concatenate([outside, inside[::-1]])
    return Manifold.revolve(CrossSection([[tuple(corner) for corner in corners]]), 48)


def racket(rng: np.random.Generator) -> Manifold:
    """A thin ring with a long grip, often with a plate at its end."""
    t = 2.0 * math.pi * np.arange(60) / 60
    centers = np.column_stack([0.6 * np.cos(t), 0.8 * np.sin(t), 0.0 * t])
    solid, length = ring_of(centers, [rng.uniform(0.04, 0.1)] * len(t)), rng.uniform(1.0, 3.0)
    grip = Manifold.cylinder(length, 0.09, rng.uniform(0.05, 0.3), 20).rotate((90.0, 0.0, 0.0))
    solid += grip.translate((0.0, -0.75, 0.0))
    if rng.random() < 0.5:
        plate = Manifold.cube((rng.uniform(0.5, 1.5), 0.15, rng.uniform(0.5, 1.5)), True)
        solid += plate.translate((0.0, -0.8 - length, 0.0))
    return solid


_KINDS = (gear, star, frame, key, beads, block, funnel, racket)


def part(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """One of these; refused where `prepare` lost what is thinner than its triangles."""
    drawn: Manifold = _KINDS[int(rng.integers(len(_KINDS)))](rng)
    solid = prepared(drawn, rng, 0.4 * n_tets)  # thick ones have three times as many
    if abs(solid.volume / drawn.volume() - 1.0) > 0.05:
        raise Rejected("thinner than its triangles")
    return solid


FAMILIES = (
    Family("parts", "gears, frames, keys, beads, blocks, stars, funnels, rackets", True, part),
)
