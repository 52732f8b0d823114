"""Thin-walled pipes, straight, bent or tapered, as a CAD mesher leaves them."""

from __future__ import annotations

import math

import numpy as np
from curves import random_rotation
from numpy.typing import NDArray
from surfaces import genus_one

from stretchmap import TriMesh

from . import Family

_TETS_PER_FACE = 1.6  # one layer of tets


def pipe(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """Walls of 3 to 30 % of the radius, lengths of 1.5 to 12 radii, bent by up to four radians.

    The triangles of both sides are as large as each other, mostly larger than the wall is thick,
    and do not face each other.
    """
    wall, length = (
        float(np.exp(rng.uniform(math.log(low), math.log(high))))
        for low, high in ((0.03, 0.3), (1.5, 12.0))
    )
    bend = min(rng.uniform(0.0, 4.0), length / 1.6) * (rng.random() < 0.7)
    taper, oval = rng.uniform(-0.4, 0.4), rng.uniform(0.7, 1.0)
    edge = math.sqrt(4.0 * math.pi * length / (0.433 * n_tets / _TETS_PER_FACE))
    n = max(round(2.0 * math.pi / edge), 12)
    m = max(round(length / (0.866 * edge)), 4)

    def side(radius: float, shift: float) -> NDArray[np.float64]:
        """(m + 1, n, 3) rows of vertices, every second one shifted by half a step."""
        row, column = np.indices((m + 1, n)).astype(float)
        inside = ((row > 0) & (row < m))[..., None]
        jitter = np.where(inside, rng.uniform(-0.2, 0.2, size=(m + 1, n, 2)), 0.0)
        along = length * (row + jitter[..., 0]) / m
        turn = 2.0 * math.pi * (column + 0.5 * (row % 2) + shift + jitter[..., 1]) / n
        size = radius * (1.0 + taper * (along / length - 0.5))
        x, y = size * np.cos(turn), oval * size * np.sin(turn)
        if bend == 0.0:
            return np.stack([x, y, along], axis=-1)
        center, angle = length / bend, bend * along / length
        return np.stack(
            [(center + x) * np.cos(angle) - center, y, (center + x) * np.sin(angle)], axis=-1
        )

    V = np.concatenate([side(1.0, 0.0), side(1.0 - wall, rng.uniform())]).reshape(-1, 3)
    i, j = np.indices((m, n))
    shifted = i % 2
    here, beside = i * n + j, i * n + (j + 1) % n
    ahead, beyond = (i + 1) * n + (j + shifted) % n, (i + 1) * n + (j + shifted + 1) % n
    outer = np.stack([here, beside, ahead, beside, beyond, ahead], axis=-1).reshape(-1, 3)
    inner = outer[:, ::-1] + (m + 1) * n
    k = np.arange(n)
    rims = []
    for row in (0, m):
        out, within = row * n, (m + 1 + row) * n
        a, b = out + k, out + (k + 1) % n
        c, d = within + k, within + (k + 1) % n
        rim = np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)])
        rims.append(rim if row == 0 else rim[:, ::-1])
    F = np.concatenate([outer, inner, *rims])
    return genus_one(V @ random_rotation(rng).T, F)


FAMILIES = (
    Family("pipes", "thin-walled pipes, hardly a vertex inside the wall; even", True, pipe),
)
