"""Newton steps do not depend on the unit of the energy."""

from __future__ import annotations

import numpy as np

import stretchmap as sm
from stretchmap import _core


def test_a_scaled_energy_is_minimized_by_the_same_steps():
    """By a power of two: the same bits. The linear solver compares what its preconditioner promises
    with what is gained, which only means something if both are on one scale."""
    solid = sm.samples.bumpy_torus(4000)
    motion = np.zeros(solid.n_vertices, np.uint8)
    motion[solid.boundary_vertices] = 1
    rest = _core.volume.rest_matrices(solid.V, solid.T, 100.0)
    start = np.ascontiguousarray(solid.V * np.where(motion[:, None] == 1, 1.0, [1.05, 1.0, 0.95]))
    ends = []
    for scale in (1.0, 2.0**30, 2.0**-30):
        newton = _core.volume.SolidNewton(
            solid.V,
            tets=solid.T,
            rest=rest,
            weights=np.full(solid.n_tets, scale / solid.n_tets),
            motion=motion,
        )
        x, step = newton.step(start, _core.volume.EnergyWeights(1.0, 100.0, 0.0, 0.0))
        ends.append((x.tobytes(), step.cg_iterations, step.alpha))
    assert step.alpha > 0.0 and step.cg_iterations > 1
    assert ends[0] == ends[1] == ends[2]
