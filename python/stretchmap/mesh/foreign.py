"""Meshes of PyVista, trimesh and meshio, and pairs of arrays, as meshes of ours."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import KindError
from .cells import Block, blocks_of_vtk, simplices, vertex_ids
from .meshes import TetMesh, TriMesh

__all__ = ["converted", "from_meshio", "from_pyvista", "from_trimesh"]


def from_pyvista(data: Any) -> TriMesh | TetMesh:
    """A surface from ``pyvista.PolyData``, a surface or a solid from ``UnstructuredGrid``.

    Parameters
    ----------
    data : pyvista.PolyData or pyvista.UnstructuredGrid
        Of triangles and polygons, which are split, or of tets; what lies beside the tets is
        ignored, and so are points and lines. Elements of higher order are taken by their corners;
        without them row i of ``V`` is its point i.

    Returns
    -------
    TriMesh or TetMesh

    Raises
    ------
    KindError
        It is another object, or holds other cells.
    MeshError
        The arrays are not a mesh.

    Examples
    --------
    >>> import stretchmap as sm
    >>> import pyvista  # doctest: +SKIP
    >>> sm.from_pyvista(pyvista.ParametricTorus())  # doctest: +SKIP
    """
    if not _is_of(data, "pyvista"):
        raise KindError(f"a PolyData or UnstructuredGrid is needed, got {type(data).__name__}")
    if not any(hasattr(type(data), name) for name in ("regular_faces", "cells_dict")):
        raise KindError(f"a PolyData or UnstructuredGrid is needed, got {type(data).__name__}")
    grid = data.cast_to_unstructured_grid()
    points = np.asarray(grid.points)
    offsets = grid.cell_offsets if hasattr(grid, "cell_offsets") else grid.offset  # before 0.49
    types, cells = np.asarray(grid.celltypes), np.asarray(grid.cell_connectivity)
    return _mesh(points, blocks_of_vtk(len(points), types, cells, np.asarray(offsets)))


def from_trimesh(data: Any) -> TriMesh:
    """A surface from ``trimesh.Trimesh``.

    Parameters
    ----------
    data : trimesh.Trimesh

    Returns
    -------
    TriMesh

    Raises
    ------
    KindError, MeshError
        As `from_pyvista`.

    Examples
    --------
    >>> import stretchmap as sm
    >>> import trimesh  # doctest: +SKIP
    >>> sm.from_trimesh(trimesh.creation.torus(3.0, 1.0))  # doctest: +SKIP
    """
    if not _is_of(data, "trimesh") or not hasattr(data, "faces"):
        raise KindError(f"a trimesh.Trimesh is needed, got {type(data).__name__}")
    return TriMesh(np.asarray(data.vertices), np.asarray(data.faces))


def from_meshio(data: Any) -> TriMesh | TetMesh:
    """A solid from ``meshio.Mesh`` where it holds tets, else a surface.

    Parameters
    ----------
    data : meshio.Mesh
        As `from_pyvista`.

    Returns
    -------
    TriMesh or TetMesh

    Raises
    ------
    KindError, MeshError
        As `from_pyvista`.

    Examples
    --------
    >>> import stretchmap as sm
    >>> import meshio  # doctest: +SKIP
    >>> sm.from_meshio(meshio.read("part.msh"))  # doctest: +SKIP
    """
    if not _is_of(data, "meshio") or not hasattr(data, "cells"):
        raise KindError(f"a meshio.Mesh is needed, got {type(data).__name__}")
    blocks = [Block(block.type, vertex_ids(block.type, block.data)) for block in data.cells]
    return _mesh(np.asarray(data.points), blocks)


def converted(given: Any) -> Any:
    """A mesh of a library or a pair (V, F) or (V, T) as ours; anything else as it is."""
    if _is_of(given, "pyvista"):
        return from_pyvista(given)
    if _is_of(given, "trimesh"):
        return from_trimesh(given)
    if _is_of(given, "meshio"):
        return from_meshio(given)
    if isinstance(given, tuple) and len(given) == 2:
        width = np.shape(given[1])[-1:] if isinstance(given[1], (np.ndarray, list)) else ()
        if width in ((3,), (4,)):
            return TetMesh(*given) if width == (4,) else TriMesh(*given)
    return given


def _is_of(given: Any, library: str) -> bool:
    """Whether the object's class, or a base of it, is one of a library; imports nothing."""
    return any(kind.__module__.split(".")[0] == library for kind in type(given).__mro__)


def _mesh(points: NDArray[Any], blocks: list[Block]) -> TriMesh | TetMesh:
    found = simplices(points, blocks)
    make = TetMesh if found.kind == "tetra" else TriMesh
    return make(found.points, found.cells)
