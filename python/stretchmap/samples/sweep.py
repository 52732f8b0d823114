"""Structured sweeps: a disk in concentric rings carried along a closed curve, prisms cut into tets.

Ring k of the disk has 6 k vertices. Copies of the disk along the curve span prisms, and every prism
is cut into three tets along the diagonals that run from the lower to the higher vertex number of
the disk, so that neighbours agree.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..base.options import memory, whole
from ..base.torus import TWO_PI
from ..mesh.meshes import TetMesh

_BYTES_PER_TET = 150  # at the peak

Array = NDArray[np.float64]
# Stations (m, 1) in turns and section points (1, p) in the unit disk -> points (m, p, 3).
Embedding = Callable[[Array, Array, Array], Array]


def swept(n_tets: int, slenderness: float, embed: Embedding) -> TetMesh:
    """Sweep with about ``n_tets`` tets; slenderness is the length over the tube radius."""
    return sweep(*resolution(n_tets, slenderness), embed)


def resolution(n_tets: int, slenderness: float, multiple: int = 1) -> tuple[int, int]:
    """Rings n and stations m with 18 n^2 m close to n_tets and cells about as long as wide."""
    n_tets = whole("n_tets", n_tets, 300)
    memory(f"a mesh of {n_tets} tets", _BYTES_PER_TET * n_tets)
    n = max(1, round((n_tets / (18.0 * slenderness)) ** (1.0 / 3.0)))
    m = max(1, round(n_tets / (18.0 * n * n * multiple))) * multiple
    return n, max(m, 6)


def disk_size(n: int) -> int:
    """Vertices of the disk with n rings."""
    return 1 + 3 * n * (n + 1)


def _disk(n: int) -> tuple[Array, Array, NDArray[np.int32]]:
    """Unit disk in n rings: coordinates x, y (p,) and triangles (6 n^2, 3), counter-clockwise."""
    ring = np.repeat(np.arange(n + 1), [1, *(6 * k for k in range(1, n + 1))])
    first = np.array([disk_size(k - 1) if k else 0 for k in range(n + 1)])
    angle = TWO_PI * (np.arange(disk_size(n)) - first[ring]) / np.maximum(6 * ring, 1)
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


def parameters(n: int, m: int) -> tuple[Array, Array, Array]:
    x, y, _ = _disk(n)
    return np.arange(m)[:, None] / m, x[None], y[None]


def sweep(n: int, m: int, embed: Embedding) -> TetMesh:
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


def least_distance_of_strands(points: Array, length: float) -> float:
    """Least distance of points of a closed curve that are far apart along it."""
    n = len(points)
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    apart = np.minimum(apart, n - apart) * (length / n)
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return float(distance[apart > 2.0 * distance].min(initial=math.inf))


def closed_frame(centers: Array) -> tuple[Array, Array]:
    """Normals (m, 3), (m, 3) along a closed polygon, turning as little as possible.

    Double reflection carries the frame from station to station (Wang et al. 2008); what is missing
    after one round is spread evenly.
    """
    m = len(centers)
    tangent = np.roll(centers, -1, axis=0) - np.roll(centers, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.empty_like(centers)
    start = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    start = start - (start @ tangent[0]) * tangent[0]
    current = start / np.linalg.norm(start)
    for i in range(m):
        normal[i] = current
        k = (i + 1) % m
        chord = centers[k] - centers[i]
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
