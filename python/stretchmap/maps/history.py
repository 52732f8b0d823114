"""One record per step of an iteration."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["IterationRecord"]

NAN = math.nan


@dataclass(frozen=True)
class IterationRecord:
    """One step of an iteration; what a method does not compute stays NaN (``flips`` -1).

    Attributes
    ----------
    stage : str
        ``"sem"``, ``"newton"``, ``"vsem"``, ``"untangle"``, ...
    iteration : int
        Counted from 0 (the start) within the stage.
    energy : float
        Value of what the stage minimises.
    step : float
        Length of the step or of the line search.
    residual : float
        Gradient norm or whatever the stage stops on.
    flips : int
        Number of elements with the wrong sign.
    ring_std, element_std : float
        Standard deviation of the per-vertex ratios (6.3)/(6.5) and of the per-element ratios.
    seconds : float
        Since the start of the stage.

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.area_map(sm.samples.torus_surface(24, 12))
    >>> first = result.history[0]
    >>> first.stage, first.iteration, first.flips
    ('sem', 0, 0)
    """

    stage: str
    iteration: int
    energy: float = NAN
    step: float = NAN
    residual: float = NAN
    flips: int = -1
    ring_std: float = NAN
    element_std: float = NAN
    seconds: float = NAN
