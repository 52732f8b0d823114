"""The two routes to a volume map: Algorithm 5.1, and the certified one.

`volume` decides which is taken with what, and makes a result of the outcome.
"""

from __future__ import annotations

import dataclasses
import logging
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.progress import Progress
from ..certificate.checks import certify
from ..maps.history import IterationRecord
from .flip_free import FlipFreeSolver
from .options import FlipFreeOptions
from .untangle import untangle_refining
from .vsem import minimize_volumetric_stretch

if TYPE_CHECKING:
    pass
from .problem import SolidProblem

__all__ = ["SolidRun", "certified_route", "vsem_route"]

_log = logging.getLogger("stretchmap")

# Before untangling, a few regularised steps (5.6) remove most flips of the harmonic map for little.
_WARM_STEPS, _WARM_C = 3, 10.0


@dataclass(frozen=True)
class SolidRun:
    """What a route ends with, on the scale of the problem.

    Attributes
    ----------
    x : ndarray, shape (n, 3)
    history : tuple of IterationRecord
    converged : bool
    stop_reason : str
    seconds : dict
        By stage.
    vertex_exact : bool
    """

    x: NDArray[np.float64]
    history: tuple[IterationRecord, ...]
    converged: bool
    stop_reason: str
    seconds: dict[str, float]
    vertex_exact: bool = False


def vsem_route(
    problem: SolidProblem,
    *,
    c: float,
    max_iter: int,
    tol: float,
    solver: str,
    progress: Progress | None,
) -> SolidRun:
    """Algorithm 5.1."""
    clock = time.perf_counter()
    run = minimize_volumetric_stretch(
        problem.V, problem.solid.T, problem.fixed, problem.x, c=c, max_iter=max_iter, tol=tol,
        harmonic=not problem.warm, solver=solver, progress=progress,
    )  # fmt: skip
    seconds = {"vsem": time.perf_counter() - clock}
    return SolidRun(run.image, run.history, run.converged, run.stop_reason, seconds)


def certified_route(
    problem: SolidProblem,
    options: FlipFreeOptions,
    *,
    glide: bool,
    vertex_exact: bool,
    solver: str,
    progress: Progress | None,
) -> tuple[SolidProblem, SolidRun]:
    """Untangle, minimise with the boundary held, let it glide, equalise.

    A map that starts warm has been through the first stages before. The problem comes back with its
    solid refined where untangling asked for it.
    """
    solid, x = problem.solid, problem.x
    seconds: dict[str, float] = {}
    history: tuple[IterationRecord, ...] = ()
    if not problem.warm:
        warm = vsem_route(
            problem, c=_WARM_C, max_iter=_WARM_STEPS, tol=0.0, solver=solver, progress=progress
        )
        x, history, seconds = warm.x, warm.history, warm.seconds
    flip_free = FlipFreeSolver(
        V=problem.V,
        T=solid.T,
        boundary=solid.boundary_vertices,
        faces=solid.boundary_vertices[solid.surface.F],
        R=problem.torus.R,
        r=problem.torus.r,
        options=options,
        progress=progress,
    )
    clock = time.perf_counter()
    if problem.refinement is None:
        x, flips = flip_free.untangle(x, glide=glide)
    else:
        flip_free, refinement, x, flips = untangle_refining(
            flip_free, problem.refinement, x, glide=glide
        )
        solid = refinement.solid
        problem = dataclasses.replace(
            problem, solid=solid, V=flip_free.V, x=x, refinement=refinement
        )
    seconds["untangle"] = time.perf_counter() - clock
    converged, stop_reason = False, f"{flips} tets and faces could not be untangled"
    if flips == 0:
        clock = time.perf_counter()
        goal = options.frozen_weight if glide else options.volume_weight
        if not (problem.warm and glide):
            first = options.volume_weight if problem.warm else 1.0
            x, converged, stop_reason = flip_free.minimize(x, glide=False, start=first, goal=goal)
            seconds["frozen"] = time.perf_counter() - clock
        if glide:
            clock = time.perf_counter()
            first = options.volume_weight if problem.warm else goal
            x, converged, stop_reason = flip_free.minimize(
                x, glide=True, start=first, goal=options.volume_weight
            )
            seconds["glide"] = time.perf_counter() - clock
    exact = False
    if flips == 0:
        clock = time.perf_counter()
        equalized = flip_free.equalize(x, glide=glide)
        if certify(solid, equalized, problem.torus).certified:
            x = equalized
        else:
            _log.warning("volumes along u, v and s left as they were: the boundary would fold")
        seconds["equalize"] = time.perf_counter() - clock
    if flips == 0 and vertex_exact:
        clock = time.perf_counter()
        x, exact, reason = flip_free.make_rings_exact(x)
        seconds["exact"] = time.perf_counter() - clock
        if not exact:
            _log.warning("ring volumes left as they were: %s", reason)
    history += tuple(flip_free.history)
    return problem, SolidRun(x, history, converged, stop_reason, seconds, exact)
