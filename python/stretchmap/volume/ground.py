"""Letting the boundary glide on a triangle mesh.

A mesh is smooth on the whole only. A face of the boundary image that lies across a sharp edge may
seem folded without being so: its vertices are held until it does no longer. And faces that are
graphs over the mesh may yet cross each other where it is thin: those are held from where they did
not on.
"""

from __future__ import annotations

import dataclasses
import logging
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .glide_minimize import minimize_on_mesh
from .glide_targets import GlideTargets
from .minimize import Minimized
from .model import History
from .options import FillOptions
from .problem import VolumeProblem
from .untangle import folded_faces, stuck_tets, untangle_patches

__all__ = ["glide_on_mesh", "untangle_on_mesh"]

_log = logging.getLogger("stretchmap")

_TRIES, _RELEASES = 8, 2
_MOST_PAIRS = 10_000
# What is amiss far apart is mended by moving all between, which a coarse solve hardly sees.
_CG_TOL = 0.01
_TOL = 5e-4  # and takes many steps that gain little each
# Weight of the volume term to begin with. Where volumes have far to go, shape leads the boundary
# there; volumes alone drive it into the nearest jam.
_START = 0.2
_GOAL = 1e3  # and to end with: what is left to be had is asked for on top, see `GlideTargets`
# Rings of vertices round inverted tets that may glide.
_REACHES: tuple[int, ...] = (1, 2, 4)
_CROSSINGS = 3  # times those that cross for it are held instead


def glide_on_mesh(
    problem: VolumeProblem, options: FillOptions, history: History
) -> Minimized | None:
    """Least volume distortion with the boundary gliding on ``problem.ground``.

    Parameters
    ----------
    problem : VolumeProblem
        Its image without inverted tets, its boundary without crossing faces.
    options : FillOptions
    history : History
        Gets a record per step, of the stage ``"glide"``.

    Returns
    -------
    Minimized or None
        As certifiable as what was given; None if the boundary crosses itself, whatever is held.
    """
    options = dataclasses.replace(
        options,
        cg_tol=min(options.cg_tol, _CG_TOL),
        glide_tol=min(options.glide_tol, _TOL),
        volume_weight=min(options.volume_weight, _GOAL),
    )
    x, first = problem.x, min(options.frozen_weight, _START)
    held, found = _folded(problem, options, x), None
    targets = GlideTargets(problem.model(options))
    tries = releases = 0
    while True:
        history.model = dataclasses.replace(problem, held=held).model(options)
        done = minimize_on_mesh(
            history.model, x, history,
            start=first, targets=targets, crossing=partial(_crossing, problem),
        )  # fmt: skip
        if len(done.crossing):
            if found is not None:
                break  # what was let go is at fault
            if tries == _TRIES or history.budget.spent:
                reason = "the boundary would cross itself" if tries == _TRIES else done.reason
                found = None if done.x is problem.x else dataclasses.replace(done, reason=reason)
                break
            _log.info("%d vertices of the gliding boundary cross: held", len(done.crossing))
            held, tries = np.union1d(held, done.crossing), tries + 1
            x, first = done.x, done.weight
            targets.forget_best()
            continue
        found, x = done, done.x
        if history.model.kept(x):
            break
        still = np.intersect1d(_folded(problem, options, x), held)
        if len(still) == len(held) or releases == _RELEASES or history.budget.spent:
            break
        held, first, releases = still, options.volume_weight, releases + 1
        targets = GlideTargets(problem.model(options))
    return found


def untangle_on_mesh(
    problem: VolumeProblem, options: FillOptions, history: History, *, reaches: slice = slice(None)
) -> NDArray[np.float64] | None:
    """Untangle what nothing inside can, the boundary round it gliding on ``problem.ground``.

    Parameters
    ----------
    problem : VolumeProblem
        Its image with few inverted tets, its boundary without crossing faces.
    options : FillOptions
    history : History
    reaches : slice
        Of how far round the tets it may, from near to far.

    Returns
    -------
    ndarray, shape (n, 3), or None
        Without inverted tets and crossing faces; None if that could not be had.
    """
    held = problem.held
    for rings in _REACHES[reaches]:
        for _ in range(_CROSSINGS):
            model = dataclasses.replace(problem, held=held).model(options)
            x, fewest = problem.x, len(model.T) + 1
            while not history.budget.spent:
                # Folded faces, too: where some tets cannot be untangled, it is these that hold
                # them.
                left = stuck_tets(model, x, glide=True)
                if not 0 < len(left) < fewest:
                    break
                fewest = len(left)
                x = untangle_patches(model, x, left, rings=rings, glide=True, budget=history.budget)
            if len(stuck_tets(model, x, glide=False)):
                break
            crossing = _crossing(problem, x)
            if not len(crossing):
                _log.info("inverted tets untangled by moving the boundary round them")
                return x
            held = np.union1d(held, crossing)
    return None


def _folded(
    problem: VolumeProblem, options: FillOptions, x: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Vertices of faces that do not look outward."""
    model = problem.model(options)
    return np.unique(model.faces[folded_faces(model, x)]).astype(np.intp)


def _crossing(problem: VolumeProblem, x: NDArray[np.float64]) -> NDArray[np.intp]:
    """Boundary vertices of faces that cross others."""
    ids, F = problem.solid.boundary_vertices, problem.solid.surface.F
    pairs = _core.certificate.crossing_faces(np.ascontiguousarray(x[ids]), F, _MOST_PAIRS)
    return np.unique(ids[F[np.unique(pairs)]]).astype(np.intp)
