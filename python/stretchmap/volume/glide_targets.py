"""What is asked of each tet's volume while the boundary glides on a mesh.

However large its weight, a penalty leaves what something holds against it: shape, and the edges of
the mesh, over which vertices under pressure do not slip. So what is missing is asked for on top, by
the method of multipliers (Hestenes, J. Optim. Theory Appl. 4, 1969; Powell, in Optimization, ed.
Fletcher, 1969) with one for the volume round each vertex.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .model import SolidModel

__all__ = ["GlideTargets"]

_DRIFT = 1e-4  # of the volume enclosed, before targets are set anew
_SHARE = 0.5  # of what is missing round a vertex that is asked for on top, each time
_MOST = math.log(3.0)  # of all that was: what cannot be had is not asked for forever
_GAIN = 0.01  # of the misfit, that counts as one
_PATIENCE = 30  # times without


class GlideTargets:
    """Volumes asked for, and how nearly they were had.

    Parameters
    ----------
    model : SolidModel
        With a ``ground``.

    Attributes
    ----------
    best : ndarray, shape (n, 3), or None
        Where volumes were kept best since `learn` was first called.
    stalled : bool
        Whether `learn` has been called many times since they were.
    """

    def __init__(self, model: SolidModel) -> None:
        self.best: NDArray[np.float64] | None = None
        self._model = model
        self._logs = np.zeros(len(model.V))  # of what is asked on top, round each vertex
        self._enclosed, self._stale = 0.0, True
        self._least, self._since = math.inf, 0

    @property
    def stalled(self) -> bool:
        return self._since >= _PATIENCE

    def renewed(self, x: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Volume to ask of each tet, relative to its share: (k,); None: as last time."""
        model = self._model
        enclosed = float(_core.mesh.tet_volumes(x, model.T).sum())
        if not self._stale and abs(enclosed - self._enclosed) <= _DRIFT:
            return None
        self._enclosed, self._stale = enclosed, False
        more = np.exp(self._logs[model.T].mean(axis=1))
        more /= (model.shares * more).sum()
        asked: NDArray[np.float64] = model.inflating(enclosed) * more
        return asked

    def forget_best(self) -> None:
        """Where volumes were kept best is of no use; what was learned there is."""
        self.best, self._least, self._since, self._stale = None, math.inf, 0, True

    def learn(self, x: NDArray[np.float64]) -> None:
        """Ask for more where there is too little at ``x``, and for less where there is too much."""
        ratios = self._model.ring_ratios(x)
        logs = self._logs - _SHARE * np.log(ratios)
        self._logs, self._stale = np.clip(logs, -_MOST, _MOST), True
        spread, moved = self._model.misfit(x)
        if spread + moved < (1.0 - _GAIN) * self._least:
            self._least, self._since, self.best = spread + moved, 0, x
        else:
            self._since += 1
