"""
3 - Coordinates and hexahedra
=============================

Solid-torus coordinates at any point, the way back, and a structured hexahedral mesh.

Run: python examples/03_coordinates_and_grid.py [grid.vtu]
"""

import sys

import numpy as np

import stretchmap as sm
from stretchmap import plot
from stretchmap.resample.hexes import hex_mesh
from stretchmap.samples import vertebra_like

solid = vertebra_like(5_000)
result = sm.volume_map(solid)
points = result.mesh.V[result.mesh.T].mean(axis=1)
u, v, s = result.coordinates(points).T
print(f"{len(points)} points: s / r from {s.min() / result.torus.r:.3f} to "
      f"{s.max() / result.torus.r:.3f}")  # fmt: skip

there = result.forward(points)
back = result.inverse(there)
size = np.linalg.norm(np.ptp(solid.V, axis=0))
print(f"there and back: {np.abs(back - points).max() / size:.1e} of the size")
assert np.abs(back - points).max() < 1e-9 * size
assert np.isnan(result.forward([[1e3, 0.0, 0.0]])).all()  # outside: told, not guessed

# %%
# The angle round the tube, on the boundary and inside.
angle = plot.cutaway(result)

# %%
# A grid of the solid torus pulled back.
grid = hex_mesh(result, sections=24, block=2, rings=2)
print(grid.summary())
assert grid.n_invalid == 0
if len(sys.argv) > 1:
    grid.save(sys.argv[1])
