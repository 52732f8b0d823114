"""
1 - A certified map of a solid
==============================

Map a solid shaped like a vertebra onto the solid torus, look at the figures, save the map and prove
it anew from the file.

Run: python examples/01_map_a_solid.py [map.npz]
"""

import sys

import stretchmap as sm
from stretchmap import plot

solid = sm.samples.vertebra_like(6_000)
result = sm.volume_map(solid)
print(result.summary())
assert result.certificate.certified and result.distortion.flips == 0

# %%
# Five shells of equal volume, in the solid and in its image, laid open in steps.
shells = plot.levels(result, by="s")

# %%
# How far the volumes of single tets are from equal shares, before and after.
ratios = plot.ratios(result)

# %%
# A certificate does not depend on who made the map: it can be had for a file.
if len(sys.argv) > 1:
    result.save(sys.argv[1])
    print(sm.certify_file(sys.argv[1]).summary())
