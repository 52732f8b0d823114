"""Reading meshes."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable

from ..base.files import open_to_read, parsing
from ..base.options import as_path, flag
from ..errors import FileFormatError
from ..mesh.given import as_solid, as_surface
from ..mesh.meshes import TetMesh, TriMesh
from .arrays import MeshArrays
from .foreign import for_vtk_alone, read_pyvista, read_trimesh
from .formats import BY_MESHIO, BY_TRIMESH, known_suffix
from .gmsh import is_gmsh, read_gmsh
from .meshio import UnknownCellsError, read_meshio
from .npz import read_npz
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .stl import read_stl

__all__ = ["read", "read_arrays", "read_solid", "read_surface"]

_READERS: dict[str, Callable[[bytes], MeshArrays]] = {
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}


def read(
    path: str | os.PathLike[str], *, orient: bool = False, compact: bool = False
) -> TriMesh | TetMesh:
    """Read a mesh; the suffix names the format.

    Parameters
    ----------
    path : path-like
        ``.npz .obj .off .ply .stl .msh .vtu .vtk .mesh .xdmf .vtp .glb .gltf .3mf``.
    orient : bool
        Repair the orientation, as the constructors of `TriMesh` and `TetMesh` do.
    compact : bool
        Drop points that no element uses (mesh generators like to leave some). Without it row i of
        ``V`` is point i of the file, but for elements of higher order, which are taken by their
        corners, and for formats that hold no shared vertices (``.stl .glb .gltf .3mf``).

    Returns
    -------
    TriMesh or TetMesh
        A solid when the file holds tets; the triangles beside them are ignored.

    Raises
    ------
    FileFormatError
        Unknown suffix; an empty, truncated or unintelligible file; other cells than triangles,
        polygons and tets.
    MissingDependencyError
        The format needs meshio, PyVista or trimesh, and it is not installed.
    MeshError
        The arrays in the file are not a mesh (index out of range, NaN, ...).
    OSError
        The file cannot be opened.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "torus.ply")
    ...     sm.write(path, sm.samples.torus_surface(12, 6))
    ...     mesh = sm.read(path)
    >>> mesh
    TriMesh(72 vertices, 144 faces)
    """
    orient, compact = flag("orient", orient), flag("compact", compact)
    arrays = read_arrays(path)
    make = TriMesh if arrays.T is None else TetMesh
    mesh: TriMesh | TetMesh = make(arrays.V, arrays.elements, orient=orient)
    return mesh.compact()[0] if compact else mesh


def read_surface(
    path: str | os.PathLike[str], *, orient: bool = False, compact: bool = False
) -> TriMesh:
    """Read a triangle mesh: `read`, where nothing else will do.

    Parameters
    ----------
    path, orient, compact
        As `read`.

    Returns
    -------
    TriMesh

    Raises
    ------
    KindError
        The file holds a solid.
    FileFormatError, MissingDependencyError, MeshError, OSError
        As `read`.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "torus.off")
    ...     sm.write(path, sm.samples.torus_surface(12, 6))
    ...     surface = sm.read_surface(path)
    >>> surface.genus
    1
    """
    return as_surface(read(path, orient=orient, compact=compact), str(path))


def read_solid(
    path: str | os.PathLike[str], *, orient: bool = False, compact: bool = False
) -> TetMesh:
    """Read a tet mesh: `read`, where nothing else will do.

    Parameters
    ----------
    path, orient, compact
        As `read`.

    Returns
    -------
    TetMesh

    Raises
    ------
    KindError
        The file holds a surface.
    FileFormatError, MissingDependencyError, MeshError, OSError
        As `read`.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "solid.npz")
    ...     sm.write(path, sm.samples.solid_torus(600))
    ...     solid = sm.read_solid(path)
    >>> solid.n_tets
    594
    """
    return as_solid(read(path, orient=orient, compact=compact), str(path))


def read_arrays(path: str | os.PathLike[str]) -> MeshArrays:
    """Read all arrays of a mesh file without judging them.

    Parameters
    ----------
    path : path-like
        As for `read`.

    Returns
    -------
    MeshArrays

    Raises
    ------
    FileFormatError, MissingDependencyError, OSError
        As for `read`.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "solid.npz")
    ...     sm.write(path, solid, cell_data={"density": solid.tet_volumes})
    ...     arrays = sm.io.read_arrays(path)
    >>> arrays.cell_data["density"].shape
    (594,)
    """
    path = as_path(path)
    suffix = known_suffix(path, (*BY_TRIMESH, ".vtp"))
    with open_to_read(path) as file:
        if not file.read(1):
            raise FileFormatError(f"{path} is empty")
        file.seek(0)
        with parsing(path):
            if suffix in _READERS:
                return _READERS[suffix](file.read())
            if suffix == ".npz":
                return read_npz(file)
            if suffix == ".msh" and is_gmsh(file.read(200)):
                file.seek(0)
                return read_gmsh(file.read())
    with parsing(path):
        if suffix in BY_TRIMESH:
            return read_trimesh(path)
        if suffix == ".vtp":
            return read_pyvista(path)
        if suffix in (".vtk", ".vtu") and (found := for_vtk_alone(path)) is not None:
            return read_pyvista(path, found)
        try:
            return read_meshio(path, BY_MESHIO[suffix])
        except UnknownCellsError:
            if importlib.util.find_spec("pyvista") is None:
                raise
            return read_pyvista(path)
