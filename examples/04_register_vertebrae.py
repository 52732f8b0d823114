"""
4 - One bone onto another
=========================

Register two synthetic vertebrae by 30 landmarks and compare with the true correspondence.

Run: python examples/04_register_vertebrae.py [registration.npz]
"""

import sys

import numpy as np

import stretchmap as sm
from stretchmap import plot
from stretchmap.samples import vertebra_pair

pair = vertebra_pair(n_landmarks=30, n_tets=(12_000, 15_000))
size = np.linalg.norm(np.ptp(pair.target.V, axis=0))
skin = pair.source.boundary_vertices
inner = np.setdiff1d(np.arange(pair.source.n_vertices), skin)
edge = np.linalg.norm(np.diff(pair.target.V[pair.target.edges], axis=1), axis=2).mean() / size


def errors(result):
    """Distance of each vertex' image from the true place, as a share of the target's size."""
    image = result.image[: pair.source.n_vertices]
    return np.linalg.norm(image - pair.truth, axis=1) / size


free = sm.register(pair.source, pair.target)
guided = sm.register(pair.source, pair.target, (pair.source_landmarks, pair.target_landmarks))
print(guided.summary())
same_colors = plot.registration(guided)

# %%
# Both against the truth.

print("\ndistance from the true correspondence, in per cent of the target's size")
print(f"(an edge of its mesh is {100 * edge:.1f} % on average)")
print("                      surface mean  worst   inside mean  worst   at landmarks")
for name, result in (("without landmarks", free), ("with 30 landmarks", guided)):
    e = 100 * errors(result)
    print(
        f"{name:20}  {e[skin].mean():12.2f}  {e[skin].max():5.2f}  {e[inner].mean():12.2f}"
        f"  {e[inner].max():5.2f}  {e[pair.source_landmarks].max():13.2g}"
    )
moved = sm.distortion(pair.source, pair.truth).element_error_mean
print(
    f"(the true correspondence changes shares of volume by {100 * moved:.0f} % on average,"
    " a registration does not)"
)

assert guided.certificate.certified and guided.landmark_error < 1e-6
# Landmarks are on the surface, and it is the surface they bring nearer to the truth.
assert max(errors(guided).mean(), errors(free).mean()) < edge
assert errors(guided)[skin].mean() < errors(free)[skin].mean()
if len(sys.argv) > 1:
    guided.save(sys.argv[1])
