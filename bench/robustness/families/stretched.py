"""One axis stretched a hundred times."""

from __future__ import annotations

import numpy as np
from curves import random_rotation
from surfaces import fill

from stretchmap import TetMesh

from . import Family, tubes


def stretched(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """A tube with branches, filled with well-shaped tets and then stretched."""
    solid = fill(tubes.even_tubes(rng, n_tets))
    V = solid.V @ random_rotation(rng).T * np.array([100.0, 1.0, 1.0])
    return TetMesh(V @ random_rotation(rng).T, solid.T)


FAMILIES = (Family("stretched", "tubes, one axis stretched 100 times", False, stretched),)
