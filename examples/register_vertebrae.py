"""Register two synthetic vertebrae by 30 landmarks and compare with the true correspondence.

Run: python examples/register_vertebrae.py [registration.npz]
"""

import sys

import numpy as np

import stretchmap as sm
from stretchmap.samples import vertebra_pair

pair = vertebra_pair(n_landmarks=30, n_tets=(12_000, 15_000))
size = np.linalg.norm(np.ptp(pair.target.V, axis=0))


def error(result):
    """Mean distance from the truth, as a share of the size."""
    image = result.image[: pair.source.n_vertices]
    return np.linalg.norm(image - pair.truth, axis=1).mean() / size


free = sm.register(pair.source, pair.target)
guided = sm.register(pair.source, pair.target, (pair.source_landmarks, pair.target_landmarks))
print(guided.summary())
print(
    f"mean distance from the truth: {error(free):.4f} without, {error(guided):.4f} with landmarks"
)

assert guided.certificate.certified and guided.landmark_error < 1e-6
assert error(guided) < error(free) < 0.05
if len(sys.argv) > 1:
    guided.save(sys.argv[1])
