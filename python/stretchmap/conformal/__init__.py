"""The conformal map of a genus-one surface to a flat torus (Algorithm 3.1)."""
