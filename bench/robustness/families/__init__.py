"""Families of random genus-one solids; a solid is drawn anew from family, seed and size."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from surfaces import Rejected, fill

from stretchmap import TetMesh, TriMesh
from stretchmap.errors import StretchmapError

_ATTEMPTS = 40
_FEWEST, _MOST = 5_000, 60_000


@dataclass(frozen=True)
class Family:
    """One kind of solid.

    Attributes
    ----------
    name, summary : str
    even : bool
        Whether the boundary consists of well-shaped triangles.
    make : callable
        ``make(rng, n_tets)`` returns a solid of about that size, or a surface to be filled; it
        raises `Rejected` when the random shape is none of genus one.
    """

    name: str
    summary: str
    even: bool
    make: Callable[[np.random.Generator, float], TriMesh | TetMesh]

    def draw(self, seed: int, size: float = 1.0) -> TetMesh:
        """The solid that belongs to a seed, checked to be a solid torus.

        Raises
        ------
        Rejected
            If no attempt gave one.
        """
        reason: Exception | None = None
        for attempt in range(_ATTEMPTS):
            rng = np.random.default_rng([zlib.crc32(self.name.encode()), seed, attempt])
            n_tets = size * float(np.exp(rng.uniform(np.log(_FEWEST), np.log(_MOST))))
            try:
                made = self.make(rng, n_tets)
                solid = made if isinstance(made, TetMesh) else fill(made)
                solid.require_solid_torus()
                return solid
            except (Rejected, StretchmapError) as error:
                reason = error
        raise Rejected(f"{self.name} {seed}: no solid torus in {_ATTEMPTS} attempts: {reason}")


def families() -> dict[str, Family]:
    """All families by name."""
    from . import (
        bare,
        coarse,
        drilled,
        handles,
        knots,
        parts,
        pillars,
        pipes,
        ribbons,
        rings,
        shells,
        spiky,
        stretched,
        tubes,
    )

    rooms = (
        tubes, drilled, knots, rings, handles, spiky, coarse, stretched, shells, pillars, ribbons,
        parts, pipes, bare,
    )  # fmt: skip
    return {family.name: family for room in rooms for family in room.FAMILIES}
