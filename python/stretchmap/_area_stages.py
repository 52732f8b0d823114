"""The stages of `area_map`: stretch energy in the chart, the search, the finishing solve."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import _core
from .conformal import ConformalMap, conformal_torus
from .progress import Progress, report
from .results import IterationRecord
from .torus import TWO_PI

if TYPE_CHECKING:
    from .mesh import TriMesh

# Weights of the finishing energy against which the area term grows.
_SHAPE = 0.1
_CHART = 1.0
_GROWTH = 4.0
_FULL_STEP = 0.5  # a step at least this long lets the area term grow
_STALLED = 3  # steps in a row without any length end the iteration
_RATIO_GOAL = 10.0  # largest |ratio - 1| allowed, in units of tol
_MARGIN = 0.8  # face SD, in units of tol, where the Newton steps end: the rings need some room
_FAIR = 4.0  # from this face SD on, in units of tol, the shape budget counts
_RING_WEIGHT = 1e4  # most weight of the area term in the projection of the rings
_SAMPLE = 6000  # faces that suffice for the search

_PHASES = 36  # first round of the search around the tube
_RATIOS = (1.25, 1.5, 2.0, 2.5, 3.2, 4.0, 6.0, 10.0)  # first round of the search for R / r


def minimise_stretch(
    surface: TriMesh,
    chart: _core.SurfaceChart,
    conformal: ConformalMap,
    max_iter: int,
    progress: Progress | None,
) -> tuple[NDArray[np.float64], list[IterationRecord]]:
    """Steps of (4.5) in the chart until the energy is at its bound or stops falling."""
    start = time.perf_counter()
    turns = conformal.turns
    if (_core.turn_areas(chart, turns) <= 0.0).any():
        # Positive weights embed the surface in a flat torus whatever its triangles (Tutte).
        weights = np.ones(len(surface.edges))
        forms = conformal.forms.astype(float)
        turns = _core.harmonic_forms(len(surface.V), surface.edges, weights, forms)[1]
    sem = _core.SurfaceSem(chart, surface.face_areas, conformal.aspect, turns)
    history: list[IterationRecord] = []
    taken = None
    for iteration in range(max_iter + 1):
        if iteration:
            taken = sem.step()
        figures = sem.figures()
        history.append(
            IterationRecord(
                stage="sem",
                iteration=iteration,
                energy=figures.energy,
                step=math.nan if taken is None else taken.step,
                residual=math.nan if taken is None else taken.residual,
                flips=figures.flips,
                ring_sd=figures.ring_sd,
                element_sd=figures.face_sd,
                seconds=time.perf_counter() - start,
            )
        )
        report(progress, "area", iteration, max_iter, energy=figures.energy, flips=figures.flips)
        if iteration and history[-2].energy - figures.energy <= 1e-4 * figures.energy:
            break
    return sem.turns, history


def search_phase(
    surface: TriMesh,
    turns: NDArray[np.float64],
    aspect: float,
    phase: float | None,
    ratio: str | float,
) -> tuple[float, float]:
    """Phase and ratio with the least symmetric Dirichlet energy of the polyhedral image."""
    sample = surface.F[:: -(-len(surface.F) // _SAMPLE)]
    used, faces = np.unique(sample, return_inverse=True)
    faces = faces.reshape(sample.shape).astype(np.int32)
    reference = _core.SurfaceReference(surface.V[used], faces)
    turns = turns[used]
    phases = np.arange(_PHASES) / _PHASES if phase is None else np.array([float(phase)])
    conformal = conformal_torus(aspect).ratio
    if ratio == "search":
        ratios = np.array([conformal, *_RATIOS])
    else:
        ratios = np.array([conformal if ratio == "conformal" else float(ratio)])
    width = np.array([0.0 if phase is not None else 1.0 / _PHASES, 0.2 * (len(ratios) > 1)])
    candidates = np.array([(p, r) for r in ratios for p in phases])
    best = _best(reference, faces, turns, candidates)
    while width.max() > 0.01:
        width *= 0.5
        offsets = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]) * width
        candidates = np.unique(
            np.column_stack(
                [best[0] + offsets[:, 0], 1.0 + (best[1] - 1.0) * np.exp(offsets[:, 1])]
            ),
            axis=0,
        )
        best = _best(reference, faces, turns, candidates)
    return float(best[0] if phase is not None else best[0] % 1.0), float(best[1])


def _best(
    reference: _core.SurfaceReference,
    faces: NDArray[np.int32],
    turns: NDArray[np.float64],
    candidates: NDArray[np.float64],
) -> NDArray[np.float64]:
    if len(candidates) == 1:
        return candidates[0]
    qualities = _core.phase_qualities(reference, faces, turns, candidates)
    return candidates[int(np.argmin([quality.energy for quality in qualities]))]


def start_angles(
    chart: _core.SurfaceChart, turns: NDArray[np.float64], phase: float, ratio: float
) -> NDArray[np.float64]:
    """(u, v) in radians from (u, s) in turns, without flipped faces where there are none in (u, s).

    Large faces can turn over when s is bent into v. Then it is bent less: v = s turns none.
    """
    s = TWO_PI * (turns[:, 1] + phase)
    bend = 1.0 / ratio
    while True:
        v = _core.angle_from_equal_area(s, bend)
        bent = np.column_stack([turns[:, 0], v / TWO_PI])
        if bend == 0.0 or (_core.turn_areas(chart, bent) > 0.0).all():
            return np.column_stack([TWO_PI * turns[:, 0], v])
        bend = 0.8 * bend if bend > 0.01 else 0.0


def finish_areas(
    newton: _core.SurfaceNewton,
    rings: bool,
    max_iter: int,
    tol: float,
    shape_budget: float,
    progress: Progress | None,
) -> tuple[list[IterationRecord], bool, str]:
    """Newton steps on the polyhedral areas: records, converged, reason."""
    start = time.perf_counter()
    history: list[IterationRecord] = []
    weight, stalled, least = 1.0, 0, math.inf
    taken = None
    reason = "most steps done"
    for iteration in range(max_iter + 1):
        if iteration:
            taken = newton.step(1.0, _SHAPE / weight, _CHART / weight)
            stalled = 0 if taken.step > 0.0 else stalled + 1
            weight *= _GROWTH if taken.step >= _FULL_STEP else 1.0
        figures = newton.figures()
        least = min(least, figures.angle_mean)
        history.append(_record(iteration, taken, figures, start))
        report(progress, "area", iteration, max_iter, face_sd=figures.face_sd)
        if figures.face_sd <= _MARGIN * tol and _within(figures, tol):
            break
        if stalled == _STALLED:
            reason = "no step lowers the energy"
            break
        if figures.face_sd <= _FAIR * tol and figures.angle_mean > shape_budget * least:
            reason = "shape budget spent"
            break
    weight = min(weight, _RING_WEIGHT)
    if rings and newton.project_rings(
        1.0, _SHAPE / weight, _CHART / weight, tol, _RATIO_GOAL * tol
    ):
        history.append(_record(len(history), None, newton.figures(), start))
    figures = newton.figures()
    if _within(figures, tol):
        return history, True, "areas within tol"
    return (
        history,
        False,
        (f"{reason}, face SD {figures.face_sd:.2e}, worst {figures.face_error:.2e}, tol {tol:.2e}"),
    )


def _within(figures: _core.SurfaceFigures, tol: float) -> bool:
    return figures.face_sd <= tol and figures.face_error <= _RATIO_GOAL * tol


def _record(
    iteration: int,
    taken: _core.GlideStep | None,
    figures: _core.SurfaceFigures,
    start: float,
) -> IterationRecord:
    return IterationRecord(
        stage="newton",
        iteration=iteration,
        energy=math.nan if taken is None else taken.after,
        step=math.nan if taken is None else taken.step,
        residual=math.nan if taken is None else taken.decrement,
        flips=figures.flips,
        ring_sd=figures.ring_sd,
        element_sd=figures.face_sd,
        seconds=time.perf_counter() - start,
    )
