"""Least volume distortion of a solid whose boundary glides on a mesh.

As in `minimize`, but the energy has kinks at the edges of the mesh. Along smooth axes steps lead
far, until pressure against a sloping face spoils them; along those of the faces they always lead
down, but are cut short by kinks. So the other ones are taken after every short step.
Both nearly flatten single elements on the way: these are opened after each, see `Relaxation`.

Faces of the boundary that all look outward may yet cross each other where the mesh is thin. That is
looked for every few steps, and ends them where they were before.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .glide_relax import Relaxation
from .glide_targets import GlideTargets
from .minimize import IDLE, Minimized, grown
from .model import History, SolidModel

__all__ = ["Glided", "minimize_on_mesh"]

_SHORT = 0.5  # a step that asks for the other axes
_LOOK = 5  # steps between two looks for crossing faces, of which each takes a fifth of a step


@dataclass(frozen=True, eq=False)
class Glided(Minimized):
    """Where the boundary has glided to without crossing itself.

    Attributes
    ----------
    weight : float
        Lambda there.
    crossing : ndarray of intp
        Vertices of faces that cross each other a few steps on; none if it did not end for that.
    """

    weight: float = 0.0
    crossing: NDArray[np.intp] = dataclasses.field(default_factory=lambda: np.empty(0, np.intp))


class _Minimizers:
    """One for either kind of axes, the second made when it is needed."""

    def __init__(self, model: SolidModel, x: NDArray[np.float64]) -> None:
        self.smooth = True
        self._made = {True: model.newton(x, glide=True)}
        self._model, self.asked = model, np.empty(0)

    @property
    def chosen(self) -> _core.volume.SolidNewton:
        return self._made[self.smooth]

    def ask(self, volumes: NDArray[np.float64]) -> None:
        self.asked = volumes
        for newton in self._made.values():
            newton.set_targets(volumes)

    def switch(self, x: NDArray[np.float64]) -> None:
        self.smooth = not self.smooth
        if self.smooth not in self._made:
            model = dataclasses.replace(self._model, smooth_axes=self.smooth)
            self._made[self.smooth] = model.newton(x, glide=True)
            self._made[self.smooth].set_targets(self.asked)


def minimize_on_mesh(
    model: SolidModel,
    x: NDArray[np.float64],
    history: History,
    *,
    start: float,
    targets: GlideTargets,
    crossing: Callable[[NDArray[np.float64]], NDArray[np.intp]],
) -> Glided:
    """Newton steps with lambda growing from ``start`` until volumes are kept as is asked.

    Parameters
    ----------
    model : SolidModel
        With a ``ground``.
    x : ndarray, shape (n, 3)
        Without inverted tets, and folded or crossing boundary faces.
    history : History
        Gets a record per step, of the stage ``"glide"``.
    start : float
    targets : GlideTargets
        May have learned before.
    crossing : callable
        Boundary vertices of faces that cross others.
    """
    o, weight, idle = model.options, start, 0
    minimizers, relaxation = _Minimizers(model, x), Relaxation(model)
    sound, bad, kept = (x, weight), np.empty(0, np.intp), False
    linear = _core.volume.NewtonOptions(tol=o.cg_tol, max_cg=o.max_cg)
    reason, converged = "most iterations done", False
    for iteration in range(1, o.glide_iter + 1):
        if history.budget.spent:
            reason = "the time limit was reached"
            break
        asked = targets.renewed(x)
        if asked is not None:
            minimizers.ask(asked)
        newton = minimizers.chosen
        weights = _core.volume.EnergyWeights(1.0, weight, 0.0, o.face_weight)
        x, step = newton.step(x, weights, linear)
        x = relaxation.relaxed(x, minimizers.asked, weights)
        before, after = step.before.energy / weight, step.after.energy / weight
        history.add(
            "glide", iteration, x, energy=after, step=step.alpha, residual=step.decrement,
            total=o.glide_iter,
        )  # fmt: skip
        kept = model.kept(x)
        if kept:
            reason, converged = "volumes are kept", True
            break
        if iteration % _LOOK == 0:
            bad = crossing(x)
            if len(bad):
                break
            sound = x, weight
        if step.alpha < _SHORT:
            minimizers.switch(x)
        elif weight < o.volume_weight:
            weight = grown(weight, step.alpha, o.growth, o.volume_weight)
        else:
            targets.learn(x)
        # Both kinds of axes have to agree that nothing is to be gained.
        idle = idle + 1 if before - after <= o.glide_tol * before else 0
        if idle >= IDLE or targets.stalled:
            reason, converged = "volumes are kept as far as can be", weight == o.volume_weight
            break
    if not len(bad):
        best = x if kept or targets.best is None else targets.best
        bad = crossing(best)
    if len(bad):
        return Glided(sound[0], False, reason, minimizers.chosen, weight=sound[1], crossing=bad)
    return Glided(best, converged, reason, minimizers.chosen, weight=weight)
