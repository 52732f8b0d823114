"""Ring volumes of interior vertices made exact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import SolverError
from .model import History, SolidModel

__all__ = ["make_rings_exact"]

_STEPS, _EXACT = 10, 1e-10


def make_rings_exact(
    model: SolidModel, x: NDArray[np.float64], history: History, std_factor: float
) -> tuple[NDArray[np.float64], str]:
    """Make the ring volume (6.5) of every interior vertex exact, if that costs little.

    Minimum-norm Newton steps over the interior vertices, the boundary held. Given up, and ``x``
    returned as it was, if a tet would turn over or the SD of the tet ratios would rise by more than
    ``std_factor``.

    Parameters
    ----------
    model : SolidModel
    x : ndarray, shape (n, 3)
        Without inverted tets.
    history : History
        Gets a record per step, of the stage ``"exact"``.
    std_factor : float

    Returns
    -------
    x : ndarray, shape (n, 3)
    reason : str
        Why not; empty if the ring ratios of all interior vertices are 1 to 1e-10.
    """
    fixed = np.zeros(len(model.V), np.uint8)
    fixed[model.boundary] = 1
    volumes = _core.mesh.tet_volumes(x, model.T)
    target = model.rings * volumes.sum()
    before = float((volumes / volumes.sum() / model.shares).std())
    projection = _core.volume.RingProjection(model.T, fixed)
    moved = x
    for iteration in range(1, _STEPS + 1):
        try:
            step = projection.step(moved, target, 1e-4, 2000)
        except SolverError as error:
            return x, str(error)
        moved = step.x
        worst = projection.error(moved, target)
        record = history.add(
            "exact", iteration, moved, energy=worst, step=1.0, residual=step.error, total=_STEPS
        )
        if record.flips:
            return x, f"exact ring volumes would turn {record.flips} tets over"
        if worst < _EXACT:
            break
    else:
        return x, f"the ring volumes are still off by {worst:.1e}"
    if record.element_std > std_factor * before:
        return x, (
            f"exact ring volumes would raise the SD of the tet ratios from {before:.3g} to "
            f"{record.element_std:.3g}"
        )
    return moved, ""
