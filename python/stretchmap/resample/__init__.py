"""Structured hexahedra, and fields carried between solids."""
