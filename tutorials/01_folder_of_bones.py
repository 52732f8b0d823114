"""
A folder of bones
=================

From a folder of meshes to the mean bone, the ways in which bones differ, and a statistic of a field
on all of them. Your own folder takes the place of the one made here.
"""

# %%
# Synthetic vertebrae stand in for segmented ones: every one has its own mesh, pose and size. If
# yours are surfaces or voxel masks, ``stretchmap prepare scan.stl -o bone.npz`` makes solids of
# them.

import tempfile
from pathlib import Path

import numpy as np

import stretchmap as sm
from stretchmap.plot import populations

folder = Path(tempfile.mkdtemp())
bones = sm.samples.vertebra_population(5, seed=3, n_tets=800)
for number, bone in enumerate(bones.solids):
    sm.write(folder / f"bone_{number}.npz", bone)
print(sorted(path.name for path in folder.iterdir()))

# %%
# Are they what they should be? A diagnosis lists every defect with the ids of the elements at
# fault; a solid torus has genus one and none.

solids = {path.stem: sm.read_solid(path) for path in sorted(folder.glob("*.npz"))}
for name, solid in solids.items():
    assert not solid.diagnose().defects, name
print(solids["bone_0"].diagnose().summary())

# %%
# One bone by itself: the certified map, and what it costs. ``progress=`` shows a bar while it runs,
# in a terminal as in a notebook.

with sm.progress_bar() as bar:
    result = sm.volume_map(solids["bone_0"], progress=bar)
print(result.certificate)
shells = result.plot("levels", by="s")
shells

# %%
# All of them: a template is laid on every bone, certified, until it is the mean. With ``folder=``
# the run leaves a record there and goes on where it was stopped; ``executor="processes:4"`` shares
# the work.

found = sm.population.fit(folder, max_rounds=1, tol=0.05)
print(found.summary())
assert not found.skipped

# %%
# What differs most, as a shape: the mean two deviations along the first mode, either way.

modes = populations.modes(found, 1)
modes

# %%
# Who is unlike the others? Nobody here.

print("outliers:", found.outliers() or "none")

# %%
# A field of every bone, such as a density from the scan, is carried to the mean, and tested there.
# Here it is one throughout but for noise, and higher on one side, which the statistic finds again.

rng = np.random.default_rng(0)
fields = {}
for name in solids:
    place = bones.material[int(name.rpartition("_")[2])][:, 0]
    fields[name] = 1.0 + 0.02 * rng.normal(size=len(place)) + 0.2 * (place > np.median(place))
statistics = sm.population.field_statistics(found, fields, conserve="value", against=1.0)
higher = statistics.p_adjusted < 0.05
print(f"higher than 1 beyond doubt: {higher.mean():.0%} of the tets")
assert 0.3 < higher.mean() < 0.7
picture = populations.surface_field(found.mean, statistics.t, "t against 1")
picture
