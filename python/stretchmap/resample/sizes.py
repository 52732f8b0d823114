"""How many hexahedra in which direction."""

from __future__ import annotations

__all__ = ["grid_candidates"]

_SECTIONS = 12.6  # 2 pi sqrt(3 pi / 7) 7 / 3, see below


def grid_candidates(ratio: float, n_hexahedra: float) -> list[tuple[int, int, int]]:
    """Sections, block and rings for about so many hexahedra, as cubic as can be in the torus first.

    In a torus of radii ``R = ratio`` and 1 cubes of side h make ``2 pi R / h`` sections of
    ``pi / h^2`` quads; an O-grid with a third as many rings as its block is wide has ``7 / 3``
    times the block squared. ``R / r`` of a map is chosen for least distortion, so that what is
    cubic there is not far from it in the solid. With a ring fewer, and a block as wide or wider by
    two, there are more quads at the boundary for as many hexahedra, flatter ones. With a ring fewer
    and a narrower block there are more sections: where the tube is thin a map that keeps volumes
    leaves few of them to a long piece of it.

    Examples
    --------
    >>> grid_candidates(3.0, 5000)
    [(77, 5, 2), (111, 5, 1), (65, 7, 1), (156, 4, 1)]
    """
    block = max(1, round((n_hexahedra / (_SECTIONS * ratio)) ** (1.0 / 3.0)))
    rings = max(min(block, 2), round(block / 3.0))
    shapes = [(block, rings)]
    if rings > 1:
        shapes += [(block + wider, rings - 1) for wider in (0, 2, -1)]
    return [(max(4, round(n_hexahedra / (b * (b + 4 * r)))), b, r) for b, r in shapes]
