"""The search for the phase round the tube, and for R / r."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..conformal.torus import conformal_torus

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

Ratio = Literal["conformal", "search"]

_SAMPLE = 6000  # faces that suffice for the search

_PHASES = 36  # first round of the search around the tube
_RATIOS = (1.25, 1.5, 2.0, 2.5, 3.2, 4.0, 6.0, 10.0)  # first round of the search for R / r
_STARTS = 3  # ratios from which the second round begins, besides the conformal one
_FINE, _FINEST = 0.01, 1e-5
_GAIN = 1e-4  # least gain by which steps below the former go on


def search_phase(
    surface: TriMesh,
    turns: NDArray[np.float64],
    aspect: float,
    phase: float | None,
    ratio: Ratio | float,
) -> tuple[float, float, float]:
    """Phase and ratio with the least symmetric Dirichlet energy of the polyhedral image, and it."""
    sample = surface.F[:: -(-len(surface.F) // _SAMPLE)]
    used, inverse = np.unique(sample, return_inverse=True)
    faces = inverse.reshape(sample.shape).astype(np.int32)
    reference = _core.area.SurfaceReference(surface.V[used], faces)
    turns = turns[used]
    phases = np.arange(_PHASES) / _PHASES if phase is None else np.array([float(phase)])
    conformal = conformal_torus(aspect).ratio
    if ratio == "search":
        ratios = np.array([conformal, *_RATIOS])
    else:
        ratios = np.array([conformal if ratio == "conformal" else float(ratio)])
    width = np.array([0.0 if phase is not None else 1.0 / _PHASES, 0.2 * (len(ratios) > 1)])
    # Near a ratio of one the best phase is a narrow one: a ratio is judged by its own best.
    rows = np.array([(p, r) for r in ratios for p in phases])
    energies = _core.area.phase_energies(reference, faces, turns, rows).reshape(len(ratios), -1)
    order = np.argsort(energies.min(axis=1), kind="stable")
    starts = dict.fromkeys([*order[:_STARTS].tolist(), 0])
    found = []
    for k in starts:
        row, energy = rows[k * len(phases) + int(energies[k].argmin())], float(energies[k].min())
        found.append(_refined(reference, faces, turns, row, energy, width))
    best, energy = min(found, key=lambda pair: pair[1])
    return float(best[0] if phase is not None else best[0] % 1.0), float(best[1]), energy


def _refined(
    reference: _core.area.SurfaceReference,
    faces: NDArray[np.int32],
    turns: NDArray[np.float64],
    best: NDArray[np.float64],
    energy: float,
    width: NDArray[np.float64],
) -> tuple[NDArray[np.float64], float]:
    """The best candidate round one, steps halved until they are short and bring nothing."""
    while width.max() > _FINEST:
        width = 0.5 * width
        offsets = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]) * width
        ratios = 1.0 + (best[1] - 1.0) * np.exp(offsets[:, 1])
        candidates = np.unique(np.column_stack([best[0] + offsets[:, 0], ratios]), axis=0)
        energies = _core.area.phase_energies(reference, faces, turns, candidates)
        before, energy = energy, float(energies.min())
        best = candidates[int(energies.argmin())]
        if width.max() <= _FINE and before - energy <= _GAIN * energy:
            break
    return best, energy
