"""A mesh of hexahedra with its measures."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from ..base.tables import HasSummary, plain_dict, table
from ..mesh.exchange import Cells, Exchanged
from .hex_files import write_hexahedra

__all__ = ["HexMesh"]

_SHARES_BELOW = (0.2, 0.3, 0.5)


@dataclass(frozen=True, eq=False)
class HexMesh(HasSummary, Exchanged):
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
    block : ndarray of int32, shape (k,)
        0 in the middle block of the section, 1 to 4 in the quarters of the rings round it.
    layer : ndarray of int32, shape (k,)
        Layers from the boundary: 0 for hexahedra at it. All of the middle block is one layer.
    jacobians : ndarray, shape (k, 8)
        Scaled Jacobians: at every corner the determinant over the product of the three edge
        lengths, at most 1.
    valid : ndarray of bool, shape (k,)
        Whether the Jacobian determinant is proven to be positive in the whole hexahedron, by its
        Bernstein coefficients [1]_; positive corners alone do not suffice.
    volumes : ndarray, shape (k,)
        Of the trilinear hexahedra.
    volume_ratios : ndarray, shape (k,)
        Share of each hexahedron in the volume over the share it has in the standard grid: 1 where
        the map preserves volume and the hexahedra follow it.
    solid_volume : float
        Of the solid.
    grid_to_surface, surface_to_grid : float
        Largest distance from a point of the grid's boundary to the surface of the solid, and the
        other way round, as shares of the diagonal of the box.
    n_pulled_back_invalid : int
        Hexahedra that were not valid as the map left them.
    moved, boundary_moved : float
        How far a point, and a boundary point, has moved at most since then, as a share of the
        diagonal.

    References
    ----------
    .. [1] A. Johnen, J.-C. Weill, J.-F. Remacle, "Robust and efficient validation of the linear
       hexahedral element", Procedia Engineering 203 (2017), arXiv 1706.01613.

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.volume_map(sm.samples.solid_torus(600))
    >>> grid = sm.hex_mesh(result, sections=12, block=2, rings=1)
    >>> grid.H.shape[0] == len(grid.scaled_jacobians) == 144
    True
    """

    V: NDArray[np.float64]
    H: NDArray[np.int32]
    grid: NDArray[np.float64]
    coordinates: NDArray[np.float64]
    block: NDArray[np.int32]
    layer: NDArray[np.int32]
    jacobians: NDArray[np.float64]
    valid: NDArray[np.bool_]
    volumes: NDArray[np.float64]
    volume_ratios: NDArray[np.float64]
    solid_volume: float
    grid_to_surface: float
    surface_to_grid: float
    n_pulled_back_invalid: int
    moved: float
    boundary_moved: float

    def __repr__(self) -> str:
        return f"HexMesh({len(self.V)} points, {len(self.H)} hexahedra)"

    @cached_property
    def scaled_jacobians(self) -> NDArray[np.float64]:
        """The least of the eight of each hexahedron, (k,)."""
        return read_only(self.jacobians.min(axis=1))

    @property
    def volume(self) -> float:
        """Sum of the volumes."""
        return float(self.volumes.sum())

    @property
    def n_invalid(self) -> int:
        """Hexahedra that are not proven to be valid."""
        return int((~self.valid).sum())

    def to_dict(self) -> dict[str, Any]:
        """The figures, JSON-compatible."""
        worst = self.scaled_jacobians
        return plain_dict(
            {
                "n_points": len(self.V),
                "n_hexahedra": len(self.H),
                "n_invalid": self.n_invalid,
                "n_pulled_back_invalid": self.n_pulled_back_invalid,
                "scaled_jacobian_min": worst.min(),
                "scaled_jacobian_mean": worst.mean(),
                **{f"share_below_{limit}": (worst < limit).mean() for limit in _SHARES_BELOW},
                "volume_ratio_sd": self.volume_ratios.std(),
                "volume_ratio_min": self.volume_ratios.min(),
                "volume_ratio_max": self.volume_ratios.max(),
                "volume": self.volume,
                "volume_error": self.volume / self.solid_volume - 1.0,
                "grid_to_surface": self.grid_to_surface,
                "surface_to_grid": self.surface_to_grid,
                "moved": self.moved,
                "boundary_moved": self.boundary_moved,
            }
        )

    def summary(self) -> str:
        """A table of the figures."""
        return table(self.to_dict())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the mesh with its coordinates and measures, see `write_hexahedra`.

        Raises
        ------
        FileFormatError
            Another suffix than ``.vtu``, ``.vtk``, ``.msh``, ``.inp`` or ``.bdf``.
        MissingDependencyError
            meshio is not installed.
        OSError
            If the file cannot be written.
        """
        given = self.as_cells()
        write_hexahedra(path, self.V, self.H, given.point_data, given.cell_data)

    def as_cells(self) -> Cells:
        """Points, cells and all fields."""
        points = {**dict(zip("uvs", self.coordinates.T, strict=True)), "grid": self.grid}
        cells: dict[str, NDArray[Any]] = {
            "block": self.block,
            "layer": self.layer,
            "scaled_jacobian": self.scaled_jacobians,
            "volume_ratio": self.volume_ratios,
        }
        return Cells(self.V, "hexahedron", self.H, points, cells)
