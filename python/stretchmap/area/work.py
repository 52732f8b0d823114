"""How much work a map may take: Newton steps, each counted as one on the surface given."""

from __future__ import annotations

from dataclasses import dataclass

from ..mesh.surfaces import TriMesh

_STEPS, _SMALL = 150.0, 7.2e5  # so many, or as many as make so many faces on a small surface
_UNREFINED = 40  # steps where edges can be halved after them
# Steps that others take as long as: one in the flat chart, halving edges until few sag, and rings
# made exact.
_CHART, _FITTING, _RINGS = 0.4, 4.0, 3.0


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
        n_faces = surface.n_faces
        left = max(_STEPS, _SMALL / n_faces)
        return cls(n_faces, left, _UNREFINED if refine else int(left))

    def spend(self, steps: int, n_faces: int | None = None, each: float = 1.0) -> None:
        """Newton steps on a surface of so many faces."""
        self.left -= each * steps * (n_faces or self.n_faces) / self.n_faces

    def spend_in_chart(self, steps: int, n_faces: int | None = None) -> None:
        """Newton steps in the flat chart of a surface of so many faces."""
        self.spend(steps, n_faces, _CHART)

    def spend_on_fitting(self) -> None:
        """Edges of the surface given halved until none sags too much."""
        self.left -= _FITTING

    def spend_on_rings(self, n_faces: int) -> None:
        """The projection of the rings of a surface of so many faces."""
        self.left -= _RINGS * n_faces / self.n_faces

    def steps(self, n_faces: int | None = None) -> int:
        """Newton steps that can be afforded on a surface of so many faces."""
        return max(int(self.left * self.n_faces / (n_faces or self.n_faces)), 0)
