"""Hexahedral grids: the O-grid of a solid torus, measures, and their repair in a solid.

A hexahedron is right where the Jacobian at each of its eight corners is positive, that is, where
the tet of the corner and its three neighbours is; divided by the product of the three edges it is
the scaled Jacobian, 1 at a right angle. Where a pulled-back grid has corners that are not positive,
or nearly not, it is repaired in two stages. First the corners are turned by the regularised energy
that untangles maps, with boxes for rest shapes: Newton steps of the inner points take turns with a
search that moves points one by one, inner ones in space, boundary ones along the surface. Then the
points are drawn back to where the map had put them, as far as no corner gets bad.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_SQUARE = 0.5  # half diagonal of the middle block over the radius of the section

_VOLUME_WEIGHT = 0.3
_LARGEST_EPSILON, _LEAST_EPSILON = 0.3, 1e-3
_MOST_ROUNDS, _DRAW_ROUNDS = 20, 5
_NEWTON_STEPS, _UNTANGLE_SWEEPS, _DRAW_SWEEPS = 2, 3, 5
_SLACK = 1.5  # of psi: the scaled Jacobian of a box sheared so far is about 0.25
_PULL, _SOFT_PULL = 3.0, 0.3  # while points are drawn back, and before
_ASPECT = 20.0  # largest of the boxes that corners are measured against
_REACH = 0.2  # of the mean edge at a point: first try of its own step


def o_grid(
    block: int, rings: int
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Points of the unit disk (n, 2), quads (q, 4), and the points on the rim."""
    side = np.linspace(-1.0, 1.0, block + 1)
    x, y = (a.ravel() for a in np.meshgrid(side, side, indexing="ij"))
    # The square bulges half-way towards its circumscribed circle.
    radius = np.maximum(np.abs(x), np.abs(y))
    round_off = radius * np.sqrt(2.0) / np.maximum(np.hypot(x, y), 1e-300)
    square = np.stack([x, y], axis=1) * (0.5 + 0.5 * round_off)[:, None] * _SQUARE / np.sqrt(2.0)
    index = np.arange((block + 1) ** 2).reshape(block + 1, block + 1)
    inner = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    start = square[rim]
    angle = np.arctan2(start[:, 1], start[:, 0])
    end = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    t = np.arange(1, rings + 1)[:, None, None] / rings
    around = ((1.0 - t) * start + t * end).reshape(-1, 2)
    layers = np.concatenate(
        [rim[None], len(square) + np.arange(rings * len(rim)).reshape(rings, -1)]
    )
    low, high = layers[:-1], layers[1:]
    outer_quads = np.stack(
        [low, high, np.roll(high, -1, axis=1), np.roll(low, -1, axis=1)], axis=-1
    )
    quads = np.concatenate([inner.reshape(-1, 4), outer_quads.reshape(-1, 4)])
    return np.concatenate([square, around]), quads, layers[-1]
