"""Untangling a solid that may be too coarse for the map of its boundary.

Where the boundary image bends sharply, an interior vertex may have no place from where it sees the
inner side of all boundary faces round it: its tets cannot all be positive, whatever the rest does.
Then untangling gets stuck with a few inverted tets, and the edges that tie their interior vertices
to the boundary are halved before it goes on.
"""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..mesh.refinement import Refinement, crowded_edges
from .flip_free import FlipFreeSolver

_log = logging.getLogger("stretchmap")

_ROUNDS = 10
# Inverted tets as a share of all: with more, it is not a matter of single places; with so few,
# halving is cheaper than patience.
_MOST_STUCK, _FEW = 0.01, 0.001
# Times the fewest so far, and so many more: halving breeds more than it cures.
_TIMES, _MORE = 2, 100


def untangle_refining(
    solver: FlipFreeSolver,
    refinement: Refinement,
    x: NDArray[np.float64],
    *,
    glide: bool,
) -> tuple[FlipFreeSolver, Refinement, NDArray[np.float64], int]:
    """`FlipFreeSolver.untangle`, with the solid refined where tets stay inverted.

    Parameters
    ----------
    solver : FlipFreeSolver
        Of ``refinement.solid``, its source positions scaled and shifted.
    refinement : Refinement
    x : ndarray, shape (n, 3)
    glide : bool

    Returns
    -------
    solver : FlipFreeSolver
        Of the solid refined, with the same history.
    refinement : Refinement
        Of the same input.
    x : ndarray, shape (n', 3)
    left : int
        What could not be untangled all the same.
    """
    few = 0 if glide else int(_FEW * len(solver.T))
    x, left = solver.untangle(x, glide=glide, few=few)
    best = solver, refinement, x, left
    for _ in range(_ROUNDS):
        inverted = np.flatnonzero(~(_core.volume.signed_tet_volumes(x, solver.T) > 0.0))
        if not 0 < len(inverted) <= _MOST_STUCK * len(solver.T):
            break
        n, passes = refinement.solid.n_vertices, len(refinement.halved)
        refinement = refinement.halve(crowded_edges(refinement.solid, inverted))
        solid, V = refinement.solid, solver.V
        for ends in refinement.halved[passes:]:
            V, x = (np.concatenate([at, at[ends].mean(axis=1)]) for at in (V, x))
        _log.info(
            "%d inverted tets are stuck: %d edges round them halved",
            len(inverted), solid.n_vertices - n,
        )  # fmt: skip
        solver = dataclasses.replace(solver, V=V, T=solid.T)
        x, left = solver.untangle(x, glide=glide, few=few)
        if left < best[-1]:
            best = solver, refinement, x, left
        elif left > _TIMES * best[-1] + _MORE:
            break
    return best
