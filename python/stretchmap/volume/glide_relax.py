"""Opening single tets and boundary faces that steps of the whole solid have nearly flattened.

Close to folding the barrier is so steep that one Newton step opens an element by half of what it
has only, that its gradient hides all others from the linear solver, and that it cuts short the
steps of the whole solid. So where elements are about to fold, their surroundings are relaxed first,
all else held, at no cost to speak of: nonlinear elimination (Lanzkron, Rose, Wilkes, SIAM J. Sci.
Comput. 17(2), 1996). Likewise round a handful of elements, however far from folding, for whose sake
all others take but a quarter of a step.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .model import GLIDING, SolidModel
from .untangle import Patch, patches_round

__all__ = ["Relaxation"]

_NEAR = 0.3  # to folding: determinants, 1 being what is asked for, and facings
_NEAR_ON_TORUS = 0.1  # where a map that begins with shapes has many small volumes
_RINGS = 2  # that move
_STEPS = 40  # at most: a determinant of 1e-6 grows by half in each
_SHORT = 0.5  # a step after which the other axes are taken
_LEAST_STEPS = 4  # round elements that hold up others, which need not be near to folding
_IDLE, _GAIN = 2, 0.05  # steps in a row that lower the energy by no more than this share
_MOST = 0.02  # of the tets: more are a matter of the whole
# Of the tets, and of the faces: on the torus, those at most. Patches round more of them unite, and
# relaxing them costs several steps of the whole solid.
_WORST = 0.0002


class Relaxation:
    """Lowers the energy round elements that are about to fold.

    Parameters
    ----------
    model : SolidModel
    """

    def __init__(self, model: SolidModel) -> None:
        self._model, self._near, self._axes = model, _NEAR_ON_TORUS, [model]
        if model.ground is not None:
            other = dataclasses.replace(model, smooth_axes=not model.smooth_axes)
            # Along smooth axes first, see `glide_minimize`.
            self._axes = [model, other] if model.smooth_axes else [other, model]
            self._near = _NEAR
        rows = model.gliding_faces
        self._faces, self._barrier = model.faces[rows], model.gliding(model.faces[rows])

    def relaxed(
        self,
        x: NDArray[np.float64],
        asked: NDArray[np.float64],
        weights: _core.volume.EnergyWeights,
        held_up: _core.volume.HeldUp | None = None,
    ) -> NDArray[np.float64]:
        """Lower the energy round elements that are about to fold, or hold up all others.

        Parameters
        ----------
        x : ndarray, shape (n, 3)
            Without inverted tets and folded boundary faces.
        asked : ndarray, shape (k,)
            Volume asked of each tet, relative to its share.
        weights : EnergyWeights
        held_up : HeldUp, optional
            Elements that cut the last step short. If there are any, they are seen to and no others.

        Returns
        -------
        ndarray, shape (n, 3)
            ``x`` itself if there are none, or too many.
        """
        model = self._model
        poor, least = self._tets_at(held_up), _LEAST_STEPS
        if not len(poor):
            poor, least = self._poor_tets(x, asked), 1
        if not 0 < len(poor) <= _MOST * len(model.T):
            return x
        x = x.copy()
        for patch in patches_round(model, poor, _RINGS, glide=True):
            x[patch.vertices] = self._relaxed_patch(x, asked, weights, patch, least)
        return x

    def _tets_at(self, elements: _core.volume.HeldUp | None) -> NDArray[np.intp]:
        """Some tets, and those at some faces."""
        if elements is None:
            return np.empty(0, np.intp)
        found = self._behind(self._faces[elements.faces])
        found[elements.tets] = True
        return np.flatnonzero(found)

    def _behind(self, faces: NDArray[np.int32]) -> NDArray[np.bool_]:
        """(k,) whether three vertices of a tet are corners of these boundary faces."""
        if not len(faces):
            return np.zeros(len(self._model.T), bool)
        touched = np.zeros(len(self._model.V), bool)
        touched[faces] = True
        behind: NDArray[np.bool_] = touched[self._model.T].sum(axis=1) == 3
        return behind

    def _poor_tets(self, x: NDArray[np.float64], asked: NDArray[np.float64]) -> NDArray[np.intp]:
        """Tets that are nearly flat, or lie at a face that is nearly folded."""
        model = self._model
        flat = self._near_folding(_core.mesh.tet_volumes(x, model.T) / (model.shares * asked))
        flat |= self._behind(self._faces[self._near_folding(self._barrier.facing(x))])
        return np.flatnonzero(flat)

    def _near_folding(self, measures: NDArray[np.float64]) -> NDArray[np.bool_]:
        near: NDArray[np.bool_] = measures < self._near
        most = max(int(_WORST * len(measures)), 1)
        if self._model.ground is None and near.sum() > most:
            near = np.zeros(len(measures), bool)
            near[np.argpartition(measures, most)[:most]] = True
        return near

    def _relaxed_patch(
        self,
        x: NDArray[np.float64],
        asked: NDArray[np.float64],
        weights: _core.volume.EnergyWeights,
        patch: Patch,
        least: int,
    ) -> NDArray[np.float64]:
        """Positions of the vertices of a patch, all others held.

        After so many steps at least, unless they gain too little.
        """
        at = np.ascontiguousarray(x[patch.vertices])
        minimizers = self._minimizers(at, asked[patch.tets], patch)
        linear = _core.volume.NewtonOptions(tol=1e-2, max_cg=self._model.options.max_cg)
        turn = idle = 0
        for done in range(1, _STEPS + 1):
            at, step = minimizers[turn % len(minimizers)].step(at, weights, linear)
            after = step.after
            gain = step.before.energy - after.energy
            idle = idle + 1 if gain <= _GAIN * step.before.energy else 0
            clear = min(after.min_det, after.min_facing) > self._near
            if idle >= _IDLE or (clear and done >= least):
                break
            turn += step.alpha < _SHORT
        return at

    def _minimizers(
        self, at: NDArray[np.float64], asked: NDArray[np.float64], patch: Patch
    ) -> list[_core.volume.SolidNewton]:
        """Of a patch, for either kind of axes."""
        model = self._model
        number = np.full(len(model.V), -1, np.int32)
        number[patch.vertices] = np.arange(len(patch.vertices))
        moving = np.zeros(len(model.V), bool)
        moving[patch.vertices] = patch.motion == GLIDING
        faces = self._faces[moving[self._faces].any(axis=1)]
        made = []
        for axes in self._axes if len(faces) else self._axes[:1]:
            newton = _core.volume.SolidNewton(
                at,
                tets=np.ascontiguousarray(number[model.T[patch.tets]]),
                rest=model.rest(patch.tets),
                weights=np.ascontiguousarray(model.weights[patch.tets]),
                motion=patch.motion.astype(np.uint8),
                boundary=axes.gliding(faces, number) if len(faces) else None,
            )
            newton.set_targets(asked)
            made.append(newton)
        return made
