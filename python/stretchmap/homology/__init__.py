"""Loops of a surface: homology basis, handle and tunnel loops, integer arithmetic."""
