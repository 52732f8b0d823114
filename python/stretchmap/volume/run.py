"""What the stages of one solve share."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..base.budget import Budget
from .model import History
from .options import FillOptions
from .problem import VolumeProblem

__all__ = ["Run"]


@dataclass
class Run:
    """What the stages of one solve share and hand on.

    Attributes
    ----------
    problem : VolumeProblem
        With the image so far.
    options : FillOptions
    history : History
        With the share of time that untangling may take, at first.
    budget : Budget
        All of it.
    on_mesh : bool
        Whether the boundary is going to glide on one.
    hasty : bool
        Whether another start follows, worth more than tets that stay stuck.
    afar : bool
        Whether tets far too many for patches are worth time, too.
    resumed : bool
        Whether this one had made room for others.
    seconds : dict
        By stage.
    """

    problem: VolumeProblem
    options: FillOptions
    history: History
    budget: Budget
    on_mesh: bool = False
    hasty: bool = False
    afar: bool = True
    resumed: bool = False
    seconds: dict[str, float] = field(default_factory=dict)

    def take(self, problem: VolumeProblem) -> None:
        """Go on with another problem."""
        self.problem = problem
        self.history.model = problem.model(self.options)

    @property
    def x(self) -> NDArray[np.float64]:
        """Where the vertices are in the image."""
        return self.problem.x

    @x.setter
    def x(self, value: NDArray[np.float64]) -> None:
        self.problem = dataclasses.replace(self.problem, x=value)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add what happens inside to the seconds of a stage."""
        clock = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - clock
