"""
2 - Parts of equal volume
=========================

Divide a solid into shells, sectors and cells of prescribed volume.

Run: python examples/02_partition_into_fifths.py [parts.vtu]
"""

import sys

import numpy as np

import stretchmap as sm
from stretchmap import plot
from stretchmap.samples import bumpy_torus

result = sm.volume_map(bumpy_torus(6_000))
sectors = plot.levels(result, by="u")

# %%
# The volume that the levels of the image miss is the distortion of the map; moving them removes it.
for by in ("s", "u", "v"):
    parts = sm.partition(result, 5, by)
    print(parts.summary(), end="\n\n")
    assert np.abs(parts.errors).max() < 1e-12

# %%
# Cells of a grid: levels of the second coordinate differ between the parts of the first, so that
# every cell has exactly the volume asked for.
cells = sm.partition(result, (6, [0.5, 0.5]), ("u", "s"))
print(cells.summary())
assert cells.n_parts == 12 and np.abs(cells.errors).max() < 1e-12
if len(sys.argv) > 1:
    cells.save(sys.argv[1])
