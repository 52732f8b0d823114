"""Writing meshes.

What is written goes to a temporary file beside the target first and is renamed at the end, so a
failure leaves nothing behind and never half a file.
"""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from numpy.typing import ArrayLike

from ..base.files import atomic_path
from ..base.options import as_path, shown
from ..errors import FileFormatError
from ..mesh.given import as_mesh
from ..mesh.meshes import TetMesh, TriMesh
from .arrays import MeshArrays, checked, checked_uv
from .formats import BY_MESHIO, WITHOUT_ARRAYS, known_suffix, suffixes
from .meshio import write_meshio
from .npz import write_npz
from .obj import write_obj
from .off import write_off
from .ply import write_ply
from .stl import write_stl
from .storable import medit_refs, storable

__all__ = ["write"]

_log = logging.getLogger("stretchmap")

_WRITERS: dict[str, Callable[[BinaryIO, MeshArrays], None]] = {
    ".obj": write_obj,
    ".off": write_off,
    ".ply": write_ply,
    ".stl": write_stl,
}


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
        One row per vertex, or per face or tet. Formats without arrays leave them out, with a
        warning; ``.mesh`` holds one array of regions. Numbers of a type that the format does not
        have are written as those of one that holds all their values.
    corner_uv : (m, 3, 2) array_like, optional
        Texture coordinates of the corners of the faces; ``.obj`` only. They may differ at one
        vertex (seam).

    Raises
    ------
    FileFormatError
        Unknown suffix, or the format cannot hold tets or texture coordinates.
    ArrayError
        An array with the wrong number of rows, not numeric, named like a mesh array, or of a type,
        a number of columns or a name that the format cannot hold.
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
    suffix = known_suffix(path)
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
        point_data=storable(suffix, checked(point_data, len(mesh.V), "point_data")),
        cell_data=storable(suffix, checked(cell_data, len(elements), "cell_data")),
        corner_uv=checked_uv(corner_uv, suffix, elements),
    )
    if suffix in WITHOUT_ARRAYS:
        arrays = _without_arrays(path, arrays)
    with atomic_path(path) as temporary:
        if suffix in BY_MESHIO:
            try:
                write_meshio(temporary, arrays, BY_MESHIO[suffix])
            except FileFormatError as error:
                raise FileFormatError(f"{path}: {error}") from error
        else:
            with open(temporary, "wb") as file:
                if suffix == ".npz":
                    write_npz(file, arrays)
                else:
                    _WRITERS[suffix](file, arrays)


def _without_arrays(path: Path, arrays: MeshArrays) -> MeshArrays:
    """The mesh with its references alone, or without them; a warning names what is left out."""
    given = arrays.point_data, arrays.cell_data
    if path.suffix.lower() == ".mesh":
        held = "one array of regions"
        (points, of_points), (cells, of_cells) = map(medit_refs, given)
    else:
        held, points, cells = "no arrays", {}, {}
        of_points, of_cells = map(list, given)
    left_out = dict.fromkeys([*of_points, *of_cells])
    if left_out:
        _log.warning(
            "%s: %s files hold %s; left out: %s",
            path, path.suffix.lower(), held, ", ".join(map(shown, left_out)),
        )  # fmt: skip
    return replace(arrays, point_data=points, cell_data=cells)
