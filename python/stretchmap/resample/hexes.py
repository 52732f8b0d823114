"""Structured hexahedral meshes of a solid through its map.

The standard grid of `layout` is pulled back to the source. There the piecewise-affine map leaves
hexahedra sheared, some of them turned over; `optimize` makes them good.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import read_only
from ..base.options import callback, flag, memory, real, whole
from ..base.progress import Progress
from ..base.torus import Torus
from ..errors import OptionError
from ..maps.given import as_map_of_solid, require_unfolded, torus_of
from .boundary_layers import thicknesses_of, with_layers
from .hex_result import HexMesh
from .layout import Layout
from .levels import coarse_grid, halvings_for, levels_for, refined, require_valid
from .quality import boundary_distances, boundary_quads
from .sizes import grid_candidates
from .start import pulled_back

if TYPE_CHECKING:
    from ..maps.result import MapResult
    from ..mesh.meshes import TetMesh

__all__ = ["HexMesh", "hex_mesh"]

_MOST = 100_000  # hexahedra in any direction
_MOST_ALONG = 1e9  # cubes along a side of the volume; more than memory holds by far
_BYTES_PER_HEX = 12_000  # at the peak, with a hierarchy of the linear systems


def hex_mesh(
    result: MapResult,
    *,
    n_hexahedra: int | None = None,
    target_size: float | None = None,
    sections: int | None = None,
    block: int | None = None,
    rings: int | None = None,
    layers: Sequence[float] | None = None,
    optimize: bool = True,
    progress: Progress | None = None,
) -> HexMesh:
    """Mesh a solid with hexahedra: a structured grid of the solid torus, pulled back and optimized.

    A map between shape and volume is the better start: one made with ``balance=0.5``. Points move a
    good deal; what stays of the map is which part of the solid belongs to which section, block and
    layer.

    Parameters
    ----------
    result : VolumeMap or LoadedMap
        Certified map of a solid onto the solid torus.
    n_hexahedra : int, optional
        About so many, in numbers of sections, block and rings that make them nearly cubic.
        Default: 5000.
    target_size : float, optional
        Instead: the side of a cube of their mean volume.
    sections, block, rings : int, optional
        Instead, or in place of some of the numbers chosen: hexahedra round the axis, at least 3;
        along a side of the middle block; layers between block and boundary. All three leave
        nothing to the two above.
    layers : sequence of float, optional
        Thicknesses of layers of hexahedra at the boundary, from there inwards, measured along the
        normals at its points; the outermost ring is split, which adds as many rings.
    optimize : bool
        Optimize shape and fit of the boundary. False: the grid as it was pulled back, its boundary
        points on the surface, often with hexahedra that are not valid.
    progress : Progress, optional
        Called once per round of the optimization.

    Returns
    -------
    HexMesh

    Raises
    ------
    OptionError
        If a number is too small or the grid too large for the memory there is, two numbers exclude
        each other, or the map has no torus.
    KindError
        If it is no map, or that of a surface.
    CertificationError
        If tets of the image are folded or flat; ``ids`` are these.
    SolverError
        If the core of the torus lies outside the image, whose flat faces lie far below the torus
        where the boundary is coarse (``ids`` are their tets), the layers do not fit, or hexahedra
        are left that could not be made valid; then ``ids`` are those.

    Notes
    -----
    Up to four choices of the numbers are begun with, sizes made even under a loose fit before the
    boundary is held to the surface; the two whose boundaries come closest are gone on with. The one
    that ends closer is returned; of two within half a per cent of the diagonal, or both farther and
    about as far, the better shaped. What ends between nine tenths and twice that off has further
    rounds, in which the largest gaps count more, and keeps them where they bring it within. A grid
    of more than 16,000 hexahedra with even numbers is optimized with half the numbers first, then
    split in eight and finished; beyond 128,000 that is done twice, and from 384,000 on choices are
    compared by half the numbers of the first grid and one alone is gone on with. Where that fails
    in the solid as it is, its principal axes are made equally long for the optimization.

    References
    ----------
    V. Garanzha, I. Kaporin, L. Kudryavtseva, F. Protais, N. Ray, D. Sokolov, "Foldover-free maps in
    50 lines of code", ACM TOG 40(4), 2021.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(1500)
    >>> grid = sm.hex_mesh(sm.volume_map(solid), n_hexahedra=300)
    >>> grid.n_invalid
    0
    """
    result, solid = as_map_of_solid(result, "a grid of hexahedra")
    callback("progress", progress)
    thicknesses = thicknesses_of(layers)
    torus = torus_of(result)
    require_unfolded(result, solid, "a grid of hexahedra")
    candidates = _numbers(
        solid.volume, torus.ratio, n_hexahedra, target_size, sections, block, rings
    )
    count = max(s * b * (b + 4 * r) for s, b, r in candidates)
    memory(f"a grid of {count} hexahedra", _BYTES_PER_HEX * count)
    levels = 0
    if flag("optimize", optimize):
        least = min(s * b * (b + 4 * r) for s, b, r in candidates)
        while levels < levels_for(least) and not np.any(np.array(candidates) % 2 ** (levels + 1)):
            levels += 1
        start = coarse_grid(result, solid, np.array(candidates) // 2**levels, levels, progress)
    else:
        start = pulled_back(result, candidates[0])
    n_invalid = int((_core.resample.valid_hexes(start.pulled, start.layout.H) == 0).sum())
    start = refined(start, torus, levels, solid, progress)
    layout, grid, pulled, V = start.layout, start.grid, start.pulled, start.V
    if len(thicknesses):
        layout, V, (grid, pulled) = with_layers(start.numbers, V, (grid, pulled), thicknesses)
        if optimize:
            require_valid(V, layout.H, "the layers are too thick for the bends of the boundary")
    return _measured(solid, torus, layout, grid, pulled, V, n_invalid)


def _numbers(
    volume: float,
    ratio: float,
    n_hexahedra: int | None,
    target_size: float | None,
    sections: int | None,
    block: int | None,
    rings: int | None,
) -> list[tuple[int, int, int]]:
    """Candidates for the three numbers; one if some of them are given."""
    all_given = None not in (sections, block, rings)
    if all_given and not (n_hexahedra is target_size is None):
        raise OptionError(
            "sections, block and rings leave nothing to choose: leave out n_hexahedra, target_size"
        )
    if sum((n_hexahedra is not None, target_size is not None)) > 1:
        raise OptionError("give n_hexahedra or target_size, not both")
    if target_size is not None:
        size = real("target_size", target_size, above=0.0)
        wanted = min(volume ** (1.0 / 3.0) / size, _MOST_ALONG) ** 3
    else:
        wanted = whole("n_hexahedra", 5000 if n_hexahedra is None else n_hexahedra, 12)
    wanted = max(wanted, 12.0)
    factor = 2 ** halvings_for(wanted)
    chosen = [
        (factor * s, factor * b, factor * r)
        for s, b, r in grid_candidates(ratio, wanted / factor**3)
    ]
    if sections is block is rings is None:
        return chosen
    first = chosen[0]
    return [
        (
            whole("sections", first[0] if sections is None else sections, 3, _MOST),
            whole("block", first[1] if block is None else block, 1, _MOST),
            whole("rings", first[2] if rings is None else rings, 1, _MOST),
        )
    ]


def _measured(
    solid: TetMesh,
    torus: Torus,
    layout: Layout,
    grid: NDArray[np.float64],
    pulled: NDArray[np.float64],
    V: NDArray[np.float64],
    n_invalid: int,
) -> HexMesh:
    H = layout.H
    volumes = _core.resample.hex_volumes(V, H)
    shares = _core.resample.hex_volumes(grid, H)
    diagonal = float(np.linalg.norm(np.ptp(solid.V, axis=0)))
    moves = np.linalg.norm(V - pulled, axis=1) / diagonal
    distances = boundary_distances(V, boundary_quads(H), solid.surface)
    return HexMesh(
        V=read_only(V),
        H=read_only(H),
        grid=read_only(grid),
        coordinates=read_only(np.stack(torus.coordinates(grid), axis=-1)),
        block=read_only(layout.block),
        layer=read_only(layout.layer),
        jacobians=read_only(_core.resample.scaled_jacobians(V, H)),
        valid=read_only(_core.resample.valid_hexes(V, H).astype(bool)),
        volumes=read_only(volumes),
        volume_ratios=read_only(volumes / volumes.sum() / (shares / shares.sum())),
        solid_volume=solid.volume,
        grid_to_surface=distances[0] / diagonal,
        surface_to_grid=distances[1] / diagonal,
        n_pulled_back_invalid=n_invalid,
        moved=float(moves.max()),
        boundary_moved=float(moves[layout.boundary].max()),
    )
