"""Least volume distortion without a fold: Newton steps behind a barrier.

With lambda the weight of the volume term and 1 that of the shape term, lambda grows after every
step that was not cut short to less than half, so shape decides early and volume late. The recorded
energy is the energy divided by lambda: it cannot rise, neither in a step nor when lambda grows, but
where other volumes are asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .glide_relax import Relaxation
from .model import History, SolidModel
from .options import FillOptions, VolumeOptions

__all__ = ["IDLE", "Minimized", "grown", "minimize"]

_SERVED = 0.5  # a shorter step shows that a Hessian is too old
# After a step that was promised much and cut shorter than that, so many more prove nothing: where
# single elements fill the gradient, the solver sees nothing else.
_CUT, _DOUBT = 1e-2, 5
IDLE = 20  # steps in a row that gain next to nothing prove it all the same
# So many steps in a row, none of them short, that gain on average no more than so many times the
# share at which one shows that there is little left, show it, too: what one gains is much or little
# by turns. Where single elements cut steps short, the energy falls as slowly for a hundred of them.
_STEPS, _SLOWLY = 8, 2.0
# So many steps that lower the energy by a smaller share than that are worth less than more vertices
# where volumes are kept badly: the energy falls on for hundreds, and less than those gain at once.
_LATELY, _LITTLE = 10, 0.1
# Times the residual asked for at the last weight, before it: the next weight moves all again.
_ROUGHLY = 2.0
_REST = 1  # steps with a Hessian each after one was too old
# Of the elements' negative eigenvalues at the last weight, where pressures are nearly balanced.
_NEGATIVE = 0.5
_CONVEX = 3  # Hessians without them once a step was short: elements near folding need all they have
# Of the logarithms of uneven volumes: what is left after a step of full length, and the mean at
# which even ones are asked for.
_LEANER, _EVEN = 0.7, 0.1
# Energy of a torus map from which on gains are measured against this, and not against itself: a
# poor map has more to gain, and few steps that gain little tell nothing.
_FAIR = 5e-3
# SD of the tets' ratios with which volumes are right: only tori and the like come so far, and what
# is gained from there on is paid with shapes and with most of the steps.
_RIGHT = 1e-4
_ROUNDING = 1e-14  # of an energy that is 0 where nothing is distorted
_DRIFT = 2e-3  # of the logarithm of what all tets alike are asked for, before it is set anew


@dataclass(frozen=True, eq=False)
class Minimized:
    """Where the minimization ended.

    Attributes
    ----------
    x : ndarray, shape (n, 3)
    converged : bool
    reason : str
    newton : SolidNewton
        The minimizer, with its last Hessian.
    left : bool
        Whether it left off early, as asked.
    """

    x: NDArray[np.float64]
    converged: bool
    reason: str
    newton: _core.volume.SolidNewton
    left: bool = False


@dataclass
class _Sharing:
    """At the last weight the Hessian changes little: a few steps share one, as long as it serves.

    Whether to stop is for a renewed one to say. Negative eigenvalues are left out of the next ones
    where a step is cut short: round elements close to folding they promise what lies far beyond.
    """

    shared: int
    kept: int = 0
    rest: int = 0
    convex: int = 0

    def update(self, alpha: float, small: bool) -> None:
        """After a step of length ``alpha`` at the last weight."""
        if alpha < _SERVED:
            self.convex = _CONVEX
        elif not self.kept:
            self.convex = max(self.convex - 1, 0)
        if self.kept and alpha < _SERVED:
            self.rest = _REST
        elif not self.kept:
            self.rest = max(self.rest - 1, 0)
        renew = small or self.rest or alpha < _SERVED
        self.kept = 0 if renew else (self.kept + 1) % self.shared


class _Asked:
    """Volumes asked of the tets, relative to their shares; in the end even ones.

    Asked for those at once, what a held boundary has squeezed into a hundredth of its volume
    presses so hard that single elements cut all steps short.

    Even ones are those of `SolidModel.asked_alike`.
    """

    def __init__(self, model: SolidModel, first: NDArray[np.float64] | None) -> None:
        self._model, self._logs = model, np.zeros(0)
        self.even, self.volumes = True, np.ones(len(model.T))
        if first is not None:
            self._take(np.log(first), first)

    def follow(self, alpha: float) -> None:
        """After a step of length ``alpha`` from where these were asked for."""
        if 0.0 < alpha < _SERVED:
            return
        logs = self._logs * (_LEANER if alpha >= 1.0 else math.sqrt(_LEANER))
        volumes = np.exp(logs)
        self._take(logs, volumes / (self._model.shares * volumes).sum(), stuck=alpha == 0.0)

    def follow_boundary(self, x: NDArray[np.float64]) -> bool:
        """Whether ``x`` asks for other even ones."""
        alike = self._model.asked_alike(x)
        if abs(math.log(alike / self.volumes[0])) <= _DRIFT:  # even ones are all the same
            return False
        self.volumes = np.full(len(self._model.T), alike)
        return True

    def _take(
        self, logs: NDArray[np.float64], volumes: NDArray[np.float64], *, stuck: bool = False
    ) -> None:
        """Ask for them, or for even ones where they nearly are."""
        self.even = stuck or float((self._model.shares * np.abs(logs)).sum()) < _EVEN
        self._logs = np.zeros(0) if self.even else logs
        self.volumes = np.ones(len(logs)) if self.even else volumes


@dataclass
class _Standstill:
    """Whether a step shows that there is nothing left to gain.

    One that few tets cut short, or from a poor solve, gains little and proves nothing; nor do those
    that follow one that was promised much. Many in a row do.
    """

    doubt: int = 0
    idle: int = 0
    energies: list[float] = field(default_factory=list)  # before the last steps, none short
    lately: list[float] = field(default_factory=list)  # after the last steps

    def shown(self, step: _core.volume.NewtonReport, enough: float) -> bool:
        """Of a step of which a gain of ``enough`` would be worth while."""
        predicted = 0.5 * step.decrement
        if step.alpha < _CUT and predicted > enough:
            self.doubt = _DOUBT
        else:
            self.doubt = max(self.doubt - 1, 0)
        small = max(step.before.energy - step.after.energy, predicted) <= enough
        self.idle = self.idle + 1 if small else 0
        proved = not (step.negative_curvature or self.doubt)
        return small and (proved or self.idle >= IDLE)

    def slow(self, alpha: float, before: float, after: float, share: float, most: float) -> bool:
        """Whether the last steps lowered the energy, or ``most``, by so small a share.

        To be told of all steps with the same weights.
        """
        self.energies = [*self.energies[1 - _STEPS :], before] if alpha >= _SERVED else []
        enough = _STEPS * _SLOWLY * share * min(after, most)
        return len(self.energies) == _STEPS and self.energies[0] - after <= enough

    def little(self, after: float) -> bool:
        """Whether the last steps, short ones among them, lowered the energy by but a small share.

        To be told of all steps with the same weights.
        """
        self.lately = [*self.lately[-_LATELY:], after]
        return len(self.lately) > _LATELY and after > (1.0 - _LITTLE) * self.lately[0]


def grown(weight: float, alpha: float, growth: float, goal: float) -> float:
    """Lambda after a step of length ``alpha``; slower where single tets cut steps short: what is
    left to shape then is lost."""
    return min(goal, (growth if alpha >= 1.0 else math.sqrt(growth)) * weight)


def minimize(
    model: SolidModel,
    x: NDArray[np.float64],
    history: History,
    *,
    glide: bool,
    start: float,
    goal: float,
    free: tuple[float, float] = (1.0, 1.0),
    asked: NDArray[np.float64] | None = None,
    leave: Callable[[NDArray[np.float64]], bool] | None = None,
) -> Minimized:
    """Newton steps with lambda growing from ``start`` to ``goal``; no tet turns over.

    Parameters
    ----------
    model : SolidModel
    x : ndarray, shape (n, 3)
        Without inverted tets and, if ``glide``, folded boundary faces.
    history : History
        Gets a record per step, of the stage ``"glide"`` or ``"frozen"``.
    glide : bool
        Whether boundary vertices move on the torus.
    start, goal : float
    free : (float, float)
        Ratios of volumes, relative to what is asked for, that cost nothing. Before every step each
        tet is asked for the volume between them closest to its own, which lowers the energy.
    asked : ndarray, shape (k,), optional
        If ``glide``: volumes relative to the tets' shares that are asked for to begin with. Before
        lambda grows they become even, a little after each step that was not cut short.
    leave : callable, optional
        Whether to leave off from there, asked once at the last weight, when steps gain little.
    """
    o = model.options
    stage, total, tolerance, face = (
        ("glide", o.glide_iter, o.glide_tol, o.face_weight)
        if glide
        else ("frozen", o.frozen_iter, o.frozen_tol, 0.0)
    )
    volumes_alone = o.volume_weight >= FillOptions.volume_weight
    fair = _FAIR if glide and volumes_alone else math.inf
    to_be_right = volumes_alone and isinstance(o, VolumeOptions) and o.tol is None
    to_be_right = to_be_right and model.torus is not None and free == (1.0, 1.0)
    newton = model.newton(x, glide=glide)
    volumes = _Asked(model, asked if glide else None)
    asked = None  # they take memory
    goals = volumes.volumes if glide else model.targets
    if not (glide and volumes.even):
        newton.set_targets(goals)
    weight, sharing, standstill = start, _Sharing(o.shared), _Standstill()
    relaxation = Relaxation(model) if glide else None
    for iteration in range(1, total + 1):
        if to_be_right and history.right(_RIGHT):
            return Minimized(x, True, "volumes are right", newton)
        if history.budget.spent:
            return Minimized(x, False, "the time limit was reached", newton)
        weights = _core.volume.EnergyWeights(1.0, weight, 0.0, face)
        linear = _core.volume.NewtonOptions(
            tol=o.cg_tol if weight >= goal else _ROUGHLY * o.cg_tol,
            max_cg=o.max_cg,
            keep_hessian=sharing.kept > 0,
            negative=_NEGATIVE if weight >= o.volume_weight and not sharing.convex else 0.0,
        )
        if glide and volumes.even and weight >= goal and volumes.follow_boundary(x):
            goals = volumes.volumes
            newton.set_targets(goals)
        if free != (1.0, 1.0):
            ratios = _core.mesh.tet_volumes(x, model.T) / _core.mesh.tet_volumes(model.V, model.T)
            wanted = volumes.volumes if glide else model.targets
            goals = wanted * np.clip(ratios / wanted, *free)
            newton.set_targets(goals)
        x, step = newton.step(x, weights, linear)
        if relaxation is not None and step.alpha < _SERVED:
            x = relaxation.relaxed(x, goals, weights, step.held_up)
        before, after = step.before.energy / weight, step.after.energy / weight
        history.add(
            stage, iteration, x, energy=after, step=step.alpha, residual=step.decrement, total=total
        )
        if not volumes.even:
            volumes.follow(step.alpha)
            goals = volumes.volumes
            newton.set_targets(goals)
            continue
        if leave and weight >= o.volume_weight and standstill.little(after):
            if leave(x):
                return Minimized(x, False, "more vertices would gain more", newton, left=True)
            leave = None
        small = standstill.shown(step, weight * tolerance * min(before, fair))
        if glide and volumes_alone and weight >= o.volume_weight:
            small = standstill.slow(step.alpha, before, after, tolerance, fair) or small
        if not glide and goal < o.volume_weight and step.alpha >= 1.0:
            return Minimized(x, True, "whole steps lead on", newton)  # a start for the next stage
        if weight < goal:
            if step.alpha >= _SERVED:
                weight = grown(weight, step.alpha, o.growth, goal)
            elif step.alpha == 0.0:
                if 0.5 * step.decrement <= _ROUNDING * weight:
                    return Minimized(x, True, "the energy is at its least", newton)
                return Minimized(
                    x, False, f"no step lowers the energy at lambda = {weight:g}", newton
                )
        elif goal < o.volume_weight:
            return Minimized(x, True, "goal reached", newton)  # only a start for the next stage
        elif small and sharing.kept == 0:
            return Minimized(x, True, "the energy stopped decreasing", newton)
        else:
            sharing.update(step.alpha, small)
    return Minimized(x, False, "most iterations done", newton)
