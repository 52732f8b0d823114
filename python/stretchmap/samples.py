"""Meshes of our own: solid tori by a structured sweep, closed surfaces, pairs to be registered.

The sweeps need nothing but NumPy. A disk is triangulated in concentric rings, ring k with 6 k
vertices; its copies along a closed curve span prisms, and every prism is cut into three tets along
the diagonals that run from the lower to the higher vertex number of the disk, so that neighbours
agree. Only :func:`tetrahedralise` needs an optional package.
"""

from __future__ import annotations

import importlib.util
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import MissingDependencyError, OptionError, SolverError
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

Array = NDArray[np.float64]
# Stations (m, 1) in turns and section points (1, p) in the unit disk -> points (m, p, 3).
Embedding = Callable[[Array, Array, Array], Array]


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
    return _swept(n_tets, TWO_PI * R / r, _revolved(torus, lambda u, v: 1.0 + 0.0 * u * v))


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
    return _swept(
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
        If the tube does not fit (``radius`` at least 0.5 for the trefoil, less for others) or p, q
        are not coprime.
    """
    if math.gcd(p, q) != 1:
        raise OptionError(f"({p}, {q}) is not a knot: the numbers must be coprime")

    def curve(turns: Array) -> Array:
        return Torus(2.0, 1.0).xi(TWO_PI * p * turns, TWO_PI * q * turns)

    dense = curve(np.linspace(0.0, 1.0, 2001))
    length = float(np.linalg.norm(np.diff(dense, axis=0), axis=1).sum())
    room = _least_distance_of_strands(dense[:-1:4], length)
    if not 0.0 < radius < 0.45 * room:
        raise OptionError(f"radius must be positive and below {0.45 * room:.3g}, got {radius}")

    def embed(turns: Array, x: Array, y: Array) -> Array:
        centres = curve(turns[:, 0])
        e1, e2 = _closed_frame(centres)
        return centres[:, None] + radius * (x[..., None] * e1[:, None] + y[..., None] * e2[:, None])

    return _swept(n_tets, length / radius, embed)


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
    return _swept(n_tets, 22.0, _vertebra(seed))


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
    sizes = [_resolution(count, 22.0, stations) for count in n_tets]
    source, target = (_sweep(n, m, embed) for (n, m), embed in zip(sizes, individuals, strict=True))
    (n, m), _ = sizes
    truth = individuals[1](*_parameters(n, m)).reshape(-1, 3)

    sites = np.sort(np.random.default_rng(seed).permutation(stations * sixths)[:n_landmarks])
    station, sixth = np.divmod(sites, sixths)
    ids = [
        station * (m // stations) * _disk_size(n) + _disk_size(n - 1) + sixth * n for n, m in sizes
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


def tetrahedralise(
    surface: TriMesh, max_volume: float | None = None, quality: float = 1.4
) -> TetMesh:
    """Fill a closed surface with tets, the surface kept exactly as it is.

    Parameters
    ----------
    surface : TriMesh
        Closed, without self-intersections, faces outward, every vertex used. Its vertices are the
        first of the result, in the same order; its faces are the boundary faces.
    max_volume : float, optional
        Largest tet volume aimed at; without it the size follows the surface.
    quality : float
        Largest ratio of circumradius to shortest edge aimed at, above 1. Near the surface both
        aims may be missed, since the surface is not refined.

    Raises
    ------
    MissingDependencyError
        If the ``tetgen`` package is not installed.
    OptionError
        If ``max_volume`` or ``quality`` is out of range.
    SolverError
        If the surface cannot be filled, as when it crosses itself, or was changed.
    """
    if quality <= 1.0 or (max_volume is not None and max_volume <= 0.0):
        raise OptionError("quality must be above 1 and max_volume positive")
    if importlib.util.find_spec("tetgen") is None:
        raise MissingDependencyError(
            "filling a surface with tets needs tetgen: pip install 'stretchmap[mesh]'"
        )
    options: dict[str, Any] = {"minratio": quality}
    if max_volume is not None:
        options |= {"fixedvolume": True, "maxvolume": max_volume}
    filled = _run_tetgen(surface, options)
    solid = TetMesh(filled[0], filled[1], orient=True)
    n = len(surface.V)
    if not (
        np.array_equal(solid.V[:n], surface.V)
        and np.array_equal(solid.boundary_vertices, np.arange(n))
        and len(solid.surface.F) == len(surface.F)
    ):
        raise SolverError("filling the surface with tets changed it")
    return solid


def _run_tetgen(surface: TriMesh, options: dict[str, Any]) -> tuple[Array, NDArray[np.int32]]:
    """Points and tets; in a process of its own, since tetgen aborts the process on bad input."""
    script = (
        "import json, sys, numpy, tetgen\n"
        "data = numpy.load('surface.npz')\n"
        "filled = tetgen.TetGen(data['V'], data['F']).tetrahedralize(\n"
        "    nobisect=True, quality=True, order=1, quiet=True, **json.loads(sys.argv[1]))\n"
        "numpy.savez('solid.npz', V=filled[0], T=filled[1])\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder, "surface.npz"), V=surface.V, F=surface.F)
        run = subprocess.run(
            [sys.executable, "-c", script, json.dumps(options)],
            cwd=folder,
            capture_output=True,
            text=True,
        )
        if run.returncode != 0:
            raise SolverError(
                "the surface cannot be filled with tets; it may cross itself "
                f"({(run.stderr.strip().splitlines() or ['tetgen gave up'])[-1]})"
            )
        with np.load(Path(folder, "solid.npz")) as solid:
            return solid["V"], solid["T"]


def _swept(n_tets: int, slenderness: float, embed: Embedding) -> TetMesh:
    """Sweep with about ``n_tets`` tets; slenderness is the length over the tube radius."""
    return _sweep(*_resolution(n_tets, slenderness), embed)


def _resolution(n_tets: int, slenderness: float, multiple: int = 1) -> tuple[int, int]:
    """Rings n and stations m with 18 n^2 m close to n_tets and cells about as long as wide."""
    if n_tets < 300:
        raise OptionError(f"a sweep has at least 300 tets, got n_tets = {n_tets}")
    n = max(1, round((n_tets / (18.0 * slenderness)) ** (1.0 / 3.0)))
    m = max(1, round(n_tets / (18.0 * n * n * multiple))) * multiple
    return n, max(m, 6)


def _disk_size(n: int) -> int:
    """Vertices of the disk with n rings."""
    return 1 + 3 * n * (n + 1)


def _disk(n: int) -> tuple[Array, Array, NDArray[np.int32]]:
    """Unit disk in n rings: coordinates x, y (p,) and triangles (6 n^2, 3), counter-clockwise."""
    ring = np.repeat(np.arange(n + 1), [1, *(6 * k for k in range(1, n + 1))])
    first = np.array([_disk_size(k - 1) if k else 0 for k in range(n + 1)])
    angle = TWO_PI * (np.arange(_disk_size(n)) - first[ring]) / np.maximum(6 * ring, 1)
    x, y = ring / n * np.cos(angle), ring / n * np.sin(angle)

    triangles = []
    for k in range(1, n + 1):
        sector, step = (index.ravel() for index in np.indices((6, k)))
        outer = first[k] + sector * k + step
        outer_next = first[k] + (sector * k + step + 1) % (6 * k)
        inner_count = max(6 * (k - 1), 1)
        inner = first[k - 1] + (sector * (k - 1) + step) % inner_count
        inner_next = first[k - 1] + (sector * (k - 1) + step + 1) % inner_count
        triangles.append(np.stack([inner, outer, outer_next], axis=1))
        between = step < k - 1
        triangles.append(np.stack([inner, outer_next, inner_next], axis=1)[between])
    return x, y, np.concatenate(triangles).astype(np.int32)


def _parameters(n: int, m: int) -> tuple[Array, Array, Array]:
    x, y, _ = _disk(n)
    return np.arange(m)[:, None] / m, x[None], y[None]


def _sweep(n: int, m: int, embed: Embedding) -> TetMesh:
    """Disk with n rings swept through m stations of a closed curve."""
    x, y, triangles = _disk(n)
    p = len(x)
    V = embed(np.arange(m)[:, None] / m, x[None], y[None]).reshape(-1, 3)
    low = np.sort(triangles, axis=1)
    odd = np.argmax(triangles == low[:, :1], axis=1)  # an even turn brings the lowest id first
    odd = np.take_along_axis(triangles, (odd[:, None] + 1) % 3, axis=1)[:, 0] != low[:, 1]
    a, b, c = (low[None, :, k] + p * np.arange(m, dtype=np.int32)[:, None] for k in range(3))
    a1, b1, c1 = (
        low[None, :, k] + p * ((np.arange(m, dtype=np.int32)[:, None] + 1) % m) for k in range(3)
    )
    T = np.stack([a, b, c, c1, a, b, b1, c1, a, a1, b1, c1], axis=-1).reshape(m, -1, 3, 4)
    # (a, b, c, c1) and (a, a1, b1, c1) have one sign, (a, b, b1, c1) the other.
    turn = np.stack([odd, ~odd, odd], axis=1)
    first = V[T[0, 0, 0, 1:]] - V[T[0, 0, 0, 0]]
    if (np.linalg.det(first) < 0.0) != turn[0, 0]:
        turn = ~turn
    T = np.where(turn[None, :, :, None], T[..., [0, 1, 3, 2]], T)
    return TetMesh(V, T.reshape(-1, 4))


def _revolved(torus: Torus, scale: Callable[[Array, Array], Array]) -> Embedding:
    """Section scaled about the centre circle of a torus by a function of (u, v)."""

    def embed(turns: Array, x: Array, y: Array) -> Array:
        u, v = TWO_PI * turns, np.arctan2(y, x)
        return torus.xi(u, v, torus.r * np.hypot(x, y) * scale(u, v))

    return embed


def _least_distance_of_strands(points: Array, length: float) -> float:
    """Least distance of points of a closed curve that are far apart along it."""
    n = len(points)
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    apart = np.minimum(apart, n - apart) * (length / n)
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return float(distance[apart > 2.0 * distance].min(initial=math.inf))


def _closed_frame(centres: Array) -> tuple[Array, Array]:
    """Normals (m, 3), (m, 3) along a closed polygon, turning as little as possible.

    Double reflection carries the frame from station to station (Wang et al. 2008); what is missing
    after one round is spread evenly.
    """
    m = len(centres)
    tangent = np.roll(centres, -1, axis=0) - np.roll(centres, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.empty_like(centres)
    start = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    start = start - (start @ tangent[0]) * tangent[0]
    current = start / np.linalg.norm(start)
    for i in range(m):
        normal[i] = current
        k = (i + 1) % m
        chord = centres[k] - centres[i]
        chord /= np.linalg.norm(chord)
        current = current - 2.0 * (chord @ current) * chord
        carried = tangent[i] - 2.0 * (chord @ tangent[i]) * chord
        mirror = tangent[k] - carried
        length = mirror @ mirror
        if length > 0.0:
            current = current - 2.0 / length * (mirror @ current) * mirror
    binormal = np.cross(tangent, normal)
    missing = math.atan2(current @ binormal[0], current @ normal[0])
    angle = -missing * np.arange(m)[:, None] / m
    return (
        np.cos(angle) * normal + np.sin(angle) * binormal,
        np.cos(angle) * binormal - np.sin(angle) * normal,
    )


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
