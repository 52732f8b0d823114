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
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._loosen import untangle_refining
from .area import AreaMap
from .certificate import certify
from .errors import ArrayError, DegenerateError
from .flip_free import FlipFreeOptions, FlipFreeSolver
from .progress import Progress
from .refine import Refinement
from .results import IterationRecord
from .torus import Torus
from .vsem import minimise_volumetric_stretch

if TYPE_CHECKING:
    from .mesh import TetMesh

__all__ = ["SolidProblem", "SolidRun", "certified_route", "vsem_route"]

_log = logging.getLogger("stretchmap")

# Before untangling, a few regularised steps (5.6) remove most flips of the harmonic map for little.
_WARM_STEPS, _WARM_C = 3, 10.0


@dataclass(frozen=True)
class SolidProblem:
    """Source and torus on one scale: the polyhedron the boundary image encloses has volume 1."""

    solid: TetMesh
    V: NDArray[np.float64]
    x: NDArray[np.float64]
    torus: Torus
    scale: float  # lengths of the result per length here
    warm: bool  # x is a whole map, not only its boundary
    refinement: Refinement | None  # that made the solid; None: it must not be refined

    @classmethod
    def build(
        cls,
        solid: TetMesh,
        refinement: Refinement | None,
        boundary_map: AreaMap | None,
        start: ArrayLike | None,
        torus: Torus | None,
    ) -> SolidProblem:
        mesh = solid if refinement is None else refinement.solid
        ids = solid.boundary_vertices
        if start is not None:
            assert torus is not None
            image = np.array(start, dtype=np.float64)
            if image.shape != solid.V.shape:
                raise ArrayError(f"start must have shape {solid.V.shape}, got {image.shape}")
            x = image if refinement is None else refinement.prolong(image)
        else:
            assert boundary_map is not None
            torus = boundary_map.torus
            x = np.zeros((mesh.n_vertices, 3))
            x[ids] = boundary_map.image
        enclosed = _enclosed_volume(x[ids], solid.surface.F)
        if not enclosed > 0.0:
            raise DegenerateError("the boundary image encloses no volume; is it inside out?")
        shrink = enclosed ** (-1.0 / 3.0)
        scale = solid.volume ** (1.0 / 3.0)
        V = (mesh.V - mesh.V.mean(axis=0)) / scale
        return cls(mesh, V, x * shrink, torus.scaled(shrink), scale, start is not None, refinement)

    @property
    def fixed(self) -> NDArray[np.uint8]:
        flags = np.zeros(self.solid.n_vertices, np.uint8)
        flags[self.solid.boundary_vertices] = 1
        return flags

    def result_scale(self, x: NDArray[np.float64]) -> float:
        """Factor that gives the image the volume of the source."""
        volume = float(_core.signed_tet_volumes(x, self.solid.T).sum())
        return self.scale * volume ** (-1.0 / 3.0)


def _enclosed_volume(points: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


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
    run = minimise_volumetric_stretch(
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
            x, converged, stop_reason = flip_free.minimise(x, glide=False, start=first, goal=goal)
            seconds["frozen"] = time.perf_counter() - clock
        if glide:
            clock = time.perf_counter()
            first = options.volume_weight if problem.warm else goal
            x, converged, stop_reason = flip_free.minimise(
                x, glide=True, start=first, goal=options.volume_weight
            )
            seconds["glide"] = time.perf_counter() - clock
    exact = False
    if flips == 0:
        clock = time.perf_counter()
        equalised = flip_free.equalise(x, glide=glide)
        if certify(solid, equalised, problem.torus).certified:
            x = equalised
        else:
            _log.warning("volumes along u, v and s left as they were: the boundary would fold")
        seconds["equalise"] = time.perf_counter() - clock
    if flips == 0 and vertex_exact:
        clock = time.perf_counter()
        x, exact, reason = flip_free.make_rings_exact(x)
        seconds["exact"] = time.perf_counter() - clock
        if not exact:
            _log.warning("ring volumes left as they were: %s", reason)
    history += tuple(flip_free.history)
    return problem, SolidRun(x, history, converged, stop_reason, seconds, exact)
