"""
5 - Fields and morphs
=====================

Carry a field from one solid to another with its integral, and morph one into the other.

Run: python examples/05_morph_and_transfer.py [morph.pvd | morph.gif]
"""

import sys

import numpy as np

import stretchmap as sm
from stretchmap.plot.morphing import morph
from stretchmap.plot.populations import surface_field
from stretchmap.resample.fields import transfer
from stretchmap.samples import vertebra_pair

pair = vertebra_pair(n_landmarks=24, n_tets=(3000, 4000))
result = sm.register(pair.source, pair.target, (pair.source_landmarks, pair.target_landmarks))

density = 1.0 + np.exp(-((result.mesh.V[:, 0] - 2.0) ** 2))
integral = (result.mesh.tet_volumes * density[result.mesh.T].mean(axis=1)).sum()
carried = transfer(result, density)
print(f"integral {integral:.6f} before, {(pair.target.tet_volumes * carried).sum():.6f} after")
assert np.isclose((pair.target.tet_volumes * carried).sum(), integral, rtol=1e-12)
before = surface_field(result.mesh, density[result.mesh.T].mean(axis=1), "density of the source")
after = surface_field(pair.target, carried, "density carried to the target")

# %%
# Frames on the way, none with a tet turned over.
frames = morph(result, frames=7)
print(frames.summary())
some = frames.picture(4)
if len(sys.argv) > 1:
    print("\n".join(str(path) for path in frames.save(sys.argv[1])))
