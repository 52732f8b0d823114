"""Triangle and tetrahedral meshes: their diagnosis, refinement, and filling with tets."""
