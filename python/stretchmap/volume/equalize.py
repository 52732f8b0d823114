"""The last touch: volumes between level surfaces of u, v and s made those of the source."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .marginals import Marginals
from .model import History, SolidModel
from .options import VolumeOptions

__all__ = ["equalize"]

_WORTHWHILE = 0.1  # share of the error a shift has to take away for another to follow
_GENTLE = 0.2  # most of its volume that shifting takes from a tet


def equalize(
    model: SolidModel,
    x: NDArray[np.float64],
    history: History,
    options: VolumeOptions,
    *,
    glide: bool,
    newton: _core.volume.SolidNewton | None,
) -> NDArray[np.float64]:
    """Make the volumes between level surfaces of u, v and s those of the source.

    Newton steps at the largest lambda towards the targets of `Marginals`, then its shifts, as long
    as they help. Shifts leave vertices in place where the volume of a tet would change by more than
    a fifth: near slivers, which nothing smooth can move. Should that fold a boundary face, the
    stage ends with the image before. The recorded energy is `Marginals.error`.

    Parameters
    ----------
    model : SolidModel
        With a torus.
    x : ndarray, shape (n, 3)
        Without inverted tets and folded boundary faces.
    history : History
        Gets a record per step, of the stage ``"equalize"``.
    options : VolumeOptions
    glide : bool
    newton : SolidNewton or None
        The minimizer that found ``x``, if its Hessian is at hand.

    Returns
    -------
    ndarray, shape (n, 3)
        As free of inverted tets and folded faces as ``x``.
    """
    o = options
    assert model.torus is not None
    marginals = Marginals(model.T, model.shares, model.boundary, model.torus, held=not glide)
    newton = newton or model.newton(x, glide=glide)
    weights = _core.volume.EnergyWeights(1.0, o.volume_weight, 0.0, o.face_weight if glide else 0.0)
    linear = _core.volume.NewtonOptions(tol=o.cg_tol, max_cg=o.max_cg, keep_hessian=True)
    total = o.target_iter + o.shift_iter
    measured = marginals.measure(x)
    alike = model.asked_alike(x) if glide else 1.0
    for iteration in range(total):
        if history.budget.spent:
            break
        shifting = iteration >= o.target_iter
        if not shifting:
            if marginals.error(measured) < o.marginal_tol:
                continue
            newton.set_targets(alike * marginals.targets(measured))
            moved, step = newton.step(x, weights, linear)
            alpha, change = step.alpha, step.decrement
        else:
            if iteration == o.target_iter:
                volumes = _core.mesh.tet_volumes(x, model.T)
            moved = gently_moved(model.T, x, marginals.shifted(x), volumes)
            alpha, change = 1.0, float(np.linalg.norm(moved - x, axis=1).max())
        state = newton.value(moved, weights)
        if state.flips or state.folds:
            break
        before, measured = marginals.error(measured), marginals.measure(moved)
        gain = 1.0 - marginals.error(measured) / before if before > 0.0 else 0.0
        if shifting and gain <= 0.0:
            break
        x = moved
        history.add(
            "equalize", iteration + 1, x, energy=marginals.error(measured), step=alpha,
            residual=change, total=total,
        )  # fmt: skip
        if shifting and gain < _WORTHWHILE:
            break
    return x


def gently_moved(
    T: NDArray[np.int32],
    x: NDArray[np.float64],
    moved: NDArray[np.float64],
    volumes: NDArray[np.float64],
) -> NDArray[np.float64]:
    """``moved``, but ``x`` at vertices of tets too far from ``volumes``; ``x`` has none."""
    stay = np.zeros(len(x), bool)
    while True:
        ratios = _core.mesh.tet_volumes(moved, T) / volumes
        harmed = ~((ratios > 1.0 - _GENTLE) & (ratios < 1.0 / (1.0 - _GENTLE)))
        if not harmed.any():
            return moved
        stay[T[harmed]] = True
        moved = np.where(stay[:, None], x, moved)
