"""How fast epsilon follows the worst determinant down."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stretchmap.volume.budget import Budget
from stretchmap.volume.untangle import _continue


class Dragging:
    """A minimizer whose whole steps leave a few tets inverted and no energy to gain."""

    def __init__(self, left: int, alpha: float) -> None:
        self.left, self.alpha = left, alpha
        self.epsilons: list[float] = []

    def value(self, _x, _weights):
        return SimpleNamespace(energy=1.0, flips=self.left, folds=0, min_det=-0.01, min_facing=1.0)

    def step(self, x, weights, _linear):
        self.epsilons.append(weights.epsilon)
        here = self.value(x, weights)
        return x, SimpleNamespace(before=here, after=here, alpha=self.alpha)


def paces(left: int, alpha: float = 1.0, face: float = 0.0) -> np.ndarray:
    """Of the regularized worst determinant, by which it is to fall in each of ten steps."""
    newton = Dragging(left, alpha)
    _continue(
        newton, np.zeros((1, 3)), face=face, floor=0.02, steps=10,
        enough=lambda _left, _since: False, linear=None, budget=Budget(60.0),
    )  # fmt: skip
    chi = 0.5 * (-0.01 + np.sqrt(np.square(newton.epsilons) + 1e-4))
    return chi[1:] / chi[:-1]


def test_what_drags_on_with_few_tets_left_is_hurried():
    found = paces(3)
    assert found[:1] == pytest.approx(0.9) and found[2:] == pytest.approx(0.7)


@pytest.mark.parametrize(
    "given", [{"left": 500}, {"left": 3, "alpha": 0.5}, {"left": 3, "face": 1.0}]
)
def test_all_else_goes_the_published_pace(given):
    assert paces(**given) == pytest.approx(0.9)
