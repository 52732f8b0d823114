"""Thin and fat rings: R / r from 1.01 to 100."""

from __future__ import annotations

import math

import numpy as np
from curves import random_rotation

from stretchmap import TriMesh

from . import Family

_TETS_PER_FACE = 2.5


def ring(rng: np.random.Generator, ratio: float, n_faces: float, bumps: float) -> TriMesh:
    """A torus of revolution in conformal coordinates, so that triangles are even in shape.

    Along the meridian the conformal coordinate is the integral of ``r dv / (R + r cos v)``; its
    period is ``2 pi / sqrt(ratio**2 - 1)``. ``bumps`` waves the radius of the tube.
    """
    period = 2.0 * math.pi / math.sqrt(ratio**2 - 1.0)
    nv = max(round(math.sqrt(0.5 * n_faces * period / (2.0 * math.pi) * 1.15)), 8)
    nu = max(round(0.5 * n_faces / nv), 8)
    i, j = (index.ravel() for index in np.indices((nu, nv)))
    # Shifting every second row by half a step would need an even count; jitter does as well.
    jitter = 0.15 * rng.uniform(-1.0, 1.0, size=(2, nu * nv))
    u = 2.0 * math.pi * (i + jitter[0]) / nu
    half = math.pi * ((j + jitter[1]) / nv)  # of the meridian, in units of the conformal period
    v = 2.0 * np.arctan2(math.sqrt((ratio + 1.0) / (ratio - 1.0)) * np.sin(half), np.cos(half))
    waves = rng.integers(1, 6, size=2)
    r = 1.0 + bumps * np.cos(waves[0] * u) * np.cos(waves[1] * v)
    away = ratio + r * np.cos(v)
    V = np.stack([away * np.cos(u), away * np.sin(u), r * np.sin(v)], axis=1)
    k, m = (i + 1) % nu, (j + 1) % nv
    a, b, c, d = i * nv + j, k * nv + j, k * nv + m, i * nv + m
    F = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return TriMesh(V @ random_rotation(rng).T, F, orient=True)


def thin(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """R / r from 8 to 100."""
    ratio = float(np.exp(rng.uniform(math.log(8.0), math.log(100.0))))
    # At least nine vertices round the tube.
    least = 2.0 * 9.0 * 9.0 * math.sqrt(ratio**2 - 1.0)
    return ring(rng, ratio, max(n_tets / _TETS_PER_FACE, least), rng.uniform(0.0, 0.25))


def fat(rng: np.random.Generator, n_tets: float) -> TriMesh:
    """R / r from 1.01 to 1.5; triangles get small towards the hole."""
    ratio = 1.0 + float(np.exp(rng.uniform(math.log(0.01), math.log(0.5))))
    return ring(rng, ratio, n_tets / _TETS_PER_FACE, rng.uniform(0.0, 0.5) * (ratio - 1.0))


FAMILIES = (
    Family("thin_rings", "rings of R/r from 8 to 100, wavy", True, thin),
    Family("fat_rings", "rings of R/r from 1.01 to 1.5, triangles graded to the hole", True, fat),
)
