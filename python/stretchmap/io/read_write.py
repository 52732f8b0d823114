"""Reading and writing meshes.

============================  =========  ======================================================
format                        holds      remarks
============================  =========  ======================================================
``.npz``                      both       ``V`` with ``F`` or ``T``, further arrays by their names
``.obj``                      surfaces   texture coordinates per corner (seams)
``.off``                      surfaces
``.ply``                      surfaces   point and cell arrays as properties
``.stl``                      surfaces   single precision; equal corners become one vertex
``.vtu .vtk .xdmf .msh``      both       point and cell arrays; through meshio
``.mesh``                     both       no arrays; through meshio
``.vtp``                      surfaces   read only; through PyVista, as ``.vtk`` of surfaces
``.glb .gltf .3mf``           surfaces   read only; through trimesh, parts joined and welded
============================  =========  ======================================================

What is written goes to a temporary file beside the target first and is renamed at the end, so a
failure leaves nothing behind and never half a file.
"""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO

from numpy.typing import ArrayLike

from ..base.files import atomic_path, open_to_read, parsing
from ..base.options import as_path, flag
from ..errors import FileFormatError
from ..mesh.given import as_mesh, as_solid, as_surface
from ..mesh.meshes import TetMesh, TriMesh
from .arrays import MeshArrays, checked, checked_uv
from .foreign import is_for_vtk_alone, read_pyvista, read_trimesh
from .gmsh import is_gmsh, read_gmsh
from .meshio import read_meshio, write_meshio
from .npz import read_npz, write_npz
from .obj import read_obj, write_obj
from .off import read_off, write_off
from .ply import read_ply, write_ply
from .stl import read_stl, write_stl

__all__ = ["read", "read_arrays", "read_solid", "read_surface", "suffixes", "write"]

_log = logging.getLogger("stretchmap")

_READERS: dict[str, Callable[[bytes], MeshArrays]] = {
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}
_WRITERS: dict[str, Callable[[BinaryIO, MeshArrays], None]] = {
    ".obj": write_obj,
    ".off": write_off,
    ".ply": write_ply,
    ".stl": write_stl,
}
# Suffix -> meshio's name of the format.
_MESHIO = {".msh": "gmsh", ".vtu": "vtu", ".vtk": "vtk", ".mesh": "medit", ".xdmf": "xdmf"}
_TRIMESH = (".glb", ".gltf", ".3mf")
_WITHOUT_DATA = {".obj", ".off", ".stl", ".mesh"}


def suffixes(solid: bool) -> tuple[str, ...]:
    """Return the suffixes of the formats that can hold a solid, or a surface.

    Parameters
    ----------
    solid : bool

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> from stretchmap import io
    >>> ".stl" in io.suffixes(solid=False), ".stl" in io.suffixes(solid=True)
    (True, False)
    """
    return (".npz", *_MESHIO) if solid else (".npz", *_WRITERS, *_MESHIO)


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
    suffix = _known_suffix(path, {".npz", *_READERS, *_MESHIO, *_TRIMESH, ".vtp"})
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
        if suffix in _TRIMESH:
            return read_trimesh(path)
        if suffix == ".vtp" or (suffix == ".vtk" and is_for_vtk_alone(path)):
            return read_pyvista(path)
        return read_meshio(path, _MESHIO[suffix])


def write(
    path: str | os.PathLike[str],
    mesh: TriMesh | TetMesh,
    point_data: Mapping[str, ArrayLike] | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
    corner_uv: ArrayLike | None = None,
) -> None:
    """Write a mesh; the suffix names the format.

    Parameters
    ----------
    path : path-like
        As for `read`. An existing file is replaced, but only once the new one is complete.
    mesh : TriMesh or TetMesh
    point_data, cell_data : mapping of str to (n,) or (n, d) array_like, optional
        One row per vertex, or per face or tet. Formats without arrays leave them out.
    corner_uv : (m, 3, 2) array_like, optional
        Texture coordinates of the corners of the faces; ``.obj`` only. They may differ at one
        vertex (seam).

    Raises
    ------
    FileFormatError
        Unknown suffix, or the format cannot hold tets or texture coordinates.
    ArrayError
        An array with the wrong number of rows, not numeric, or named like a mesh array.
    MissingDependencyError
        The format needs meshio and it is not installed.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sm.write(os.path.join(folder, "solid.npz"), solid, point_data={"x": solid.V[:, 0]})
    ...     os.listdir(folder)
    ['solid.npz']
    """
    path, mesh = as_path(path), as_mesh(mesh)
    suffix = _known_suffix(path, {".npz", *_WRITERS, *_MESHIO})
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(path.parent))
    solid = isinstance(mesh, TetMesh)
    if solid and suffix in _WRITERS:
        raise FileFormatError(
            f"{path}: {suffix} holds surfaces only; write mesh.surface, or the solid as "
            f"{', '.join(suffixes(solid=True))}"
        )
    elements = mesh.T if isinstance(mesh, TetMesh) else mesh.F
    arrays = MeshArrays(
        mesh.V,
        F=None if solid else elements,
        T=elements if solid else None,
        point_data=checked(point_data, len(mesh.V), "point_data"),
        cell_data=checked(cell_data, len(elements), "cell_data"),
        corner_uv=checked_uv(corner_uv, suffix, elements),
    )
    if suffix in _WITHOUT_DATA and (arrays.point_data or arrays.cell_data):
        names = [*arrays.point_data, *arrays.cell_data]
        _log.info("%s holds no arrays, left out: %s", path, ", ".join(names))
        arrays = MeshArrays(arrays.V, arrays.F, arrays.T, corner_uv=arrays.corner_uv)
    with atomic_path(path) as temporary:
        if suffix in _MESHIO:
            try:
                write_meshio(temporary, arrays, _MESHIO[suffix])
            except FileFormatError as error:
                raise FileFormatError(f"{path}: {error}") from error
        else:
            with open(temporary, "wb") as file:
                if suffix == ".npz":
                    write_npz(file, arrays)
                else:
                    _WRITERS[suffix](file, arrays)


def _known_suffix(path: Path, known: set[str]) -> str:
    suffix = path.suffix.lower()
    if suffix not in known:
        raise FileFormatError(
            f"{path}: unknown format {suffix or '(no suffix)'}; known are "
            f"{', '.join(suffixes(solid=False))}"
        )
    return suffix
