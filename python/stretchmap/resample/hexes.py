"""Structured hexahedral meshes of a solid through its map, and fields carried from solid to solid.

The section of the solid torus is an O-grid: a square block in the middle, rings round it. Swept
round the axis and pulled back to the source it is a mesh of hexahedra without irregular ends. Where
the piecewise-affine map leaves hexahedra turned over or nearly so, the grid is repaired (see
`_hexes`); its boundary points then glide on the surface of the solid.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .. import _core
from ..base.arrays import read_only
from ..base.files import atomic_path
from ..base.options import flag, memory, whole
from ..base.progress import Progress
from ..base.tables import HasSummary, plain_dict, table
from ..base.torus import TWO_PI, Torus
from ..errors import FileFormatError, MissingDependencyError, SolverError
from ..maps.given import as_map_of_solid, torus_of
from ..registration.flat_torus import FlatSurface
from .o_grid import o_grid
from .quality import corner_tets, hex_volumes, jacobians
from .repair import GridRepair

if TYPE_CHECKING:
    from ..maps.points import PointMap
    from ..maps.result import MapResult

__all__ = ["HexMesh", "hex_mesh"]

_BISECTIONS = 40
_MOST = 100_000  # hexahedra in any direction
_BYTES_PER_HEX = 2500  # at the peak, with the repair
_LEAST = 0.05  # least scaled Jacobian of a grid that is not repaired


@dataclass(frozen=True, eq=False)
class HexMesh(HasSummary):
    """A structured hexahedral mesh of a solid.

    Attributes
    ----------
    V : ndarray, shape (n, 3)
        Points, in the source.
    H : ndarray of int32, shape (k, 8)
        Corners in the order of VTK: one face counter-clockwise, then the opposite one.
    grid : ndarray, shape (n, 3)
        The points of the standard grid in the solid torus they came from.
    coordinates : ndarray, shape (n, 3)
        Their (u, v, s).
    jacobians : ndarray, shape (k, 8)
        Jacobian at every corner over the product of the three edge lengths, at most 1.
    volumes : ndarray, shape (k,)
        Of the trilinear hexahedra.
    volume_ratios : ndarray, shape (k,)
        Share of each hexahedron in the volume over the share it has in the standard grid: 1 where
        the map preserves volume and the hexahedra follow it.
    n_pulled_back_negative : int
        Hexahedra with a corner that is not positive before the repair.
    moved, rim_moved : float
        How far the repair moved a point, and a boundary point, at most, as a share of the diagonal
        of the box. Boundary points stay on the surface all the way.
    """

    V: NDArray[np.float64]
    H: NDArray[np.int32]
    grid: NDArray[np.float64]
    coordinates: NDArray[np.float64]
    jacobians: NDArray[np.float64]
    volumes: NDArray[np.float64]
    volume_ratios: NDArray[np.float64]
    n_pulled_back_negative: int
    moved: float
    rim_moved: float

    @property
    def volume(self) -> float:
        """Sum of the volumes."""
        return float(self.volumes.sum())

    @property
    def n_negative(self) -> int:
        """Hexahedra with a corner that is not positive."""
        return int((~(self.jacobians > 0.0)).any(axis=1).sum())

    def to_dict(self) -> dict[str, Any]:
        """The figures, JSON-compatible."""
        return plain_dict(
            {
                "n_points": len(self.V),
                "n_hexahedra": len(self.H),
                "n_negative": self.n_negative,
                "n_pulled_back_negative": self.n_pulled_back_negative,
                "moved": self.moved,
                "rim_moved": self.rim_moved,
                "jacobian_min": self.jacobians.min(),
                "jacobian_mean": self.jacobians.mean(),
                "volume_ratio_sd": self.volume_ratios.std(),
                "volume_ratio_min": self.volume_ratios.min(),
                "volume_ratio_max": self.volume_ratios.max(),
                "volume": self.volume,
            }
        )

    def summary(self) -> str:
        """A table of the figures."""
        return table(self.to_dict())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the mesh as ``.vtu`` or ``.vtk``, with the coordinates and the least Jacobians.

        Raises
        ------
        FileFormatError
            Another suffix.
        MissingDependencyError
            meshio is not installed.
        OSError
            If the file cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() not in (".vtu", ".vtk"):
            raise FileFormatError(f"{path}: hexahedra are written as .vtu or .vtk")
        try:
            import meshio
        except ImportError:
            raise MissingDependencyError(
                "writing hexahedra needs meshio: pip install 'stretchmap[io]'"
            ) from None
        mesh = meshio.Mesh(
            self.V,
            [("hexahedron", self.H)],
            point_data={"coordinates": self.coordinates, "grid": self.grid},
            cell_data={
                "jacobian": [self.jacobians.min(axis=1)],
                "volume_ratio": [self.volume_ratios],
            },
        )
        with atomic_path(path) as temporary:
            meshio.write(temporary, mesh)


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
    result, _ = as_map_of_solid(result, "a grid of hexahedra")
    torus = torus_of(result)
    sections, block, rings = (
        whole("sections", sections, 3, _MOST),
        whole("block", block, 1, _MOST),
        whole("rings", rings, 1, _MOST),
    )
    count = sections * block * (block + 4 * rings)
    memory(f"a grid of {count} hexahedra", _BYTES_PER_HEX * count)
    repair = flag("repair", repair)
    points = result.point_map
    disk, quads, outer = o_grid(block, rings)
    n = len(disk)
    u = np.repeat(np.arange(sections) * TWO_PI / sections, n)
    v = np.tile(np.arctan2(disk[:, 1], disk[:, 0]), sections)
    share = np.tile(np.hypot(disk[:, 0], disk[:, 1]), sections)
    here, there = (n * np.arange(sections)[:, None, None], None)
    there = n * ((np.arange(sections) + 1) % sections)[:, None, None]
    H = np.concatenate([quads[None] + here, quads[None] + there], axis=2).reshape(-1, 8)
    reach = _reach(points, torus, u, v)
    ids = (n * np.arange(sections)[:, None] + outer).ravel()
    grid = torus.xi(u, v, share * reach)
    located = points.inverse(grid)
    lost = np.flatnonzero(~located.inside)
    if len(lost):
        raise SolverError(f"{len(lost)} points of the grid lie outside the image", lost)
    V = pulled = located.points
    H = H.astype(np.int32)
    if _core.mesh.tet_volumes(np.ascontiguousarray(grid), corner_tets(H)).sum() < 0.0:
        H = np.ascontiguousarray(H[:, [0, 3, 2, 1, 4, 7, 6, 5]])
    quality = jacobians(V, H)
    bad = int((~(quality > 0.0)).any(axis=1).sum())
    shares = hex_volumes(grid, H)
    shares /= shares.sum()
    if repair and not quality.min() >= _LEAST:
        V = _repaired(result, pulled, H, shares, ids.astype(np.int32), u[ids], v[ids], progress)
        quality = jacobians(V, H)
        left = np.flatnonzero(~(quality > 0.0).all(axis=1))
        if len(left):
            raise SolverError(
                f"{len(left)} hexahedra could not be made positive; try other numbers of sections, "
                "block or rings, repair=False returns the grid as it was pulled back",
                left,
            )
    volumes = hex_volumes(V, H)
    moves = np.linalg.norm(V - pulled, axis=1) / float(np.linalg.norm(np.ptp(pulled, axis=0)))
    return HexMesh(
        V=read_only(V),
        H=read_only(H),
        grid=read_only(grid),
        coordinates=read_only(np.stack(torus.coordinates(grid), axis=-1)),
        jacobians=read_only(quality),
        volumes=read_only(volumes),
        volume_ratios=read_only(volumes / volumes.sum() / shares),
        n_pulled_back_negative=bad,
        moved=float(moves.max()),
        rim_moved=float(moves[ids].max()),
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
    result: MapResult,
    V: NDArray[np.float64],
    H: NDArray[np.int32],
    shares: NDArray[np.float64],
    rim: NDArray[np.int32],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    progress: Progress | None,
) -> NDArray[np.float64]:
    """The points after `GridRepair`; u and v are those of the rim."""
    solid, torus = result.mesh, result.torus
    surface = FlatSurface.of(solid.surface)
    angles = np.stack(torus.coordinates(result.image[solid.boundary_vertices])[:2], axis=1)
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
