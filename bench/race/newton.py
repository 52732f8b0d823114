"""Projected Newton methods: the library's, and one with a sparse factorization in every step."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from problem import VOLUME_WEIGHT, Problem, Trace
from scipy.sparse.linalg import splu

import stretchmap as sm
from stretchmap import _core

sys.path.append(str(Path(__file__).resolve().parents[1] / "peers"))  # after our own run

import cholmod

SMALL = 1e-10  # decrease of the energy, as a share of it, that counts as none


def ours(problem: Problem, trace: Trace) -> None:
    """Inexact projected Newton steps preconditioned by multigrid, as `volume_map` makes them."""
    solid = problem.solid
    motion = np.zeros(solid.n_vertices, np.uint8)
    motion[solid.boundary_vertices] = 1  # fixed
    rest = _core.volume.rest_matrices(solid.V, solid.T, np.inf)
    shares = solid.tet_volumes / solid.volume
    newton = _core.volume.SolidNewton(
        problem.start, tets=solid.T, rest=rest, weights=shares, motion=motion
    )
    weights = _core.volume.EnergyWeights(1.0, VOLUME_WEIGHT)
    image, energy = problem.start, trace.add(problem.start)
    while True:
        image, _ = newton.step(image, weights)
        before, energy = energy, trace.add(image)
        if before - energy < SMALL * energy:
            return


class HessianPattern:
    """Where the entries of the tets' Hessians go in the lower triangle, found once."""

    def __init__(self, problem: Problem) -> None:
        number = np.full(problem.start.size, -1)
        number[problem.free] = np.arange(len(problem.free))
        unknowns = (3 * problem.solid.T[:, :, None] + np.arange(3)).reshape(-1, 12)
        local = number[unknowns]
        rows = np.broadcast_to(local[:, :, None], (len(local), 12, 12)).ravel()
        columns = np.broadcast_to(local[:, None, :], (len(local), 12, 12)).ravel()
        kept = np.flatnonzero((columns >= 0) & (rows >= columns))
        order = np.lexsort((rows[kept], columns[kept]))
        self._order = kept[order]
        row, column = rows[self._order], columns[self._order]
        self._first = np.flatnonzero(
            np.concatenate([[True], (np.diff(row) != 0) | (np.diff(column) != 0)])
        )
        n = len(problem.free)
        ends = np.searchsorted(column[self._first], np.arange(n + 1))
        self._empty = (row[self._first], ends, (n, n))

    def lower(self, hessians: NDArray[np.float64]) -> sp.csc_matrix:
        """The lower triangle of the sum of (k, 12, 12) Hessians."""
        data = np.add.reduceat(hessians.reshape(-1)[self._order], self._first)
        rows, ends, shape = self._empty
        return sp.csc_matrix((data, rows, ends), shape=shape)


Solve = Callable[[sp.csc_matrix, NDArray[np.float64]], NDArray[np.float64]]


def direct_solver() -> tuple[str, Solve]:
    """CHOLMOD with one symbolic analysis where it is installed, else SuperLU."""
    if cholmod.AVAILABLE:
        factors: list[cholmod.Cholmod] = []

        def by_cholmod(lower: sp.csc_matrix, b: NDArray[np.float64]) -> NDArray[np.float64]:
            if not factors:
                factors.append(cholmod.Cholmod(lower))
            return factors[0].solve(lower.data, b)

        return "CHOLMOD", by_cholmod

    def by_splu(lower: sp.csc_matrix, b: NDArray[np.float64]) -> NDArray[np.float64]:
        full = (lower + sp.tril(lower, -1).T).tocsc()
        solved: NDArray[np.float64] = splu(
            full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        ).solve(b)  # fmt: skip
        return solved

    return "SuperLU", by_splu


def direct(problem: Problem, trace: Trace) -> None:
    """Exact projected Newton steps, cut before a tet turns over, with Armijo's rule."""
    pattern, (_, solve) = HessianPattern(problem), direct_solver()
    image, energy = problem.start, trace.add(problem.start)
    while True:
        found = problem.energy.elements(image, 2)
        assert found.hessians is not None
        gradient = problem.gradient(image)
        step = np.zeros(image.size)
        step[problem.free] = solve(pattern.lower(found.hessians), -gradient)
        slope = float(gradient @ step[problem.free])
        step = step.reshape(-1, 3)
        alpha = min(1.0, 0.9 * sm.energies.longest_step(problem.solid, image, step, limit=2.0))
        while problem.energy.value(image + alpha * step) > energy + 1e-4 * alpha * slope:
            alpha /= 2.0
            if alpha < 1e-12:
                return
        image = image + alpha * step
        before, energy = energy, trace.add(image)
        if before - energy < SMALL * energy:
            return
