"""How much work a map may take: Newton steps on surfaces of various sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..mesh.surfaces import TriMesh

# In units of what a face adds to a step where elimination costs nothing: so many a face of the
# surface given, and no fewer than those. Half a millisecond a face where a unit takes a
# microsecond.
_EACH, _LEAST = 480.0, 2.1e6
_EVEN = 2_000.0  # faces where elimination takes as long as the rest of a step; its share grows
_UNREFINED = 40  # steps where edges can be halved after them
# Steps that others take as long as: one in the flat chart, one without a barrier against faces that
# look inward, halving edges until few sag, and rings made exact.
_CHART, _LOOSE, _FITTING, RINGS = 0.6, 0.9, 3, 8


def _cost(n_faces: int) -> float:
    """Of a step: elimination by nested dissection grows as the power 3/2 of the faces."""
    return n_faces * (1.0 + math.sqrt(n_faces / _EVEN))


@dataclass
class Work:
    """What is left of it.

    Attributes
    ----------
    n_faces : int
        Of the surface given.
    left : float
    most : int
        Steps on a surface before edges are halved where they end short.
    """

    n_faces: int
    left: float
    most: int

    @classmethod
    def of(cls, surface: TriMesh, *, refine: bool) -> Work:
        """All of it."""
        work = cls(surface.n_faces, max(_EACH * surface.n_faces, _LEAST), _UNREFINED)
        if not refine:
            work.most = work.steps()
        return work

    def spend(self, steps: float, n_faces: int | None = None) -> None:
        """Newton steps on a surface of so many faces."""
        self.left -= steps * _cost(n_faces or self.n_faces)

    def spend_in_chart(self, steps: int) -> None:
        """Newton steps in the flat chart."""
        self.spend(_CHART * steps)

    def spend_on_approach(self, steps: int, n_faces: int) -> None:
        """Newton steps on a surface of so many faces, whichever way these look."""
        self.spend(_LOOSE * steps, n_faces)

    def spend_on_fitting(self, n_faces: int) -> None:
        """Edges halved until none sags too much, which has led to so many faces."""
        self.spend(_FITTING, n_faces)

    def spend_on_rings(self, n_faces: int) -> None:
        """The projection of the rings of a surface of so many faces."""
        self.spend(RINGS, n_faces)

    def steps(self, n_faces: int | None = None) -> int:
        """Newton steps that can be afforded on a surface of so many faces."""
        return max(int(self.left / _cost(n_faces or self.n_faces)), 0)
