"""The standard grid of the solid torus: an O-grid swept round the axis.

The section is a square block in the middle with rings of quads round it, so that nothing meets in a
point at the core; four lines of the grid, the corners of the block, have three hexahedra round them
instead of four, and the scaled Jacobian there is at most sin(120 degrees) = 0.866.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..base.torus import TWO_PI

_SQUARE = 0.5  # half diagonal of the middle block over the radius of the section


@dataclass(frozen=True, eq=False)
class Layout:
    """Hexahedra of the solid torus, in coordinates that do not depend on its radii.

    Attributes
    ----------
    u, v, share : ndarray, shape (n,)
        Angles of each point and its distance from the core over that of the boundary there.
    H : ndarray of int32, shape (k, 8)
    block, layer : ndarray of int32, shape (k,)
        As in `HexMesh`.
    boundary : ndarray of int32, shape (b,)
        Points with share 1.
    """

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    share: NDArray[np.float64]
    H: NDArray[np.int32]
    block: NDArray[np.int32]
    layer: NDArray[np.int32]
    boundary: NDArray[np.int32]


def swept_layout(sections: int, block: int, rings: int) -> Layout:
    """The O-grid of ``block * block + 4 * block * rings`` quads, swept through ``sections``."""
    disk, quads, quad_block, quad_layer = _disk(block, rings)
    n = len(disk)
    here = n * np.arange(sections)[:, None, None]
    there = n * ((np.arange(sections) + 1) % sections)[:, None, None]
    H = np.concatenate([quads[None] + there, quads[None] + here], axis=2).reshape(-1, 8)
    outer = np.arange(n - 4 * block, n)
    return Layout(
        u=np.repeat(np.arange(sections) * TWO_PI / sections, n),
        v=np.tile(np.arctan2(disk[:, 1], disk[:, 0]), sections),
        share=np.tile(np.hypot(disk[:, 0], disk[:, 1]), sections),
        H=np.ascontiguousarray(H, np.int32),
        block=np.tile(quad_block, sections),
        layer=np.tile(quad_layer, sections),
        boundary=(n * np.arange(sections)[:, None] + outer).ravel().astype(np.int32),
    )


def prolongation(sections: int, block: int, rings: int) -> sp.csr_array:
    """Points of the layout with all three numbers doubled as means of those of the layout.

    Every hexahedron is split into eight parts of its trilinear map, valid if it is.

    Returns
    -------
    csr_array, shape (n', n)
    """
    side = block + 1
    rim = rim_of_block(block)
    layers = np.concatenate(
        [rim[None], side * side + np.arange(rings * len(rim)).reshape(rings, -1)]
    )
    along = _halved(side)
    to_square = sp.kron(along, along)
    around = sp.kron(_halved(rings + 1)[[*range(1, 2 * rings + 1)]], _halved(len(rim), cyclic=True))
    select = sp.csr_array(
        (np.ones(layers.size), (np.arange(layers.size), layers.ravel())),
        shape=(layers.size, side * side + rings * len(rim)),
    )
    pad = sp.csr_array((to_square.shape[0], rings * len(rim)))
    disk = sp.vstack([sp.hstack([to_square, pad]), around @ select])
    return sp.csr_array(sp.kron(_halved(sections, cyclic=True), disk))


def rim_of_block(block: int) -> NDArray[np.intp]:
    """The outer points of the middle block of a section, in the order of those of a ring."""
    side = block + 1
    return _rim(np.arange(side * side).reshape(side, side))


def _halved(n: int, cyclic: bool = False) -> sp.csr_array:
    """Places and middles of n points in a row, or round a circle."""
    half = sp.eye_array(n, format="csr")
    ahead = sp.csr_array((np.ones(n), (np.arange(n), (np.arange(n) + 1) % n)), shape=(n, n))
    rows = sp.vstack([half, 0.5 * (half + ahead)], format="csr")
    order = np.arange(2 * n).reshape(2, n).T.ravel()
    return rows[order if cyclic else order[:-1]]


def _rim(index: NDArray[np.intp]) -> NDArray[np.intp]:
    """The outer points of a square of points, in order round it."""
    return np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])


def _disk(
    block: int, rings: int
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.int32], NDArray[np.int32]]:
    """Points of the unit disk (n, 2), the rim last, quads (q, 4), their blocks and layers."""
    side = np.linspace(-1.0, 1.0, block + 1)
    x, y = (a.ravel() for a in np.meshgrid(side, side, indexing="ij"))
    # The square bulges half-way towards its circumscribed circle.
    radius = np.maximum(np.abs(x), np.abs(y))
    round_off = radius * np.sqrt(2.0) / np.maximum(np.hypot(x, y), 1e-300)
    square = np.stack([x, y], axis=1) * (0.5 + 0.5 * round_off)[:, None] * _SQUARE / np.sqrt(2.0)
    index = np.arange((block + 1) ** 2).reshape(block + 1, block + 1)
    inner = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    rim = _rim(index)
    start = square[rim]
    angle = np.arctan2(start[:, 1], start[:, 0])
    end = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    t = np.arange(1, rings + 1)[:, None, None] / rings
    around = ((1.0 - t) * start + t * end).reshape(-1, 2)
    layers = np.concatenate(
        [rim[None], len(square) + np.arange(rings * len(rim)).reshape(rings, -1)]
    )
    low, high = layers[:-1], layers[1:]
    outer = np.stack([low, high, np.roll(high, -1, axis=1), np.roll(low, -1, axis=1)], axis=-1)
    quads = np.concatenate([inner.reshape(-1, 4), outer.reshape(-1, 4)])
    quarters = np.tile(np.repeat(np.arange(1, 5), block), rings)
    depth = np.repeat(np.arange(rings - 1, -1, -1), 4 * block)
    return (
        np.concatenate([square, around]),
        quads,
        np.concatenate([np.zeros(block * block), quarters]).astype(np.int32),
        np.concatenate([np.full(block * block, rings), depth]).astype(np.int32),
    )
