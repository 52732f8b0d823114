"""Meshes and fields from files and into them."""

from .arrays import MeshArrays
from .read_write import read, read_arrays, suffixes, write

__all__ = ["MeshArrays", "read", "read_arrays", "suffixes", "write"]
