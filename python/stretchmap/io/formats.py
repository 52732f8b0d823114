"""The formats of mesh files, by their suffixes.

============================  =========  ======================================================
format                        holds      remarks
============================  =========  ======================================================
``.npz``                      both       ``V`` with ``F`` or ``T``, further arrays by their names
``.obj``                      surfaces   texture coordinates per corner (seams)
``.off``                      surfaces
``.ply``                      surfaces   point and cell arrays as properties
``.stl``                      surfaces   single precision; equal corners become one vertex
``.vtu .vtk .xdmf .msh``      both       point and cell arrays; through meshio
``.mesh``                     both       one reference per point and per cell; through meshio
``.vtp``                      surfaces   read only; through PyVista, as what meshio does not know
``.glb .gltf .3mf``           surfaces   read only; through trimesh, parts joined and welded
============================  =========  ======================================================
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..errors import FileFormatError

__all__ = ["BY_MESHIO", "BY_TRIMESH", "OF_SURFACES", "WITHOUT_ARRAYS", "known_suffix", "suffixes"]

# Read and written here, beside .npz.
OF_SURFACES = (".obj", ".off", ".ply", ".stl")
# Suffix -> meshio's name of the format.
BY_MESHIO = {".msh": "gmsh", ".vtu": "vtu", ".vtk": "vtk", ".mesh": "medit", ".xdmf": "xdmf"}
BY_TRIMESH = (".glb", ".gltf", ".3mf")
# Of those written, what holds no arrays, or nothing but references.
WITHOUT_ARRAYS = (".obj", ".off", ".stl", ".mesh")


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
    return (".npz", *BY_MESHIO) if solid else (".npz", *OF_SURFACES, *BY_MESHIO)


def known_suffix(path: Path, further: Iterable[str] = ()) -> str:
    """The suffix in lower case.

    Parameters
    ----------
    path : Path
    further : iterable of str
        Suffixes that are good, too, beside those that are written.

    Raises
    ------
    FileFormatError
        It is not known.
    """
    suffix = path.suffix.lower()
    if suffix not in (*suffixes(solid=False), *further):
        raise FileFormatError(
            f"{path}: unknown format {suffix or '(no suffix)'}; known are "
            f"{', '.join(suffixes(solid=False))}"
        )
    return suffix
