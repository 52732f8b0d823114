"""
7 - A population of bones
=========================

From six vertebrae to their mean and the modes by which they differ, against what was planted.

Run: python examples/07_population.py [population.npz]
"""

import sys

import numpy as np

import stretchmap as sm
from stretchmap.plot import populations

bones = sm.samples.vertebra_population(6, seed=2, n_tets=1600)
found = sm.population.fit(bones.solids, max_rounds=2, tol=5e-3)
print(found.summary())
modes = populations.modes(found, 3)

# %%
# Four modes were planted; how many does it take?

measures = populations.compactness(found)
print(f"\nvariance in four modes: {100 * found.measures.compactness[4]:.1f} %")
planted = np.sqrt((bones.modes**2).sum(axis=(1, 2)) / bones.reference.n_vertices)
recovered = np.sqrt(found.model.variances / found.mean.n_vertices)
print("deviation per point, planted  ", planted.round(3))
print("                     recovered", recovered[:4].round(3))

# %%
# A field of every bone on the mean: here the place in the mean individual, which is the same for
# points that correspond. How far it varies is the error of the correspondence.

fields = {name: bones.material[int(name)][:, 0] for name in found.names}
statistics = sm.population.field_statistics(found, fields, conserve="value")
error = np.median(statistics.std) / np.linalg.norm(np.ptp(bones.reference.V, axis=0))
spread = populations.surface_field(found.mean, statistics.std, "deviation (unit of the shapes)")
print(f"\na point is found again within {100 * error:.2f} % of the size (median, along x)")

assert found.certificate.certified and not found.skipped
assert found.measures.compactness[4] > 0.95 and error < 0.01
if len(sys.argv) > 1:
    found.save(sys.argv[1])
