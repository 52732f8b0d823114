"""Meshes and fields from files and into them."""

from .arrays import MeshArrays
from .formats import suffixes
from .reading import read, read_arrays, read_solid, read_surface
from .writing import write

__all__ = [
    "MeshArrays",
    "read",
    "read_arrays",
    "read_solid",
    "read_surface",
    "suffixes",
    "write",
]
