"""Volumetric stretch energy minimisation, steps 4 to 12 of Algorithm 5.1."""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress, report
from ..maps.history import IterationRecord
from .options import VolumeOptions
from .problem import Outcome, VolumeProblem

__all__ = ["VsemRun", "minimize_volumetric_stretch", "run_vsem"]

# Relative residuals asked of the linear solves. A step starts where the last ones lead, and what it
# leaves open the next one makes good; the less the last step changed the energy, the more exact the
# next one has to be. After 20 steps the energy agrees to some 1e-7 with that of exact solves.
HARMONIC_TOL = 1e-8
_STEP_SHARE = 1e-5
_STEP_TOL = (1e-9, 1e-6)


def step_tolerance(before: float, energy: float) -> float:
    """Relative residual asked of the next step, the last one having lowered the energy so far."""
    return min(max(_STEP_SHARE * (before - energy) / energy, _STEP_TOL[0]), _STEP_TOL[1])


@dataclass(frozen=True)
class VsemRun:
    """What the iteration leaves behind.

    Attributes
    ----------
    image : ndarray, shape (n, 3)
    history : tuple of IterationRecord
        Record 0 is the harmonic map.
    converged : bool
        Whether a step lowered the energy by no more than the tolerance.
    stop_reason : str
    """

    image: NDArray[np.float64]
    history: tuple[IterationRecord, ...]
    converged: bool
    stop_reason: str


def minimize_volumetric_stretch(
    V: NDArray[np.float64],
    T: NDArray[np.int32],
    fixed: NDArray[np.uint8],
    start: NDArray[np.float64],
    *,
    c: float,
    max_iter: int,
    tol: float,
    harmonic: bool = True,
    solver: str = "auto",
    progress: Progress | None = None,
) -> VsemRun:
    """Run the fixed-point iteration (5.5) with the boundary held.

    Parameters
    ----------
    V : ndarray, shape (n, 3)
        Source positions, scaled so that source and image have about the same volume: only then is
        the ``c`` of (5.6) dimensionless.
    T : ndarray of int32, shape (k, 4)
        Positively oriented tets.
    fixed : ndarray of uint8, shape (n,)
        Non-zero where ``start`` prescribes the image.
    start : ndarray, shape (n, 3)
        The prescribed images; the other rows count only if ``harmonic`` is False.
    c : float
        Regularisation (5.6).
    max_iter : int
        Most fixed-point steps.
    tol : float
        Stop when a step lowers the energy (5.1) by no more than this share of it.
    harmonic : bool
        Start from the harmonic map (step 4) instead of from ``start``.
    solver : str
        Backend of the linear solves.
    progress : Progress, optional

    Returns
    -------
    VsemRun
    """
    clock = time.perf_counter()
    rest = _core.mesh.tet_volumes(V, T)
    rings = _core.measures.ring_sums(T, rest, len(V))
    stretch = _core.volume.VolumetricStretch(T, fixed, rest, solver)
    history: list[IterationRecord] = []

    def record(x: NDArray[np.float64], iteration: int, residual: float) -> float:
        volumes = _core.mesh.tet_volumes(x, T)
        energy = float(_core.volume.tet_stretch_energy(volumes, rest))
        deviations = _core.measures.share_deviations(T, rest, rings, volumes)
        history.append(
            IterationRecord(
                stage="vsem",
                iteration=iteration,
                energy=energy,
                residual=residual,
                flips=int(np.count_nonzero(~(volumes > 0.0))),
                ring_std=deviations.rings,
                element_std=deviations.elements,
                seconds=time.perf_counter() - clock,
            )
        )
        report(progress, "vsem", iteration, max_iter, energy=energy, flips=history[-1].flips)
        return energy

    x = start
    residual = math.nan
    if harmonic:
        x, solved = stretch.harmonic(V, x, HARMONIC_TOL)
        residual = float(max(solved.residual, default=0.0))
    energy = record(x, 0, residual)
    step_tol = step_tolerance(math.inf, energy)
    for iteration in range(1, max_iter + 1):
        moved, solved = stretch.step(x, c, step_tol, follow=True)
        x, before = moved, energy
        energy = record(x, iteration, float(max(solved.residual, default=0.0)))
        if energy > before:
            return VsemRun(x, tuple(history), False, "the energy rose")
        step_tol = step_tolerance(before, energy)
        if before - energy <= tol * energy:
            return VsemRun(x, tuple(history), True, "the energy stopped decreasing")
    return VsemRun(x, tuple(history), False, "most iterations done")


def run_vsem(
    problem: VolumeProblem,
    options: VolumeOptions,
    *,
    c: float,
    max_iter: int | None,
    progress: Progress | None,
) -> Outcome:
    """Algorithm 5.1 on a problem; 20 steps unless told otherwise."""
    clock = time.perf_counter()
    fixed = np.zeros(problem.solid.n_vertices, np.uint8)
    fixed[problem.solid.boundary_vertices] = 1
    run = minimize_volumetric_stretch(
        problem.V, problem.solid.T, fixed, problem.x, c=c,
        max_iter=20 if max_iter is None else max_iter,
        tol=1e-6 if options.tol is None else options.tol,
        harmonic=not problem.warm, solver=options.solver, progress=progress,
    )  # fmt: skip
    return Outcome(
        dataclasses.replace(problem, x=run.image),
        run.history,
        run.converged,
        run.stop_reason,
        {"vsem": time.perf_counter() - clock},
    )
