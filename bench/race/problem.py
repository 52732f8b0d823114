"""One problem for all: an energy, a start without folds, which vertices may move, and a clock."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stretchmap as sm

VOLUME_WEIGHT = 10.0


class Stop(Exception):
    """The time is up."""


@dataclass
class Problem:
    """Lower the barrier energy of a solid's map, its boundary held on the torus.

    Attributes
    ----------
    solid : TetMesh
        Of volume one.
    start : ndarray, shape (n, 3)
        Of volume one, without inverted tets.
    energy : DistortionEnergy
        Infinite where a tet is inverted; Hessians are projected.
    free : ndarray of int
        Unknowns of the inner vertices, among the 3 n.
    """

    solid: sm.TetMesh
    start: NDArray[np.float64]
    energy: sm.energies.DistortionEnergy = field(init=False)
    free: NDArray[np.intp] = field(init=False)

    def __post_init__(self) -> None:
        self.energy = sm.energies.DistortionEnergy(self.solid, volume=VOLUME_WEIGHT, projected=True)
        inner = np.setdiff1d(np.arange(self.solid.n_vertices), self.solid.boundary_vertices)
        self.free = (3 * inner[:, None] + np.arange(3)).ravel()

    def image(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """The image whose inner vertices are where the unknowns say."""
        flat = self.start.ravel().copy()
        flat[self.free] = unknowns
        return flat.reshape(-1, 3)

    def gradient(self, image: NDArray[np.float64]) -> NDArray[np.float64]:
        """By the unknowns."""
        return self.energy.gradient(image).ravel()[self.free]


def make_problem(sample: sm.TetMesh) -> tuple[Problem, str]:
    """A problem and what it starts from.

    Barriers cannot start from folds: where the harmonic map has some, a map that keeps shapes as
    well as its boundary lets it is the start.
    """
    solid = sm.TetMesh(sample.V / sample.volume ** (1.0 / 3.0), sample.T)
    found: list[NDArray[np.float64]] = []

    def take(_: Any, image: NDArray[np.float64], __: Any) -> NDArray[np.float64]:
        found.append(image)
        return image

    sm.volume_map(solid, optimizer=take, keep_best=True)
    problem = Problem(solid, found[0])
    if np.isfinite(problem.energy.value(problem.start)):
        return problem, "harmonic start"
    shape = sm.VolumeOptions(volume_weight=0.01, target_iter=0, shift_iter=0)
    image = sm.volume_map(solid, boundary="frozen", options=shape).image
    volume = sm.TetMesh(image, solid.T).volume
    return Problem(solid, image / volume ** (1.0 / 3.0)), "start that keeps shapes"


class Trace:
    """Energy and worst tet against processor time; taking them is not timed."""

    def __init__(self, problem: Problem, limit: float) -> None:
        self.problem, self.limit = problem, limit
        self.rows: list[dict[str, float]] = []
        self._spent = 0.0
        self._begun = time.process_time()

    def add(self, image: NDArray[np.float64]) -> float:
        """Note where a method is; its energy.

        Raises
        ------
        Stop
            It has used up its time.
        """
        self._spent += time.process_time() - self._begun
        parts = self.problem.energy.elements(image, 0).values
        shares = self.problem.solid.tet_volumes / self.problem.solid.volume
        value = float(parts.sum())
        worst = float((parts / shares).max())
        row = {"seconds": round(self._spent, 5), "energy": value, "worst": float(f"{worst:.6g}")}
        self.rows.append(row)
        if self._spent > self.limit:
            raise Stop
        self._begun = time.process_time()
        return value
