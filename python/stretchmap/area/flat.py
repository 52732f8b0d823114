"""Starts without folded faces, in the flat chart and in angles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import describe
from ..base.torus import TWO_PI
from ..conformal.map import ConformalMap
from ..errors import SolverError

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

_EMBEDDINGS = 6
_LEAST_WEIGHT = 1e-12


def unfolded_turns(surface: TriMesh, conformal: ConformalMap) -> NDArray[np.float64]:
    """The conformal map's turns or, if it has folds, those of a map that has none."""
    chart = _core.area.SurfaceChart(surface.topology, conformal.forms)
    turns, weights = conformal.turns, np.ones(len(surface.edges))
    forms = conformal.forms.astype(float)
    share = surface.face_areas / surface.face_areas.sum()
    edge = surface.topology.edge
    for _ in range(_EMBEDDINGS):
        areas = _core.area.turn_areas(chart, turns)
        if (areas > 0.0).all():
            break
        # Positive weights embed the surface in a flat torus whatever its triangles (Tutte); but a
        # long limb shrinks by a factor with every turn of its girth, until its tip is lost in
        # rounding. Weights that fall where areas fall let it shrink less.
        # Vertex 0 is held: if but small weights joined it to the rest, all else would be rounding.
        held = int(np.argmax(np.bincount(surface.edges.ravel(), np.repeat(weights, 2))))
        swap = np.arange(len(surface.V), dtype=np.int32)
        swap[[0, held]] = held, 0
        turns = _core.forms.harmonic_forms(len(swap), swap[surface.edges], weights, forms)[1][swap]
        ratios = np.maximum(_core.area.turn_areas(chart, turns), 0.0) / share
        stretch = np.bincount(edge, np.repeat(np.sqrt(ratios), 3), len(weights))
        weights = np.maximum(stretch, _LEAST_WEIGHT)
    folded = np.flatnonzero(~(_core.area.turn_areas(chart, turns) > 0.0))
    if len(folded):
        raise SolverError(
            f"{describe('face', folded)} lie so far out on a long, thin limb that a flat map "
            "shrinks them to nothing: cut the limb short or remesh it coarser",
            folded,
        )
    return turns


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
