"""How many hexahedra in which direction."""

from __future__ import annotations

__all__ = ["grid_numbers"]

_SECTIONS = 12.6  # 2 pi sqrt(3 pi / 7) 7 / 3, see below


def grid_numbers(ratio: float, n_hexahedra: float) -> tuple[int, int, int]:
    """Sections, block and rings for about so many hexahedra, as cubic as can be in the torus.

    In a torus of radii ``R = ratio`` and 1 cubes of side h make ``2 pi R / h`` sections of
    ``pi / h^2`` quads; an O-grid with a third as many rings as its block is wide has ``7 / 3``
    times the block squared. ``R / r`` of a map is chosen for least distortion, so that what is
    cubic there is not far from it in the solid. Fewer than two rings leave no room between the
    block's corners and the boundary.

    Examples
    --------
    >>> grid_numbers(3.0, 5000)
    (77, 5, 2)
    """
    block = max(1, round((n_hexahedra / (_SECTIONS * ratio)) ** (1.0 / 3.0)))
    rings = max(min(block, 2), round(block / 3.0))
    return max(4, round(n_hexahedra / (block * (block + 4 * rings)))), block, rings
