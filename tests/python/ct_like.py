"""Voxel solids as a scanner sees them, and the raw surfaces segmentation makes of them.

A body with one hole (a vertebra, or a tube round a random closed curve), surplus handles of known
number, noise that is correlated over a few voxels, and then what goes wrong on the way: islands,
holes in the surface, faces turned over, corners stored one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage import measure

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Damage:
    """What is done to a clean surface."""

    holes: int = 0
    islands: int = 0
    inside_out: bool = False
    shuffled: bool = False
    exploded: bool = False


def mask(seed: int, shape: str = "tube", genus: int = 1, n: int = 64, noise: float = 0.3) -> Mask:
    """A voxel solid (n, n, n) whose boundary has this genus before noise is added.

    ``noise`` is in voxels: how far the surface is moved, correlated over three voxels.
    """
    rng = np.random.default_rng(seed)
    core = _tube(rng, n) if shape == "tube" else _vertebra(rng, n)
    distance = ndimage.distance_transform_edt(~core) - ndimage.distance_transform_edt(core)
    for _ in range(genus - 1):
        distance = _with_handle(distance, rng)
    rough = ndimage.gaussian_filter(rng.standard_normal(distance.shape), 1.5)
    return distance + noise * rough / rough.std() < 0.0


def surface(voxels: Mask, blur: float = 0.7) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Marching cubes, as a scanner's software does it; faces outward."""
    field = ndimage.gaussian_filter(np.pad(voxels, 3).astype(np.float32), blur)
    V, F, _, _ = measure.marching_cubes(field, 0.5)
    return V.astype(float), F[:, ::-1].astype(np.int64)


def damaged(
    V: NDArray[np.float64], F: NDArray[np.int64], damage: Damage, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The surface after what ``damage`` says was done to it."""
    rng = np.random.default_rng(seed)
    if damage.holes:
        centers = V[rng.integers(0, len(V), damage.holes)]
        radii = rng.uniform(0.8, 2.5, damage.holes)
        middle = V[F].mean(axis=1)
        away = np.linalg.norm(middle[:, None] - centers, axis=2) > radii
        F = F[away.all(axis=1)]
    for _ in range(damage.islands):
        ball = np.indices((7, 7, 7)).reshape(3, -1).T - 3
        small = (np.linalg.norm(ball, axis=1) < rng.uniform(1.0, 2.8)).reshape(7, 7, 7)
        W, G = surface(small)
        away = V.max(axis=0) * rng.uniform(-0.1, 1.1, 3) + rng.uniform(5, 9, 3)
        V, F = np.vstack([V, W + away]), np.vstack([F, G + len(V)])
    if damage.inside_out:
        F = F[:, ::-1]
    if damage.shuffled:
        turn = rng.random(len(F)) < 0.3
        F = np.where(turn[:, None], F[:, ::-1], F)
    if damage.exploded:
        V, F = V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
    return V, np.ascontiguousarray(F)


def _drawn(points: NDArray[np.float64], n: int) -> Mask:
    """Voxels a polygon passes through; points in the unit cube."""
    steps = np.linspace(points, np.roll(points, -1, axis=0), 4, endpoint=False, axis=1)
    ids = np.clip((steps.reshape(-1, 3) * n).astype(int), 0, n - 1)
    out = np.zeros((n, n, n), bool)
    out[tuple(ids.T)] = True
    return out


def _around(line: Mask, radius: float) -> Mask:
    return ndimage.distance_transform_edt(~line) < radius * line.shape[0]


def _tube(rng: np.random.Generator, n: int) -> Mask:
    t = np.linspace(0, 2 * np.pi, 6 * n, endpoint=False)
    wave = rng.uniform(-1, 1, (3, 3, 2)) * np.array([0.0, 0.035, 0.025])[:, None, None]
    curve = 0.3 * np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    for k in range(3):
        curve += np.outer(np.cos(k * t), wave[k, :, 0]) + np.outer(np.sin(k * t), wave[k, :, 1])
    body = _around(_drawn(curve + 0.5, n), rng.uniform(0.08, 0.12))
    for at in rng.integers(0, len(t), 2):  # blobs on the tube
        ball = np.zeros((n, n, n), bool)
        ball[tuple((curve[at] * n + n / 2).astype(int))] = True
        body |= _around(ball, rng.uniform(0.12, 0.16))
    return body


def _vertebra(rng: np.random.Generator, n: int) -> Mask:
    x, y, z = (np.indices((n, n, n)) + 0.5) / n - 0.5
    squeeze = rng.uniform(0.9, 1.1, 3)
    body = (x / 0.27 / squeeze[0]) ** 2 + ((y + 0.17) / 0.2) ** 2 + (z / 0.17 / squeeze[2]) ** 4 < 1
    t = np.linspace(0, np.pi, 3 * n)
    arch = np.stack([0.2 * np.cos(t), -0.1 + 0.3 * np.sin(t), 0.03 * np.cos(3 * t)], axis=1) + 0.5
    spine = np.linspace([0.5, 0.68, 0.5], [0.5, 0.88, 0.42], n)
    wings = [
        np.linspace([0.5 + s * 0.18, 0.55, 0.5], [0.5 + s * 0.38, 0.68, 0.52], n) for s in (-1, 1)
    ]
    there_and_back = [np.vstack([line, line[::-1]]) for line in (arch, spine, *wings)]
    radius = rng.uniform(0.06, 0.075)
    for line in there_and_back:
        body |= _around(_drawn(line, n), radius)
    return body


def _with_handle(distance: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """One more handle: a thin bridge that leaves the body and comes back, or a thin tunnel."""
    n = len(distance)
    gradient = np.stack(np.gradient(ndimage.gaussian_filter(distance, 2.0)))
    shell = np.argwhere(np.abs(distance) < 1.5)
    shell = shell[((shell > 8) & (shell < n - 9)).all(axis=1)]
    start = shell[rng.integers(len(shell))]
    normal = gradient[(slice(None), *start)]
    normal /= np.linalg.norm(normal)
    side = np.cross(normal, rng.standard_normal(3))
    side /= np.linalg.norm(side)
    size, thick = rng.uniform(3.5, 5.0), rng.uniform(1.4, 1.8)
    t = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    ring = start + size * (np.outer(np.cos(t), side) + np.outer(np.sin(t), normal))
    line = ndimage.distance_transform_edt(~_drawn(ring / n, n)) - thick
    return np.minimum(distance, line) if rng.random() < 0.5 else np.maximum(distance, -line)
