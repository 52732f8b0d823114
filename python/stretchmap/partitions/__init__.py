"""Solids cut into parts of prescribed volume."""
