"""Meshes and their fields as objects of PyVista, trimesh and meshio, bit for bit."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import KindError, MissingDependencyError

__all__ = ["Cells", "Exchanged"]

_VTK = {"triangle": 5, "tetra": 10, "hexahedron": 12}


@dataclass(frozen=True, eq=False)
class Cells:
    """Points, cells of one kind, and fields.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
    kind : {"triangle", "tetra", "hexahedron"}
    cells : ndarray of int32, shape (k, 3), (k, 4) or (k, 8)
    point_data, cell_data : dict of str to ndarray
        One row per point, per cell.
    """

    points: NDArray[np.float64]
    kind: str
    cells: NDArray[np.int32]
    point_data: dict[str, NDArray[Any]] = field(default_factory=dict)
    cell_data: dict[str, NDArray[Any]] = field(default_factory=dict)


class Exchanged:
    """What has points and cells: a mesh, a map (its source, with the image), parts, hexahedra."""

    def as_cells(self) -> Cells:
        """Points, cells and all fields."""
        raise NotImplementedError

    def to_pyvista(self) -> Any:
        """As ``pyvista.PolyData`` (triangles) or ``UnstructuredGrid``, with all fields.

        Raises
        ------
        MissingDependencyError
            If pyvista is not installed.
        """
        pyvista = _library("pyvista", "viz")
        given = self.as_cells()
        if given.kind == "triangle":
            out = pyvista.PolyData.from_regular_faces(given.points.copy(), given.cells)
        else:
            cells = given.cells.astype(np.int64)
            out = pyvista.UnstructuredGrid({_VTK[given.kind]: cells}, given.points.copy())
        for name, array in given.point_data.items():
            out.point_data[name] = array.copy()
        for name, array in given.cell_data.items():
            out.cell_data[name] = array.copy()
        return out

    def to_trimesh(self) -> Any:
        """As ``trimesh.Trimesh``, with vertex and face attributes; surfaces only.

        Raises
        ------
        KindError
            Of tets or hexahedra: trimesh holds triangles.
        MissingDependencyError
            If trimesh is not installed.
        """
        trimesh = _library("trimesh", "interop")
        given = self.as_cells()
        if given.kind != "triangle":
            raise KindError("trimesh holds triangles only; take the surface, .surface.to_trimesh()")
        return trimesh.Trimesh(
            given.points.copy(),
            given.cells.copy(),
            process=False,
            vertex_attributes={name: a.copy() for name, a in given.point_data.items()},
            face_attributes={name: a.copy() for name, a in given.cell_data.items()},
        )

    def to_meshio(self) -> Any:
        """As ``meshio.Mesh``, with all fields.

        Raises
        ------
        MissingDependencyError
            If meshio is not installed.
        """
        meshio = _library("meshio", "io")
        given = self.as_cells()
        return meshio.Mesh(
            given.points.copy(),
            [(given.kind, given.cells.copy())],
            point_data={name: a.copy() for name, a in given.point_data.items()},
            cell_data={name: [a.copy()] for name, a in given.cell_data.items()},
        )


def _library(name: str, extra: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingDependencyError(
            f"that needs {name}: pip install 'stretchmap[{extra}]'"
        ) from error
