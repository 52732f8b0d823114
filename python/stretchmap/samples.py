"""Meshes of our own: solid tori by a structured sweep, closed surfaces, pairs to be registered.

All but :func:`tetrahedralise` need nothing beyond NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ._sweep import (
    Array,
    Embedding,
    closed_frame,
    disk_size,
    least_distance_of_strands,
    parameters,
    resolution,
    sweep,
    swept,
)
from ._tetgen import tetrahedralise
from .errors import OptionError
from .mesh import TetMesh, TriMesh
from .torus import TWO_PI, Torus

__all__ = [
    "VertebraPair",
    "ball",
    "bumpy_torus",
    "double_torus",
    "knot_tube",
    "solid_double_torus",
    "solid_torus",
    "sphere",
    "tetrahedralise",
    "torus_surface",
    "vertebra_like",
    "vertebra_pair",
]


def solid_torus(n_tets: int = 20_000, R: float = 3.0, r: float = 1.0) -> TetMesh:
    """The standard solid torus.

    Parameters
    ----------
    n_tets : int
        Number of tets aimed at; the structured mesh comes close to it.
    R, r : float
        Radius of the centre circle and of the tube, ``0 < r < R``.

    Raises
    ------
    OptionError
        If the radii do not make a torus or fewer than 300 tets are asked for.
    """
    torus = Torus(R, r)
    return swept(n_tets, TWO_PI * R / r, _revolved(torus, lambda u, v: 1.0 + 0.0 * u * v))


def bumpy_torus(
    n_tets: int = 20_000,
    R: float = 3.0,
    r: float = 1.0,
    amplitude: float = 0.25,
    waves: tuple[int, int] = (5, 3),
) -> TetMesh:
    """A solid torus whose tube radius is ``r (1 + amplitude cos(waves[0] u) cos(waves[1] v))``.

    Parameters
    ----------
    n_tets : int
        Number of tets aimed at.
    R, r : float
        Radius of the centre circle and mean radius of the tube.
    amplitude : float
        Relative height of the bumps, below 1 and such that ``r (1 + amplitude) < R``.
    waves : (int, int)
        Number of bumps the long and the short way round.

    Raises
    ------
    OptionError
        If the parameters do not make a solid torus.
    """
    torus = Torus(R, r)
    if not 0.0 <= amplitude < min(1.0, torus.ratio - 1.0):
        raise OptionError(f"amplitude must be in [0, min(1, R/r - 1)), got {amplitude}")
    a, b = waves
    return swept(
        n_tets,
        TWO_PI * R / r,
        _revolved(torus, lambda u, v: 1.0 + amplitude * np.cos(a * u) * np.cos(b * v)),
    )


def torus_surface(nu: int = 60, nv: int = 20, R: float = 3.0, r: float = 1.0) -> TriMesh:
    """A regular triangulation of the standard torus, faces outward.

    Parameters
    ----------
    nu, nv : int
        Vertices the long and the short way round, at least 3; vertex ``i nv + j`` lies at the
        angles ``(2 pi i / nu, 2 pi j / nv)``.
    R, r : float
        Radii, ``0 < r < R``.

    Raises
    ------
    OptionError
        If there are fewer than three vertices either way or the radii do not make a torus.
    """
    if nu < 3 or nv < 3:
        raise OptionError(f"a torus needs at least 3 vertices either way, got {nu} and {nv}")
    i, j = (index.ravel() for index in np.indices((nu, nv)))
    a, b = i * nv + j, (i + 1) % nu * nv + j
    c, d = (i + 1) % nu * nv + (j + 1) % nv, i * nv + (j + 1) % nv
    faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    return TriMesh(Torus(R, r).xi(TWO_PI * i / nu, TWO_PI * j / nv), faces)


def knot_tube(n_tets: int = 20_000, radius: float = 0.4, p: int = 2, q: int = 3) -> TetMesh:
    """A tube around the (p, q) torus knot, by default the trefoil.

    The section is carried along by a rotation-minimising frame; the angle by which that frame
    fails to close is spread evenly over the length.

    Parameters
    ----------
    n_tets : int
        Number of tets aimed at.
    radius : float
        Radius of the tube; the knot itself lies on the torus with R = 2, r = 1.
    p, q : int
        Coprime; turns about the axis and about the tube.

    Raises
    ------
    OptionError
        If p, q are not coprime or the tube would touch itself; the message names the largest
        radius.
    """
    if math.gcd(p, q) != 1:
        raise OptionError(f"({p}, {q}) is not a knot: the numbers must be coprime")

    def curve(turns: Array) -> Array:
        return Torus(2.0, 1.0).xi(TWO_PI * p * turns, TWO_PI * q * turns)

    dense = curve(np.linspace(0.0, 1.0, 2001))
    length = float(np.linalg.norm(np.diff(dense, axis=0), axis=1).sum())
    room = least_distance_of_strands(dense[:-1:4], length)
    if not 0.0 < radius < 0.45 * room:
        raise OptionError(f"radius must be positive and below {0.45 * room:.3g}, got {radius}")

    def embed(turns: Array, x: Array, y: Array) -> Array:
        centres = curve(turns[:, 0])
        e1, e2 = closed_frame(centres)
        return centres[:, None] + radius * (x[..., None] * e1[:, None] + y[..., None] * e2[:, None])

    return swept(n_tets, length / radius, embed)


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

    Raises
    ------
    OptionError
        If fewer than 300 tets are asked for.
    """
    return swept(n_tets, 22.0, _vertebra(seed))


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

    Raises
    ------
    OptionError
        If the number of landmarks or of tets is out of range.
    """
    stations, sixths = 12, 6
    if not 0 <= n_landmarks <= stations * sixths:
        raise OptionError(f"n_landmarks must be from 0 to {stations * sixths}, got {n_landmarks}")
    individuals = [_vertebra(2 * seed), _vertebra(2 * seed + 1)]
    sizes = [resolution(count, 22.0, stations) for count in n_tets]
    source, target = (sweep(n, m, embed) for (n, m), embed in zip(sizes, individuals, strict=True))
    (n, m), _ = sizes
    truth = individuals[1](*parameters(n, m)).reshape(-1, 3)

    sites = np.sort(np.random.default_rng(seed).permutation(stations * sixths)[:n_landmarks])
    station, sixth = np.divmod(sites, sixths)
    ids = [
        station * (m // stations) * disk_size(n) + disk_size(n - 1) + sixth * n for n, m in sizes
    ]
    return VertebraPair(source, target, truth, *ids)


def ball(n: int = 6) -> TetMesh:
    """A ball of radius 1 (genus 0), from a cube of ``(2 n)^3`` cells.

    Raises
    ------
    OptionError
        If ``n < 1``.
    """
    V, T = _cells(np.ones((2 * _at_least_one(n),) * 3, bool))
    V = V / n - 1.0
    # Each cube shell goes to the sphere of the same size.
    size = np.abs(V).max(axis=1, keepdims=True)
    return TetMesh(V * (size / np.maximum(np.linalg.norm(V, axis=1, keepdims=True), 1e-300)), T)


def sphere(n: int = 6) -> TriMesh:
    """The unit sphere, ``48 n^2`` faces; the boundary of :func:`ball`."""
    return ball(n).surface


def solid_double_torus(n: int = 2) -> TetMesh:
    """A plate with two holes (genus 2) from cubic cells.

    Parameters
    ----------
    n : int
        Cells per bar of the plate, at least 1.

    Raises
    ------
    OptionError
        If ``n < 1``.
    """
    plate = np.ones((5, 3, 1), bool)
    plate[[1, 3], 1] = False
    cells = plate.repeat(_at_least_one(n), 0).repeat(n, 1).repeat(n, 2)
    V, T = _cells(cells)
    return TetMesh(V / n, T)


def double_torus(n: int = 2) -> TriMesh:
    """A closed surface of genus 2, the boundary of :func:`solid_double_torus`."""
    return solid_double_torus(n).surface


def _revolved(torus: Torus, scale: Callable[[Array, Array], Array]) -> Embedding:
    """Section scaled about the centre circle of a torus by a function of (u, v)."""

    def embed(turns: Array, x: Array, y: Array) -> Array:
        u, v = TWO_PI * turns, np.arctan2(y, x)
        return torus.xi(u, v, torus.r * np.hypot(x, y) * scale(u, v))

    return embed


def _bump(angle: Array, centre: float, width: float) -> Array:
    """Smooth bump of height 1 on the circle, angles in radians."""
    return np.exp((np.cos(angle - centre) - 1.0) / width**2)


def _vertebra(seed: int | None) -> Embedding:
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


def _at_least_one(n: int) -> int:
    if n < 1:
        raise OptionError(f"n must be at least 1, got {n}")
    return n


def _cells(cells: NDArray[np.bool_]) -> tuple[Array, NDArray[np.intp]]:
    """Unit cubes cut into six tets each along parallel diagonals; used vertices only."""
    shape = np.array(cells.shape) + 1
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    base = np.argwhere(cells) @ strides
    tets = []
    for first, second, third in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (1, 0, 2), (2, 1, 0)):
        path = np.cumsum([0, strides[first], strides[second], strides[third]])
        even = (second - first) % 3 == 1
        tets.append(base[:, None] + (path if even else path[[0, 1, 3, 2]]))
    ids, T = np.unique(np.concatenate(tets), return_inverse=True)
    points = np.stack(np.unravel_index(ids, shape), axis=1).astype(float)
    return points, T.reshape(-1, 4)
