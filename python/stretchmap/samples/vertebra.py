"""Solids shaped like vertebrae, and pairs of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.options import pair, whole
from ..base.torus import TWO_PI
from ..mesh.meshes import TetMesh
from .sweep import (
    Array,
    Embedding,
    disk_size,
    parameters,
    resolution,
    sweep,
    swept,
)

__all__ = ["VertebraPair", "vertebra_like", "vertebra_pair"]

SLENDERNESS = 22.0  # length round the canal over the mean radius of the section


def vertebra_like(n_tets: int = 40_000, seed: int | None = None) -> TetMesh:
    """A solid with the parts of a vertebra: body, pedicles, arch, and seven processes.

    It winds once around the vertebral canal (the z-axis), the body in front (+x), the spinous
    process behind.

    Parameters
    ----------
    n_tets : int
        Number of tets aimed at.
    seed : int, optional
        Draws the proportions of an individual; the standard one without.

    Returns
    -------
    TetMesh

    Raises
    ------
    OptionError
        If fewer than 300 tets are asked for, or the seed is no integer from 0.

    Examples
    --------
    >>> import stretchmap as sm
    >>> one, other = (sm.samples.vertebra_like(600, seed=seed) for seed in (0, 1))
    >>> bool((one.V == other.V).all())
    False
    """
    if seed is not None:
        seed = whole("seed", seed, 0)
    return swept(n_tets, SLENDERNESS, individual(seed))


@dataclass(frozen=True, eq=False)
class VertebraPair:
    """Two vertebra-like solids with known correspondence.

    Attributes
    ----------
    source, target : TetMesh
        Different individuals, meshed differently.
    truth : ndarray, shape (n, 3)
        Where each source vertex lies in the target individual.
    source_landmarks, target_landmarks : ndarray of int, shape (k,)
        Boundary vertices of source and target that correspond exactly.

    Examples
    --------
    >>> import stretchmap as sm
    >>> pair = sm.samples.vertebra_pair(n_landmarks=3, n_tets=(600, 800))
    >>> pair.truth.shape == pair.source.V.shape
    True
    """

    source: TetMesh
    target: TetMesh
    truth: NDArray[np.float64]
    source_landmarks: NDArray[np.intp]
    target_landmarks: NDArray[np.intp]


def vertebra_pair(
    n_landmarks: int = 30, seed: int = 0, n_tets: tuple[int, int] = (30_000, 40_000)
) -> VertebraPair:
    """Two synthetic vertebrae, with landmarks and the true correspondence.

    Both are images of the same parameter domain, which is what makes the truth known; their meshes
    share only the vertices landmarks are taken from.

    Parameters
    ----------
    n_landmarks : int
        From 0 to 72, spread over the surface.
    seed : int
        Draws the two individuals and the landmarks.
    n_tets : (int, int)
        Number of tets aimed at, source and target.

    Returns
    -------
    VertebraPair

    Raises
    ------
    OptionError
        If the number of landmarks or of tets, or the seed, is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> pair = sm.samples.vertebra_pair(n_landmarks=3, n_tets=(600, 800))
    >>> ends = pair.truth[pair.source_landmarks], pair.target.V[pair.target_landmarks]
    >>> bool(np.allclose(*ends))
    True
    """
    stations, sixths = 12, 6
    n_landmarks = whole("n_landmarks", n_landmarks, 0, stations * sixths)
    seed, n_tets = whole("seed", seed, 0, 2**30), pair("n_tets", n_tets, 300)
    individuals = [individual(2 * seed), individual(2 * seed + 1)]
    sizes = [resolution(count, SLENDERNESS, stations) for count in n_tets]
    source, target = (sweep(n, m, embed) for (n, m), embed in zip(sizes, individuals, strict=True))
    (n, m), _ = sizes
    truth = individuals[1](*parameters(n, m)).reshape(-1, 3)

    sites = np.sort(np.random.default_rng(seed).permutation(stations * sixths)[:n_landmarks])
    station, sixth = np.divmod(sites, sixths)
    ids = [
        station * (m // stations) * disk_size(n) + disk_size(n - 1) + sixth * n for n, m in sizes
    ]
    return VertebraPair(source, target, truth, *ids)


def _bump(angle: Array, center: float, width: float) -> Array:
    """Smooth bump of height 1 on the circle, angles in radians."""
    return np.exp((np.cos(angle - center) - 1.0) / width**2)


def individual(seed: int | None) -> Embedding:
    """Parameter domain -> vertebra; the proportions vary by some percent with the seed."""
    rng = None if seed is None else np.random.default_rng([seed, 0x5EED])

    def vary(value: float, relative: float = 0.08) -> float:
        return value if rng is None else value * (1.0 + relative * rng.uniform(-1.0, 1.0))

    canal, body_depth, body_height = vary(1.0), vary(2.6), vary(1.25)
    pedicle, arch = vary(0.42), vary(0.5)
    spine, transverse, facet = vary(2.4), vary(1.7), vary(0.85)
    spine_drop, body_width = vary(0.55), vary(0.66, 0.05)
    transverse_at, lean = vary(1.95, 0.03), vary(0.25, 0.3)

    def embed(turns: Array, x: Array, y: Array) -> Array:
        u = TWO_PI * turns
        body = _bump(u, 0.0, body_width)
        body = body * (2.0 - body)  # a broad top, as of a flattened disk
        spinous = _bump(u, math.pi, 0.22)
        sides = [_bump(u, s * transverse_at, 0.2) for s in (1, -1)]
        facets = [_bump(u, s * (transverse_at + 0.3), 0.3) for s in (1, -1)]
        outward = arch + (body_depth - arch) * body + spine * spinous + transverse * sum(sides)
        half_height = pedicle + (body_height - pedicle) * body + facet * sum(facets)
        half_height = half_height + 0.25 * spinous
        # Towards a square section in the body: the disk pressed into a superellipse.
        t, v = np.hypot(x, y), np.arctan2(y, x)
        power = 2.0 + 2.0 * body
        c, s = np.abs(np.cos(v)), np.abs(np.sin(v))
        press = (c**power + s**power) ** (-1.0 / power)
        radial = 0.5 * outward * (1.0 + t * press * np.cos(v))
        rho = canal + radial
        drop = spine_drop * spinous * (radial / (0.5 * spine)) ** 2 * 0.5
        up = half_height * t * press * np.sin(v) - drop
        up = up + lean * sum(sides) * (radial / transverse) ** 2
        # The canal is wider than deep.
        return np.stack([rho * np.cos(u), 1.15 * rho * np.sin(u), up], axis=-1)

    return embed
