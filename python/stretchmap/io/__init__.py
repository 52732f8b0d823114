"""Meshes and fields from files and into them."""

from .arrays import MeshArrays
from .read_write import read, read_arrays, read_solid, read_surface, suffixes, write

__all__ = [
    "MeshArrays",
    "read",
    "read_arrays",
    "read_solid",
    "read_surface",
    "suffixes",
    "write",
]
