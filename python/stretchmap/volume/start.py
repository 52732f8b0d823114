"""Where the optimization starts: a harmonic map, and how large its pieces may get."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .model import face_areas
from .problem import VolumeProblem

__all__ = ["boundary_scale", "started"]

_TOL = 1e-4  # a harmonic map that is only to be improved need not be exact

_EVEN = 0.2  # logarithm: a boundary image whose scale varies less has one scale
_SCALE_TOL = 1e-3
_WARM = 1.0  # with a wider range of scales the steps (5.6) do harm
_WARM_STEPS, _WARM_C, _WARM_TOL = 3, 10.0, 1e-4


def boundary_scale(problem: VolumeProblem) -> NDArray[np.float64]:
    """Logarithm of image length over source length round each boundary vertex: (nb,)."""
    surface = problem.solid.surface
    ids = problem.solid.boundary_vertices
    source, image = (
        np.bincount(surface.F.ravel(), np.repeat(face_areas(at[ids], surface.F), 3), len(ids))
        for at in (problem.V, problem.x)
    )
    scale: NDArray[np.float64] = 0.5 * np.log(np.maximum(image, 1e-300) / source)
    return scale


def _warmed(
    stretch: _core.volume.VolumetricStretch, x: NDArray[np.float64], T: NDArray[np.int32]
) -> NDArray[np.float64]:
    """A few regularized steps (5.6), as long as they leave fewer tets inverted."""

    def inverted(at: NDArray[np.float64]) -> int:
        return int(np.count_nonzero(~(_core.mesh.tet_volumes(at, T) > 0.0)))

    fewest = inverted(x)
    for _ in range(_WARM_STEPS):
        if fewest == 0:
            break
        moved, _ = stretch.step(x, _WARM_C, _WARM_TOL)
        left = inverted(moved)
        if left >= fewest:
            break
        x, fewest = moved, left
    return x


def started(problem: VolumeProblem, *, solver: str, tol: float = _TOL) -> VolumeProblem:
    """Image and scale of the inner vertices: both harmonic, by those of the boundary.

    Parameters
    ----------
    problem : VolumeProblem
        A warm one keeps its image, one that has begun is returned as it is.
    solver : str
    tol : float
        Relative residual asked of the harmonic map.
    """
    if problem.begun:
        return problem
    solid, ids = problem.solid, problem.solid.boundary_vertices
    fixed = np.zeros(solid.n_vertices, np.uint8)
    fixed[ids] = 1
    stretch = _core.volume.VolumetricStretch(
        solid.T, fixed, _core.mesh.tet_volumes(problem.V, solid.T), solver
    )
    x, scale = problem.x, None
    at_boundary = boundary_scale(problem)
    if not problem.warm:
        x, _ = stretch.harmonic(problem.V, x, tol)
        if np.abs(at_boundary).max() <= _WARM:
            x = _warmed(stretch, x, solid.T)
    if np.abs(at_boundary).max() > _EVEN:
        spread = np.zeros_like(problem.V)
        spread[ids, 0] = at_boundary
        scale = np.ascontiguousarray(stretch.harmonic(problem.V, spread, _SCALE_TOL)[0][:, 0])
        # Cotangent weights may be negative, so the spread may overshoot.
        np.clip(scale, at_boundary.min(), at_boundary.max(), out=scale)
    return dataclasses.replace(problem, x=x, scale=scale, begun=True)
