"""How long a map may take."""

from __future__ import annotations

import time

from .. import _core

__all__ = ["Budget", "Spent", "processor_seconds"]

_LEAST_SECONDS, _MARGIN = 4.5, 0.9  # a stage under way is ended


def processor_seconds() -> float:
    """Processor time of the calling thread and of those that share its loops, but of no others."""
    return time.thread_time() + _core.base.helper_seconds()


class Spent(Exception):
    """What was under way has no time left."""


class Budget:
    """Processor time that may be spent, by the thread that asks and those that share its loops.

    Parameters
    ----------
    seconds : float
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._end = processor_seconds() + seconds

    @classmethod
    def of(cls, time_limit: float, n_elements: int) -> Budget:
        """For a mesh of so many elements with that limit for each; some seconds for a small one."""
        return cls(max(_LEAST_SECONDS, _MARGIN * time_limit * n_elements))

    def share(self, part: float) -> Budget:
        """A part of what is left."""
        return Budget(part * self.left)

    @property
    def left(self) -> float:
        """Seconds."""
        return max(self._end - processor_seconds(), 0.0)

    @property
    def spent(self) -> bool:
        """Whether there is none left."""
        return self.left == 0.0
