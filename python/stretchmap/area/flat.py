"""Starts without folded faces, in the flat chart and in angles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from .. import _core
from ..base.arrays import describe
from ..base.torus import TWO_PI
from ..conformal.map import ConformalMap
from ..errors import SolverError
from .limbs import spread_limbs

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

_EMBEDDINGS = 6  # with weights that fall where areas fall
_LEAST_BY_AREAS = 1e-12
# Factors by which weights fall from edge to edge outward on what those have lost all the same.
_FALLS = (0.5, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01)
_LEAST_WEIGHT = 1e-250
_LEAST_AREA = 1e-30  # of a face in the chart: rounding moves its corners by 1e-16
_SAFE = 1e-8  # share of its area that a face keeps in a flat map that has not lost it


def unfolded_turns(surface: TriMesh, conformal: ConformalMap) -> NDArray[np.float64]:
    """The conformal map's turns or, if it has folds, those of a map that has none.

    Positive weights embed the surface in a flat torus whatever its triangles (Tutte), but for
    limbs whose tips are lost in rounding. Those are spread, or else weights fall along them, or
    else they are drawn.
    """
    chart = _core.area.SurfaceChart(surface.topology, conformal.forms)
    if (_core.area.turn_areas(chart, conformal.turns) > 0.0).all():
        return conformal.turns
    forms = conformal.forms.astype(float)
    embedded = _embedded(surface, np.ones(len(surface.edges)), forms)

    def lost(turns: NDArray[np.float64]) -> NDArray[np.intp]:
        return np.flatnonzero(~(_core.area.turn_areas(chart, turns) > _LEAST_AREA))

    def spread(*, drawn: bool) -> NDArray[np.float64]:
        turns, before = embedded, None
        while turns is not before and len(lost(turns)):
            before = turns
            turns = spread_limbs(
                surface, chart, turns, forms, conformal.aspect, _LEAST_AREA, drawn=drawn
            )
        return turns

    tried = [embedded, spread(drawn=False)]
    if not len(lost(tried[-1])):
        return tried[-1]
    weighted = _weighted_turns(surface, chart, forms)
    if weighted is not None:
        return weighted
    tried.append(spread(drawn=True))
    # Where none has room to spare, what is not folded, if only just, will do.
    best = max(tried, key=lambda turns: _core.area.turn_areas(chart, turns).min())
    if _core.area.turn_areas(chart, best).min() > 0.0:
        return best
    out = lost(tried[-1])
    raise SolverError(
        f"{describe('face', out)} lie so far out on a long, thin limb that a flat map "
        "shrinks them to nothing: cut the limb short or remesh it coarser",
        out,
    )


def _weighted_turns(
    surface: TriMesh, chart: _core.area.SurfaceChart, forms: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Turns by weights that fall along limbs, None if faces are lost all the same.

    Where weights fall by exp(-a) with every radius outward, sizes fall by
    exp((a - sqrt(a^2 + 4)) / 2) only, nearly exp(-1 / a), instead of by e.
    """
    share = surface.face_areas / surface.face_areas.sum()
    weights, kept = np.ones(len(surface.edges)), None
    areas = np.zeros_like(share)
    for _ in range(_EMBEDDINGS):
        turns = _embedded(surface, weights, forms)
        areas = _core.area.turn_areas(chart, turns)
        if (areas > _LEAST_AREA).all():
            return turns
        kept = areas > _SAFE * share if kept is None else kept
        stretch = np.repeat(np.sqrt(np.maximum(areas, 0.0) / share), 3)
        stretch = np.bincount(surface.topology.edge, stretch, len(weights))
        weights = np.maximum(stretch, _LEAST_BY_AREAS)
    steps = _steps_from(surface, np.unique(surface.F[kept]))
    for fall in _FALLS:
        weights = np.maximum(fall, _LEAST_WEIGHT ** (1.0 / max(steps.max(), 1.0))) ** steps
        turns = _embedded(surface, weights, forms)
        areas = _core.area.turn_areas(chart, turns)
        if (areas > _LEAST_AREA).all():
            return turns
    return None


def _embedded(
    surface: TriMesh, weights: NDArray[np.float64], forms: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Turns (n, 2) of the harmonic map with these weights of edges."""
    # Vertex 0 is held: if but small weights joined it to the rest, all else would be rounding.
    held = int(np.argmax(np.bincount(surface.edges.ravel(), np.repeat(weights, 2))))
    swap = np.arange(len(surface.V), dtype=np.int32)
    swap[[0, held]] = held, 0
    turns: NDArray[np.float64]
    turns = _core.forms.harmonic_forms(len(swap), swap[surface.edges], weights, forms)[1][swap]
    return turns


def _steps_from(surface: TriMesh, vertices: NDArray[np.int32]) -> NDArray[np.float64]:
    """(e,) number of edges between each edge and the nearest of `vertices`."""
    n, (i, j) = len(surface.V), surface.edges.T
    graph = coo_matrix((np.ones(len(i)), (i, j)), (n, n))
    steps = dijkstra(graph, directed=False, indices=vertices, unweighted=True, min_only=True)
    least: NDArray[np.float64] = np.minimum(steps[i], steps[j])
    return least


def start_angles(
    chart: _core.area.SurfaceChart, turns: NDArray[np.float64], phase: float, ratio: float
) -> NDArray[np.float64]:
    """(u, v) in radians from (u, s) in turns, without flipped faces where there are none in (u, s).

    Large faces can turn over when s is bent into v. Then it is bent less: v = s turns none.
    """
    s = TWO_PI * (turns[:, 1] + phase)
    bend = 1.0 / ratio
    while True:
        v = _core.area.angle_from_equal_area(s, bend)
        bent = np.column_stack([turns[:, 0], v / TWO_PI])
        if bend == 0.0 or (_core.area.turn_areas(chart, bent) > 0.0).all():
            return np.column_stack([TWO_PI * turns[:, 0], v])
        bend = 0.8 * bend if bend > 0.01 else 0.0
