"""Methods that ask for gradients only: SciPy's L-BFGS, and L-BFGS of a regularized energy."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import scipy.optimize
from numpy.typing import NDArray
from problem import VOLUME_WEIGHT, Problem, Trace

import stretchmap as sm

PAIRS = 20  # of steps and changes of the gradient that are remembered


def scipy_lbfgs(problem: Problem, trace: Trace) -> None:
    """L-BFGS-B of SciPy in units of the Hessian's diagonal at the start.

    An infinite energy is handed over as twice the last finite one, so that the line search, which
    interpolates, backs off by a factor it would choose itself.
    """
    hessians = problem.energy.elements(problem.start, 2).hessians
    assert hessians is not None
    diagonals = np.einsum("tii->ti", hessians).reshape(-1, 3)
    corners = problem.solid.T.ravel()
    diagonal = np.column_stack(
        [np.bincount(corners, weights, len(problem.start)) for weights in diagonals.T]
    )
    unit = 1.0 / np.sqrt(diagonal.ravel()[problem.free])
    last = trace.add(problem.start)

    def value_and_gradient(y: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        nonlocal last
        image = problem.image(unit * y)
        value = problem.energy.value(image)
        if not np.isfinite(value):
            return 2.0 * last, np.zeros_like(y)
        last = value
        return value, unit * problem.gradient(image)

    scipy.optimize.minimize(
        value_and_gradient, problem.start.ravel()[problem.free] / unit, jac=True,
        method="L-BFGS-B", callback=lambda y: trace.add(problem.image(unit * y)),
        options={"maxcor": PAIRS, "maxiter": 10**6, "maxfun": 10**7, "ftol": 0.0, "gtol": 1e-8},
    )  # fmt: skip


def two_loops(gradient: NDArray[np.float64], pairs: deque[Any]) -> NDArray[np.float64]:
    """Minus the inverse Hessian of L-BFGS times the gradient (Nocedal, Wright, algorithm 7.4)."""
    q, kept = gradient.copy(), []
    for s, y, rho in reversed(pairs):
        a = rho * float(s @ q)
        q -= a * y
        kept.append(a)
    if pairs:
        s, y, _ = pairs[-1]
        q *= float(s @ y) / float(y @ y)
    for (s, y, rho), a in zip(pairs, reversed(kept), strict=True):
        q += (a - rho * float(y @ q)) * s
    return -q


def least_determinant(problem: Problem, image: NDArray[np.float64]) -> float:
    """Of the map's Jacobians."""
    volumes = sm.TetMesh(image, problem.solid.T).tet_volumes
    return float((volumes / problem.solid.tet_volumes).min())


def next_epsilon(epsilon: float, least: float, before: float, after: float) -> float:
    """The regularization of the next round (Garanzha et al., ACM TOG 40(4), 2021, section 2.3)."""
    share = max(0.1, 1.0 - after / before)
    if least > 0.0 and epsilon < 1e-8:
        return 0.0
    chi = 0.5 * (least + np.hypot(epsilon, least))
    mu = (1.0 - share) * chi
    return 2.0 * float(np.sqrt(mu * (mu - least))) if least < mu else 0.0


def lbfgs_round(
    problem: Problem, energy: sm.energies.Energy, x: NDArray[np.float64], trace: Trace, most: int
) -> tuple[NDArray[np.float64], bool]:
    """L-BFGS with backtracking at one regularization; whether it came to rest."""
    pairs: deque[Any] = deque(maxlen=PAIRS)
    image = problem.image(x)
    value, gradient = energy.value(image), energy.gradient(image).ravel()[problem.free]
    for _ in range(most):
        direction = two_loops(gradient, pairs)
        slope = float(gradient @ direction)
        alpha = 1.0 if pairs else min(1.0, 1e-2 / float(np.abs(direction).max()))
        while not energy.value(problem.image(x + alpha * direction)) <= (
            value + 1e-4 * alpha * slope
        ):
            alpha *= 0.5
            if alpha < 1e-14:
                return x, True
        step = alpha * direction
        x = x + step
        image = problem.image(x)
        before, value = value, energy.value(image)
        last, gradient = gradient, energy.gradient(image).ravel()[problem.free]
        change = gradient - last
        if float(step @ change) > 1e-12 * float(step @ step):
            pairs.append((step, change, 1.0 / float(step @ change)))
        trace.add(image)
        if before - value < 1e-11 * value:
            return x, True
    return x, False


def foldover_free(problem: Problem, trace: Trace) -> None:
    """L-BFGS on the regularized energy, round by round less regularized."""
    trace.add(problem.start)
    x = problem.start.ravel()[problem.free]
    epsilon = 1.0
    while True:
        energy = sm.energies.DistortionEnergy(problem.solid, volume=VOLUME_WEIGHT, epsilon=epsilon)
        before = energy.value(problem.image(x))
        x, rested = lbfgs_round(problem, energy, x, trace, 50 if epsilon else 10**6)
        if rested and epsilon == 0.0:
            return
        image = problem.image(x)
        after = energy.value(image)
        epsilon = next_epsilon(epsilon, least_determinant(problem, image), before, after)
