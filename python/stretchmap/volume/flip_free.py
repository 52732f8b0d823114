"""Flip-free minimisation of volume distortion: untangle, minimise, let the boundary glide.

All stages minimise the energy of ``element_energy.hpp`` by projected Newton steps; they differ in
its weights and in which vertices move. With lambda the weight of the volume term and 1 that of the
shape term, lambda grows by a fixed factor after every step that was not cut short, so shape decides
early and volume late. The recorded energy is the energy divided by lambda: it cannot rise, neither
in a step nor when lambda grows.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress, report
from ..base.torus import Torus
from ..errors import SolverError
from ..maps.history import IterationRecord
from .marginals import Marginals
from .options import FlipFreeOptions

__all__ = ["FlipFreeSolver"]

_FREE, _FIXED, _GLIDING = 0, 1, 2
_PATIENCE = 10  # untangling steps without progress before something else is tried
_RESTARTS = 3  # of the continuation, from a large epsilon
_WIDEST = 1.0  # epsilon: determinants are 1 where all is well, a larger one tells nothing apart
_SETTLED = 0.1  # share of the energy; a step that lowers it by more is not done with its epsilon
_GENTLE = 0.2  # most of its volume that equalising takes from a tet
_NO_FACES = (np.zeros((0, 3), np.int32), np.zeros((0, 4)), np.zeros(0))


@dataclass
class FlipFreeSolver:
    """One solid on its way to a flip-free map.

    Attributes
    ----------
    V : ndarray, shape (n, 3)
        Source positions, scaled to the volume of the image.
    T : ndarray of int32, shape (k, 4)
    boundary : ndarray of int32, shape (nb,)
        Boundary vertices, in the numbering of ``faces``.
    faces : ndarray of int32, shape (m, 3)
        Boundary faces in solid vertex ids.
    R, r : float
        Radii of the torus the boundary image lies on.
    options : FlipFreeOptions
    progress : Progress or None
    history : list of IterationRecord
    """

    V: NDArray[np.float64]
    T: NDArray[np.int32]
    boundary: NDArray[np.int32]
    faces: NDArray[np.int32]
    R: float
    r: float
    options: FlipFreeOptions
    progress: Progress | None = None
    history: list[IterationRecord] = field(default_factory=list)

    def __post_init__(self) -> None:
        volumes = _core.volume.signed_tet_volumes(self.V, self.T)
        self._shares = volumes / volumes.sum()
        self._rings = _core.measures.ring_sums(self.T, self._shares, len(self.V))
        self._rest = _core.volume.rest_matrices(self.V, self.T, self.options.max_aspect)
        self._minimizer: _core.volume.SolidNewton | None = (
            None  # of the last minimise, with its Hessian
        )

    def _newton(self, x: NDArray[np.float64], boundary_motion: int) -> _core.volume.SolidNewton:
        motion = np.full(len(self.V), _FREE, np.uint8)
        motion[self.boundary] = boundary_motion
        faces, face_rest, face_weights = _NO_FACES
        if boundary_motion == _GLIDING:
            faces = self.faces
            corners = self.V[faces]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            areas = 0.5 * np.linalg.norm(normals, axis=1)
            face_weights = areas / areas.sum()
            scale = 4.0 * math.pi**2 * self.R * self.r / areas.sum()
            face_rest = _core.volume.rest_triangles(self.V, faces, scale)
        return _core.volume.SolidNewton(
            self.T, self._rest, self._shares, motion, self.R, self.r, x, faces, face_rest,
            face_weights,
        )  # fmt: skip

    def _record(
        self,
        stage: str,
        iteration: int,
        x: NDArray[np.float64],
        energy: float,
        step: float,
        residual: float,
        clock: float,
        total: int,
    ) -> None:
        volumes = _core.volume.signed_tet_volumes(x, self.T)
        shares = volumes / volumes.sum()
        record = IterationRecord(
            stage=stage,
            iteration=iteration,
            energy=energy,
            step=step,
            residual=residual,
            flips=int(np.count_nonzero(~(volumes > 0.0))),
            ring_std=float(
                (_core.measures.ring_sums(self.T, shares, len(self.V)) / self._rings).std()
            ),
            element_std=float((shares / self._shares).std()),
            seconds=time.perf_counter() - clock,
        )
        self.history.append(record)
        report(
            self.progress,
            stage,
            iteration,
            total,
            flips=record.flips,
            element_std=record.element_std,
        )

    def untangle(
        self, x: NDArray[np.float64], *, glide: bool, few: int = 0
    ) -> tuple[NDArray[np.float64], int]:
        """Turn every inverted tet: foldover-free mapping by continuation.

        First with the boundary held; if ``glide`` and inverted tets or folded boundary faces are
        left, with a gliding boundary. The regularisation epsilon follows the worst determinant down
        (Garanzha et al., 2021, section 3.2); between two steps the energy may rise because epsilon
        changed, within a step it cannot.

        Parameters
        ----------
        x : ndarray, shape (n, 3)
        glide : bool
        few : int
            So many inverted tets are not worth patience: give up on them as soon as the worst of
            them does not get better any more.

        Returns
        -------
        x : ndarray, shape (n, 3)
        flips : int
            Inverted tets, and folded faces if ``glide``, that are left; zero means success.
        """
        x, left = self._untangle(x, glide=False, few=few)
        if glide:
            x, left = self._untangle(x, glide=True, few=few)
        return x, left

    def _untangle(
        self, x: NDArray[np.float64], *, glide: bool, few: int
    ) -> tuple[NDArray[np.float64], int]:
        o = self.options
        face = o.face_weight if glide else 0.0
        newton = self._newton(x, _GLIDING if glide else _FIXED)
        clock = time.perf_counter()
        state = newton.value(x, _core.volume.EnergyWeights(1.0, 1.0, 1.0, face))
        left, worst = state.flips + state.folds, min(state.min_det, state.min_facing)
        fewest, highest, since, restarts = left, worst, 0, 0
        epsilon = first = min(max(0.2 * abs(worst), 10.0 * o.floor), _WIDEST)
        for iteration in range(1, o.untangle_iter + 1):
            if left == 0 and (worst >= o.floor or since >= _PATIENCE):
                break
            if since >= _PATIENCE * (3 if left > few else 1):
                # Stuck with epsilon small: the way out is over a higher pass.
                if not glide or restarts == _RESTARTS:
                    break
                restarts, since, epsilon = restarts + 1, 0, max(first, 0.1)
            weights = _core.volume.EnergyWeights(1.0, 1.0, epsilon, face)
            x, step = newton.step(x, weights, min(o.cg_tol, 1e-2), o.max_cg)
            after = step.after
            self._record(
                "untangle", iteration, x, after.energy, step.alpha, epsilon, clock, o.untangle_iter
            )
            left, worst = after.flips + after.folds, min(after.min_det, after.min_facing)
            # Towards the end epsilon pulls few tets after it, and none of them beyond the floor.
            pulled = left <= few and epsilon > 10.0 * o.floor and worst > 0.9 * highest
            since = 0 if left < fewest or pulled else since + 1
            fewest, highest = min(fewest, left), max(highest, worst) if since == 0 else highest
            if step.before.energy - after.energy <= _SETTLED * (step.before.energy + 2.0):
                epsilon = _next_epsilon(epsilon, worst)
        return x, int(left)

    def minimize(
        self, x: NDArray[np.float64], *, glide: bool, start: float, goal: float
    ) -> tuple[NDArray[np.float64], bool, str]:
        """Newton steps with lambda growing from ``start`` to ``goal``; no tet turns over.

        Returns
        -------
        x : ndarray, shape (n, 3)
        converged : bool
        stop_reason : str
        """
        o = self.options
        stage, total = ("glide", o.glide_iter) if glide else ("frozen", o.frozen_iter)
        face = o.face_weight if glide else 0.0
        newton = self._minimizer = self._newton(x, _GLIDING if glide else _FIXED)
        clock = time.perf_counter()
        weight, kept = start, 0
        for iteration in range(1, total + 1):
            weights = _core.volume.EnergyWeights(1.0, weight, 0.0, face)
            x, step = newton.step(x, weights, o.cg_tol, o.max_cg, kept > 0)
            before, after = step.before.energy / weight, step.after.energy / weight
            self._record(stage, iteration, x, after, step.alpha, step.decrement, clock, total)
            small = before - after <= (o.glide_tol if glide else o.frozen_tol) * before
            if weight < goal:
                if step.alpha >= 0.5:
                    weight = min(goal, o.growth * weight)
                elif step.alpha == 0.0:
                    return x, False, f"no step lowers the energy at lambda = {weight:g}"
            elif goal < o.volume_weight:
                return x, True, "goal reached"  # only a start for the next stage
            elif small and kept == 0:
                return x, True, "the energy stopped decreasing"
            else:
                # At the last weight the Hessian changes little: a few steps share one, as long as
                # it serves. Whether to stop is for a renewed one to say.
                kept = 0 if small or step.alpha < 0.5 else (kept + 1) % o.shared
        return x, False, "most iterations done"

    def equalize(self, x: NDArray[np.float64], *, glide: bool) -> NDArray[np.float64]:
        """Make the volumes between level surfaces of u, v and s those of the source.

        Newton steps at the largest lambda towards the targets of `Marginals`, then its shifts. Both
        leave vertices in place where the volume of a tet would change by more than a fifth: near
        slivers, which nothing smooth can move. The recorded energy is `Marginals.error`.

        Returns
        -------
        ndarray, shape (n, 3)
        """
        o = self.options
        marginals = Marginals(
            self.T, self._shares, self.boundary, Torus(self.R, self.r), held=not glide
        )
        newton = self._minimizer or self._newton(x, _GLIDING if glide else _FIXED)
        self._minimizer = None
        weights = _core.volume.EnergyWeights(
            1.0, o.volume_weight, 0.0, o.face_weight if glide else 0.0
        )
        clock, total = time.perf_counter(), o.target_iter + o.shift_iter
        volumes = _core.volume.signed_tet_volumes(x, self.T)
        measured = marginals.measure(x)
        for iteration in range(total):
            if iteration < o.target_iter:
                if marginals.error(measured) < o.marginal_tol:
                    continue
                newton.set_targets(marginals.targets(measured))
                moved, step = newton.step(x, weights, o.cg_tol, o.max_cg, True)
                alpha, change = step.alpha, step.decrement
            else:
                moved = marginals.shifted(x)
                alpha, change = 1.0, float(np.linalg.norm(moved - x, axis=1).max())
            x = self._gently_moved(x, moved, volumes)
            measured = marginals.measure(x)
            self._record(
                "equalize", iteration + 1, x, marginals.error(measured), alpha, change, clock, total
            )
        return x

    def _gently_moved(
        self, x: NDArray[np.float64], moved: NDArray[np.float64], volumes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """``moved``, but ``x`` at vertices of tets too far from ``volumes``; ``x`` has none."""
        stay = np.zeros(len(x), bool)
        while True:
            ratios = _core.volume.signed_tet_volumes(moved, self.T) / volumes
            harmed = ~((ratios > 1.0 - _GENTLE) & (ratios < 1.0 / (1.0 - _GENTLE)))
            if not harmed.any():
                return moved
            stay[self.T[harmed]] = True
            moved = np.where(stay[:, None], x, moved)

    def make_rings_exact(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], bool, str]:
        """Make the ring volume of every interior vertex exact, if that costs little.

        Minimum-norm Newton steps over the interior vertices, the boundary held. Given up, and ``x``
        returned as it was, if a tet would turn over or the SD of the tet ratios would rise by more
        than ``exact_std_factor``.

        Returns
        -------
        x : ndarray, shape (n, 3)
        exact : bool
            Whether the ring ratios (6.5) of all interior vertices are 1 to 1e-10.
        reason : str
            Why not; empty if exact.
        """
        fixed = np.zeros(len(self.V), np.uint8)
        fixed[self.boundary] = 1
        volumes = _core.volume.signed_tet_volumes(x, self.T)
        target = self._rings * volumes.sum()
        before = float((volumes / volumes.sum() / self._shares).std())
        projection = _core.volume.RingProjection(self.T, fixed)
        clock = time.perf_counter()
        moved = x
        for iteration in range(1, 11):
            try:
                step = projection.step(moved, target, 1e-4, 2000)
            except SolverError as error:
                return x, False, str(error)
            moved = step.x
            worst = projection.error(moved, target)
            self._record("exact", iteration, moved, worst, 1.0, step.error, clock, 10)
            record = self.history[-1]
            if record.flips:
                return x, False, f"exact ring volumes would turn {record.flips} tets over"
            if worst < 1e-10:
                break
        else:
            return x, False, f"the ring volumes are still off by {worst:.1e}"
        if record.element_std > self.options.exact_std_factor * before:
            return (
                x,
                False,
                (
                    f"exact ring volumes would raise the SD of the tet ratios from {before:.3g} to "
                    f"{record.element_std:.3g}"
                ),
            )
        return moved, True, ""


def _next_epsilon(epsilon: float, worst: float) -> float:
    """Regularisation for the next step, from the worst determinant (Garanzha et al., 2021)."""
    chi = 0.5 * (worst + math.sqrt(epsilon * epsilon + worst * worst))
    goal = 0.9 * chi
    return 2.0 * math.sqrt(max(goal * (goal - worst), 1e-24))
