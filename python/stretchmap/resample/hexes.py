"""Structured hexahedral meshes of a solid through its map, and fields carried from solid to solid.

The section of the solid torus is an O-grid: a square block in the middle, rings round it. Swept
round the axis and pulled back to the source it is a mesh of hexahedra without irregular ends. Where
the piecewise-affine map leaves hexahedra turned over or nearly so, the grid is repaired (see
`_hexes`); its boundary points then glide on the surface of the solid.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .. import _core
from ..base.arrays import read_only
from ..base.options import callback, flag, memory, whole
from ..base.progress import Progress
from ..base.torus import TWO_PI, Torus
from ..errors import SolverError
from ..maps.given import as_map_of_solid, torus_of
from ..registration.flat_torus import FlatSurface
from .hex_result import HexMesh
from .layout import Layout, swept_layout
from .quality import boundary_distances, boundary_quads
from .repair import GridRepair

if TYPE_CHECKING:
    from ..maps.points import PointMap
    from ..maps.result import MapResult
    from ..mesh.meshes import TetMesh

__all__ = ["HexMesh", "hex_mesh"]

_BISECTIONS = 40
_MOST = 100_000  # hexahedra in any direction
_BYTES_PER_HEX = 2500  # at the peak, with the repair
_LEAST = 0.05  # least scaled Jacobian of a grid that is not repaired


def hex_mesh(
    result: MapResult,
    *,
    sections: int = 64,
    block: int = 4,
    rings: int = 4,
    repair: bool = True,
    progress: Progress | None = None,
) -> HexMesh:
    """Pull a structured grid of the solid torus back to the source.

    The outermost points lie where the ray from the core through them leaves the image, so that they
    come to lie on the boundary of the source.

    Parameters
    ----------
    result : VolumeMap or LoadedMap
        Certified map of a solid onto the solid torus.
    sections : int
        Hexahedra round the axis, at least 3.
    block : int
        Hexahedra along a side of the middle block.
    rings : int
        Layers of hexahedra between block and boundary.
    repair : bool
        Make all corner Jacobians positive where the pulled-back grid leaves some that are not, or
        below 0.05 when scaled by the edges.
    progress : Progress, optional
        Called once per round of the repair.

    Returns
    -------
    HexMesh

    Raises
    ------
    OptionError
        If a number is too small or the grid too large for the memory there is, or the map has no
        torus.
    KindError
        If it is no map, or that of a surface.
    SolverError
        If the core of the torus lies outside the image, or the repair fails; then ``ids`` are the
        hexahedra that are left.
    """
    result, solid = as_map_of_solid(result, "a grid of hexahedra")
    torus = torus_of(result)
    sections, block, rings = (
        whole("sections", sections, 3, _MOST),
        whole("block", block, 1, _MOST),
        whole("rings", rings, 1, _MOST),
    )
    count = sections * block * (block + 4 * rings)
    memory(f"a grid of {count} hexahedra", _BYTES_PER_HEX * count)
    repair = flag("repair", repair)
    callback("progress", progress)
    points = result.point_map
    layout = swept_layout(sections, block, rings)
    H, rim, u, v = layout.H, layout.boundary, layout.u, layout.v
    grid = torus.xi(u, v, layout.share * _reach(points, torus, u, v))
    located = points.inverse(grid)
    lost = np.flatnonzero(~located.inside)
    if len(lost):
        raise SolverError(f"{len(lost)} points of the grid lie outside the image", lost)
    V = pulled = located.points
    n_invalid = int((_core.resample.valid_hexes(V, H) == 0).sum())
    shares = _core.resample.hex_volumes(grid, H)
    shares /= shares.sum()
    if repair and (n_invalid or _core.resample.scaled_jacobians(V, H).min() < _LEAST):
        angles = result.coordinates()[solid.boundary_vertices, :2]
        V = _repaired(solid, angles, pulled, H, shares, rim, u[rim], v[rim], progress)
        left = np.flatnonzero(_core.resample.valid_hexes(V, H) == 0)
        if len(left):
            raise SolverError(
                f"{len(left)} hexahedra could not be made valid; try other numbers of sections, "
                "block or rings, repair=False returns the grid as it was pulled back",
                left,
            )
    return _measured(solid, torus, layout, grid, pulled, V, n_invalid)


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


def _reach(
    points: PointMap, torus: Torus, u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest s, up to r, for which xi(u, v, s) lies in the image; by bisection."""
    low, high = np.zeros(len(u)), np.full(len(u), torus.r)
    if not points.inverse(torus.xi(u, v, low)).inside.all():
        raise SolverError("the core of the torus lies outside the image; is the map certified?")
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        inside = points.inverse(torus.xi(u, v, middle)).inside
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


def _repaired(
    solid: TetMesh,
    angles: NDArray[np.float64],
    V: NDArray[np.float64],
    H: NDArray[np.int32],
    shares: NDArray[np.float64],
    rim: NDArray[np.int32],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    progress: Progress | None,
) -> NDArray[np.float64]:
    """The points after `GridRepair`; angles are those of the boundary, u and v of the rim."""
    surface = FlatSurface.of(solid.surface)
    turns = np.ascontiguousarray(angles / TWO_PI)
    edges = solid.surface.edges
    # Along an edge the angles change by less than half a turn; the rest is whole turns.
    forms = np.ascontiguousarray(-np.round(turns[edges[:, 1]] - turns[edges[:, 0]]).T, np.int32)
    chart = _core.area.SurfaceChart(solid.surface.topology, forms)
    at = np.ascontiguousarray(np.stack([u, v], axis=1) / TWO_PI)
    faces, weights = _core.registration.ChartLocator(chart, turns).locate(at)
    shift = np.stack([surface.chart.shift_u, surface.chart.shift_v], axis=-1)
    y = np.einsum("bk,bkc->bc", weights, surface.turns[solid.surface.F[faces]] + shift[faces])
    # A coarse face may be turned over in plain angles; then the nearest vertex is near enough.
    lost = np.flatnonzero(faces < 0)
    if len(lost):
        y[lost] = surface.turns[cKDTree(solid.surface.V).query(V[rim[lost]])[1]]
    grid = GridRepair(V, H, shares * solid.volume, rim, surface, np.ascontiguousarray(y))
    grid.run(progress)
    return grid.V
