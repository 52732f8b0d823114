"""A volume map by an optimizer of the user's own: start, scale and proof are as of all others."""

from __future__ import annotations

import dataclasses
import time
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_reals
from ..base.torus import Torus
from ..errors import ArrayError, OrientationError
from ..mesh.meshes import TetMesh
from .problem import Outcome, VolumeProblem
from .start import started

__all__ = ["Optimizer", "run_optimizer"]

_START_TOL = 1e-8
_ROUNDING = 1e-5  # of float32, a few operations on


class Optimizer(Protocol):
    """What ``volume_map(optimizer=)`` calls.

    Examples
    --------
    >>> import stretchmap as sm
    >>> def nothing(solid, image, torus):
    ...     return image
    >>> solid = sm.samples.solid_torus(600)
    >>> sm.volume_map(solid, optimizer=nothing, keep_best=True).method
    'nothing'
    """

    def __call__(self, solid: TetMesh, image: NDArray[np.float64], torus: Torus, /) -> ArrayLike:
        """Improve an image.

        Parameters
        ----------
        solid : TetMesh
            What is mapped: the input, or its refinement.
        image : ndarray, shape (n, 3)
            Where to start, boundary vertices on the torus; of the volume of the solid.
        torus : Torus

        Returns
        -------
        array_like, shape (n, 3)
            In any size, boundary vertices on the torus of that size; rounding to float32 will do.
        """


def run_optimizer(problem: VolumeProblem, optimizer: Optimizer, *, solver: str) -> Outcome:
    """Have the optimizer improve the harmonic start, or the whole map a warm problem holds.

    Raises
    ------
    ArrayError, NonFiniteError
        It returned something else than an image.
    OrientationError
        The image as a whole has no positive volume.
    """
    torus = problem.torus
    assert torus is not None
    clock = time.perf_counter()
    problem = started(problem, solver=solver, tol=_START_TOL)
    volumes = _core.mesh.tet_volumes(problem.x, problem.solid.T)
    scale = (problem.solid.volume / float(volumes.sum())) ** (1.0 / 3.0)
    begun = time.perf_counter()
    found = optimizer(problem.solid, problem.x * scale, torus.scaled(scale))
    if found is None:
        raise ArrayError("the optimizer returned None, not an image: end it with 'return image'")
    image = as_reals(found, "what the optimizer returned", (problem.solid.n_vertices, 3))
    volume = float(_core.mesh.tet_volumes(np.ascontiguousarray(image), problem.solid.T).sum())
    if not volume > 0.0:
        raise OrientationError("what the optimizer returned is inside out, or has no volume")
    size = (volume / problem.solid.volume) ** (1.0 / 3.0)
    image = _fitted(image, problem.solid.boundary_vertices, torus.scaled(scale), size)
    seconds = {"start": begun - clock, "optimizer": time.perf_counter() - begun}
    return Outcome(
        dataclasses.replace(problem, x=np.ascontiguousarray(image / scale)),
        (), True, "the optimizer returned", seconds,
    )  # fmt: skip


def _fitted(
    image: NDArray[np.float64], rim: NDArray[np.int32], torus: Torus, size: float
) -> NDArray[np.float64]:
    """An image of about this size in that of the torus; on it, if only rounding is between."""
    rho, z = np.hypot(image[rim, 0], image[rim, 1]), image[rim, 2]
    # The torus k times as large goes through a point for two k: (rho - k R)^2 + z^2 = (k r)^2.
    outer = torus.R**2 - torus.r**2
    root = np.sqrt(np.maximum((torus.R * rho) ** 2 - outer * (rho**2 + z**2), 0.0))
    sizes = (torus.R * rho + np.array([[-1.0], [1.0]]) * root) / outer
    nearest = np.where(abs(sizes[0] - size) < abs(sizes[1] - size), sizes[0], sizes[1])
    fitted: NDArray[np.float64] = image / np.median(nearest)
    u, v, s = torus.coordinates(fitted[rim])
    if (abs(s / torus.r - 1.0) > _ROUNDING).any():
        return image
    fitted[rim] = torus.xi(u, v)
    return fitted
