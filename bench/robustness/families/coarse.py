"""Coarse meshes of fTetWild: a handful of tets, many with all vertices on the boundary."""

from __future__ import annotations

import numpy as np

from stretchmap import TetMesh
from stretchmap.preparation.wild import run_ftetwild

from . import Family, drilled, tubes


def coarse(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """A tube or a drilled body with edges of 5 to 25 % of its diagonal; its size is what it is."""
    if rng.random() < 0.5:
        surface = tubes.even_tubes(rng, min(n_tets, 8_000.0))
    else:
        surface = drilled.surface_of(drilled.drilled(rng))
    options = {
        "edge_length_fac": float(rng.uniform(0.05, 0.25)),
        "epsilon": float(rng.choice([1e-3, 3e-3])),
    }
    V, T = run_ftetwild(surface, options)
    solid, _ = TetMesh(V, T, orient=True).compact()
    return solid


FAMILIES = (Family("coarse", "coarse fTetWild meshes, all-boundary tets", False, coarse),)
