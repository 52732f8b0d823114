"""The area-preserving map of a genus-one surface (Algorithm 4.1)."""
