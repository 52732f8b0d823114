"""Flat rings, twisted by half turns: those of a Moebius strip, but with a thickness."""

from __future__ import annotations

import math

import numpy as np
from surfaces import genus_one

from stretchmap import TriMesh

from . import Family


def ribbon(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """One to eight half turns, 4 to 60 times as wide as thick, no vertex inside the edges."""
    turns = int(rng.integers(1, 9))
    wide, thick = rng.uniform(0.3, 0.6), rng.uniform(0.01, 0.08)
    across = int(rng.integers(4, 9))
    along = max(int(n_tets / (12.0 * across)), 40)
    x = np.linspace(-wide, wide, across + 1)
    side = np.column_stack([x, np.full(across + 1, thick)])
    section = np.vstack([side, -side])  # half a turn takes it onto itself
    n = len(section)
    u = np.linspace(0.0, 2.0 * math.pi, along, endpoint=False)[:, None]
    cos, sin = np.cos(0.5 * turns * u), np.sin(0.5 * turns * u)
    away = 1.0 + section[:, 0] * cos - section[:, 1] * sin
    height = section[:, 0] * sin + section[:, 1] * cos
    V = np.stack([away * np.cos(u), away * np.sin(u), height], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(along), np.arange(n), indexing="ij")
    here, beside = i * n + j, i * n + (j + 1) % n
    shift = np.where(i == along - 1, (turns % 2) * (across + 1), 0)
    ahead = (i + 1) % along * n + (j + shift) % n
    beyond = (i + 1) % along * n + (j + 1 + shift) % n
    corners = np.stack([here, ahead, beyond, here, beyond, beside], axis=-1)
    return genus_one(V, corners.reshape(-1, 3))


FAMILIES = (Family("ribbons", "twisted ribbons of flat section, long triangles", False, ribbon),)
