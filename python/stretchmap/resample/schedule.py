"""How long a grid is optimized, and how much sizes count."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ANY_SIZES", "EVEN_SIZES", "Schedule", "Sizes"]


@dataclass(frozen=True)
class Sizes:
    """How much sizes count."""

    volume: float  # weight of the volumes of boxes
    pull: float  # share of the way to the mean size, in logarithms, that boxes grow or shrink ...
    most: float  # ... at most by this


ANY_SIZES, EVEN_SIZES = Sizes(0.1, 0.3, 0.4), Sizes(5.0, 1.0, 1.0)


@dataclass(frozen=True)
class Schedule:
    """How long to go on.

    Attributes
    ----------
    untangle : int
        Most rounds until all corners are positive.
    even : tuple of float
        Factors of the fit of the boundary in rounds that make sizes even, before all others. Under
        a fit at full strength points are caught where the surface bends, and large quads stay
        large; under a loose one they go where there are too few.
    fit : float
        Factor of the fit in all other rounds.
    powers : tuple of float
        Power p of each round after that, see `hex_energy.hpp`.
    norm_share : float
        Gaps between boundary and surface count with twice this share of those powers.
    steps : int
        Newton steps between two looks at boxes and samples.
    preconditioner : str
        Of their linear systems, see `BlockOptions` of the core. Where a coarser grid was optimized
        before, what is left is local, and a hierarchy costs more than it saves.
    """

    untangle: int = 40
    even: tuple[float, ...] = ()
    fit: float = 1.0
    powers: tuple[float, ...] = (
        *(1.0,) * 6,
        *(2.0,) * 5,
        *(3.0,) * 5,
        *(4.0,) * 5,
        *(6.0,) * 8,
        *(8.0,) * 8,
        *(12.0,) * 10,
    )
    norm_share: float = 2.0 / 3.0
    steps: int = 3
    preconditioner: str = "multigrid"
