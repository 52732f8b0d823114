"""Area-preserving map of a genus-one surface onto a torus of revolution, Algorithm 4.1."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arrays import read_only
from .conformal import ConformalMap, conformal_map, conformal_torus
from .errors import OptionError
from .measures import Distortion, distortion
from .progress import Progress, report
from .results import IterationRecord, MapResult
from .torus import TWO_PI, Torus

if TYPE_CHECKING:
    from .homology import HomologyBasis
    from .mesh import TriMesh

__all__ = ["AreaMap", "area_map"]

_log = logging.getLogger("stretchmap")

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


@dataclass(frozen=True, eq=False)
class AreaMap(MapResult):
    """An area-preserving map onto a torus of revolution.

    Attributes
    ----------
    surface : TriMesh
        The source.
    angles : ndarray, shape (n, 2)
        Angles (u, v) of the image in radians, not reduced to one turn: ``2 pi forms + d angles`` is
        the change along an edge. They do not depend on the size of the torus.
    image : ndarray, shape (n, 3)
        Points on ``torus``.
    torus : Torus
        Torus with the surface's area and the ratio of radii in ``ratio``.
    phase : float
        Turns of the equal-area coordinate around the tube that were added to the conformal map's.
    ratio : float
        ``R / r`` of the torus.
    forms : ndarray, shape (2, e), int32
        Integer closed 1-forms of u and v, as in `ConformalMap`.
    history : tuple of IterationRecord
        One record per iteration: stage ``"sem"`` measured in the equal-area chart, its energy E_S
        (4.1) of shares, at least 1; stage ``"newton"`` on the polyhedral image, its energy that of
        the finishing solve over the weight of its area term. Within a stage the energy never rises.
    distortion : Distortion
        Of the polyhedral image; a face is flipped where it is negative in the (u, v) chart.
    converged : bool
    stop_reason : str
    seconds : dict
        Wall-clock time per stage.
    """

    title = "area"

    surface: TriMesh
    angles: NDArray[np.float64]
    image: NDArray[np.float64]
    torus: Torus
    phase: float
    ratio: float
    forms: NDArray[np.int32] = field(repr=False)
    history: tuple[IterationRecord, ...] = field(repr=False)
    distortion: Distortion
    converged: bool
    stop_reason: str
    seconds: Mapping[str, float]

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """``angles`` (n, 2) and ``forms`` (2, e)."""
        return {"angles": self.angles, "forms": self.forms}

    def extra_scalars(self) -> dict[str, Any]:
        """``phase`` and ``ratio``."""
        return {"phase": self.phase, "ratio": self.ratio}

    def image_on(self, torus: Torus) -> NDArray[np.float64]:
        """The same map on a torus of another size, (n, 3).

        Raises
        ------
        OptionError
            If the torus has another ratio of radii: the map would not preserve areas there.
        """
        if not math.isclose(torus.ratio, self.ratio, rel_tol=1e-9):
            raise OptionError(f"the map is for R / r = {self.ratio}, the torus has {torus.ratio}")
        return torus.xi(self.angles[:, 0], self.angles[:, 1])


def area_map(
    surface: TriMesh,
    *,
    basis: HomologyBasis | None = None,
    conformal: ConformalMap | None = None,
    torus: Torus | None = None,
    phase: float | None = None,
    ratio: str | float = "conformal",
    finish: str = "ring",
    max_iter: int = 30,
    tol: float = 5e-3,
    shape_budget: float = 1.2,
    sem_iter: int = 10,
    progress: Progress | None = None,
) -> AreaMap:
    """Map a genus-one surface onto a torus of revolution so that areas are preserved.

    Stretch energy minimisation (Algorithm 4.1) in the equal-area chart of the torus; the phase
    around the tube by a search; then Newton steps on the areas of the polyhedral image, vertices
    gliding on the torus, no face ever turned over.

    Parameters
    ----------
    surface : TriMesh
        Closed surface of genus one.
    basis : HomologyBasis, optional
        From `homology_basis`; computed if left out.
    conformal : ConformalMap, optional
        From `conformal_map`; computed if left out.
    torus : Torus, optional
        Torus to map onto, with its size and ratio of radii. Left out, it has the surface's area.
    phase : float, optional
        Turns to add to the equal-area coordinate around the tube; searched if left out.
    ratio : "conformal", "search" or float
        ``R / r``: that of the conformal map, the best found by a search, or given (above 1). Not
        together with ``torus``.
    finish : "ring", "face" or "none"
        ``"face"``: Newton steps on the face areas of the polyhedral image. ``"ring"``: then a
        projection that makes the area of every vertex ring exact, kept if the faces stay within
        ``tol`` or do not get worse. ``"none"``: the chart's map as it is.
    max_iter : int
        Most Newton steps.
    tol : float
        Goal for the standard deviation of the face ratios; none is to be off by more than 10 times
        that.
    shape_budget : float
        Once the face SD is below 4 ``tol``, the Newton steps end where the mean angle distortion
        exceeds the least seen by this factor: on regular triangulations the last per cent of area
        is paid for with needles.
    sem_iter : int
        Most steps of stretch energy minimisation.
    progress : Progress, optional
        Called once per step.

    Returns
    -------
    AreaMap
        ``converged`` is False, and a warning logged, if ``tol`` was not reached.

    Raises
    ------
    OptionError
        An option out of range.
    SolverError
        No start without flipped faces was found; ``ids`` are the faces.
    GenusError, MeshError
        As `conformal_map`.

    Notes
    -----
    The finishing solve minimises, over the angles of all vertices,
    ``sum |t| [rho + 1/rho - 2 + (shape Q + chart (sigma + 1/sigma - 2)) / weight]``: rho a face's
    area ratio in space, Q = (s1/s2 + s2/s1)/2 - 1 its angle distortion, sigma its area ratio in the
    chart, which is infinite before a face turns over. The weight grows from step to step.
    """
    _check_options(torus, phase, ratio, finish)
    _check_numbers(max_iter, tol, shape_budget, sem_iter)
    clock = time.perf_counter()
    seconds: dict[str, float] = {}
    if conformal is None:
        conformal = conformal_map(surface, basis)
    clock = _lap(seconds, "conformal", clock)

    chart = _core.SurfaceChart(surface.topology, conformal.forms)
    turns, history = _minimise_stretch(surface, chart, conformal, sem_iter, progress)
    clock = _lap(seconds, "sem", clock)

    wanted = ratio if torus is None else torus.ratio
    phase, ratio = _search(surface, turns, conformal.aspect, phase, wanted)
    angles = _angles(chart, turns, phase, ratio)
    clock = _lap(seconds, "phase", clock)

    records, converged, reason = [], True, "stretch energy at rest"
    if finish != "none":
        problem = _core.GlideProblem(chart, _core.SurfaceReference(surface.V, surface.F), ratio)
        newton = _core.SurfaceNewton(problem, angles)
        records, converged, reason = _finish(
            newton, finish == "ring", max_iter, tol, shape_budget, progress
        )
        angles = newton.angles
    history += records
    _lap(seconds, "finish", clock)

    if torus is None:
        torus = Torus.from_ratio(ratio, area=surface.area)
    image = torus.xi(angles[:, 0], angles[:, 1])
    if not converged:
        _log.warning("area map: %s", reason)
    return AreaMap(
        surface=surface,
        angles=read_only(angles),
        image=read_only(image),
        torus=torus,
        phase=phase,
        ratio=ratio,
        forms=conformal.forms,
        history=tuple(history),
        distortion=distortion(surface, image, angles=angles),
        converged=converged,
        stop_reason=reason,
        seconds=seconds,
    )


def _check_options(
    torus: Torus | None, phase: float | None, ratio: str | float, finish: str
) -> None:
    if phase is not None and not math.isfinite(phase):
        raise OptionError(f"phase must be finite, got {phase}")
    if torus is not None and ratio != "conformal":
        raise OptionError("give the torus or the ratio of its radii, not both")
    if isinstance(ratio, str):
        if ratio not in ("conformal", "search"):
            raise OptionError(f"ratio must be 'conformal', 'search' or a number, got {ratio!r}")
    elif not (math.isfinite(ratio) and ratio > 1.0):
        raise OptionError(f"ratio R / r must be above 1 and finite, got {ratio}")
    if finish not in ("ring", "face", "none"):
        raise OptionError(f"finish must be 'ring', 'face' or 'none', got {finish!r}")


def _check_numbers(max_iter: int, tol: float, shape_budget: float, sem_iter: int) -> None:
    if not (math.isfinite(tol) and tol > 0.0):
        raise OptionError(f"tol must be positive, got {tol}")
    if not shape_budget >= 1.0:
        raise OptionError(f"shape_budget must be at least 1, got {shape_budget}")
    for name, value in (("max_iter", max_iter), ("sem_iter", sem_iter)):
        if value < 0:
            raise OptionError(f"{name} must not be negative, got {value}")


def _lap(seconds: dict[str, float], stage: str, start: float) -> float:
    now = time.perf_counter()
    seconds[stage] = now - start
    return now


def _minimise_stretch(
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


def _search(
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


def _angles(
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


def _finish(
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
