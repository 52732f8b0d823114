"""A solid and one deformed at random."""

from __future__ import annotations

import numpy as np
import pytest

from linear_systems import area_vectors, assemble_blocks, cube, neo_hookean


@pytest.fixture(scope="module")
def solid():
    """A cube of 2744 cells: points, tets, inner vertices."""
    return cube(14)


@pytest.fixture(scope="module")
def deformed_solid():
    """The Hessian of a deformed cube whose surface is held, for a given Poisson ratio."""
    points, tets, inner = cube(8)
    image = points + 0.08 * np.sin(2 * np.pi * points[:, [1, 2, 0]])
    image += 0.003 * np.random.default_rng(3).standard_normal(points.shape)
    assert (area_vectors(image, tets)[1] > 0).all()
    held = np.setdiff1d(np.arange(len(points)), inner)
    missing = (3 * held[:, None] + np.arange(3)).ravel()

    def system(poisson):
        local = neo_hookean(points, tets, image, poisson)
        return assemble_blocks(local, tets, len(points), missing), image, missing

    return system
