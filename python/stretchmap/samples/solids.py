"""Meshes of our own: solid tori by a structured sweep, closed surfaces, pairs to be registered.

All but :func:`tetrahedralize` need nothing beyond NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..base.options import memory, pair, real, whole
from ..base.torus import TWO_PI, Torus
from ..errors import OptionError
from ..mesh.meshes import TetMesh
from ..mesh.tetrahedralize import tetrahedralize
from .sweep import (
    Array,
    Embedding,
    closed_frame,
    least_distance_of_strands,
    swept,
)

__all__ = [
    "ball",
    "bumpy_torus",
    "knot_tube",
    "solid_double_torus",
    "solid_torus",
    "tetrahedralize",
]


_MOST_WINDINGS = 100  # more than a mesh of any size shows
_BYTES_PER_CELL = 1500


def solid_torus(n_tets: int = 20_000, R: float = 3.0, r: float = 1.0) -> TetMesh:
    """The standard solid torus.

    Parameters
    ----------
    n_tets : int
        Number of tets aimed at; the structured mesh comes close to it.
    R, r : float
        Radius of the centre circle and of the tube, ``0 < r < R``.

    Returns
    -------
    TetMesh

    Raises
    ------
    OptionError
        If the radii do not make a torus or fewer than 300 tets are asked for.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> solid
    TetMesh(231 vertices, 594 tets)
    >>> solid.surface.genus
    1
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

    Returns
    -------
    TetMesh

    Raises
    ------
    OptionError
        If the parameters do not make a solid torus.

    Examples
    --------
    >>> import stretchmap as sm
    >>> flat, bumpy = (sm.samples.bumpy_torus(1000, amplitude=a) for a in (0.0, 0.25))
    >>> bumpy.surface.area > flat.surface.area
    True
    """
    torus = Torus(R, r)
    amplitude = real("amplitude", amplitude, 0.0, below=min(1.0, torus.ratio - 1.0))
    a, b = pair("waves", waves, 0, _MOST_WINDINGS)
    return swept(
        n_tets,
        TWO_PI * R / r,
        _revolved(torus, lambda u, v: 1.0 + amplitude * np.cos(a * u) * np.cos(b * v)),
    )


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

    Returns
    -------
    TetMesh

    Raises
    ------
    OptionError
        If p, q are not coprime or the tube would touch itself; the message names the largest
        radius.

    Examples
    --------
    >>> import stretchmap as sm
    >>> trefoil = sm.samples.knot_tube(2000, radius=0.3)
    >>> trefoil.require_solid_torus()  # knotted, and a solid torus all the same
    """
    p, q = (whole(name, x, 1, _MOST_WINDINGS) for name, x in (("p", p), ("q", q)))
    if math.gcd(p, q) != 1:
        raise OptionError(f"({p}, {q}) is not a knot: the numbers must be coprime")

    def curve(turns: Array) -> Array:
        return Torus(2.0, 1.0).xi(TWO_PI * p * turns, TWO_PI * q * turns)

    dense = curve(np.linspace(0.0, 1.0, 2001))
    length = float(np.linalg.norm(np.diff(dense, axis=0), axis=1).sum())
    room = least_distance_of_strands(dense[:-1:4], length)
    radius = real("radius", radius, above=0.0, below=0.45 * room)

    def embed(turns: Array, x: Array, y: Array) -> Array:
        centers = curve(turns[:, 0])
        e1, e2 = closed_frame(centers)
        return centers[:, None] + radius * (x[..., None] * e1[:, None] + y[..., None] * e2[:, None])

    return swept(n_tets, length / radius, embed)


def ball(n: int = 6) -> TetMesh:
    """A ball of radius 1 (genus 0), from a cube of ``(2 n)^3`` cells.

    Parameters
    ----------
    n : int
        Half the number of cells along an edge of the cube, at least 1.

    Returns
    -------
    TetMesh

    Raises
    ------
    OptionError
        If ``n < 1``, or there is not the memory.

    Examples
    --------
    >>> import stretchmap as sm
    >>> sm.samples.ball(2).surface.genus
    0
    """
    n = whole("n", n, 1)
    memory(f"a mesh of {48 * n**3} tets", _BYTES_PER_CELL * 8 * n**3)
    V, T = cut_cells(np.ones((2 * n,) * 3, bool))
    V = V / n - 1.0
    # Each cube shell goes to the sphere of the same size.
    size = np.abs(V).max(axis=1, keepdims=True)
    return TetMesh(V * (size / np.maximum(np.linalg.norm(V, axis=1, keepdims=True), 1e-300)), T)


def solid_double_torus(n: int = 2) -> TetMesh:
    """A plate with two holes (genus 2) from cubic cells.

    Parameters
    ----------
    n : int
        Cells per bar of the plate, at least 1.

    Returns
    -------
    TetMesh

    Raises
    ------
    OptionError
        If ``n < 1``.

    Examples
    --------
    >>> import stretchmap as sm
    >>> sm.samples.solid_double_torus(1).surface.genus
    2
    """
    plate = np.ones((5, 3, 1), bool)
    plate[[1, 3], 1] = False
    n = whole("n", n, 1)
    memory(f"a mesh of {78 * n**3} tets", _BYTES_PER_CELL * 13 * n**3)
    cells = plate.repeat(n, 0).repeat(n, 1).repeat(n, 2)
    V, T = cut_cells(cells)
    return TetMesh(V / n, T)


def _revolved(torus: Torus, scale: Callable[[Array, Array], Array]) -> Embedding:
    """Section scaled about the centre circle of a torus by a function of (u, v)."""

    def embed(turns: Array, x: Array, y: Array) -> Array:
        u, v = TWO_PI * turns, np.arctan2(y, x)
        return torus.xi(u, v, torus.r * np.hypot(x, y) * scale(u, v))

    return embed


def cut_cells(cells: NDArray[np.bool_]) -> tuple[Array, NDArray[np.intp]]:
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
