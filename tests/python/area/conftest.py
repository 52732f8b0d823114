"""A small bumpy torus with uneven triangles, and what the energies on it need."""

from __future__ import annotations

import numpy as np
import pytest

from shapes import torus_grid
from stretchmap import TriMesh, _core
from stretchmap.area.map import area_map
from stretchmap.conformal.map import conformal_map


@pytest.fixture(scope="module")
def bumpy() -> TriMesh:
    """A small bumpy torus with uneven triangles."""
    mesh = torus_grid(24, 16, 2.2)
    rng = np.random.default_rng(5)
    x, y, z = mesh.V.T
    bump = 1.0 + 0.25 * np.sin(3.0 * np.arctan2(y, x)) * np.cos(2.0 * z) + 0.02 * rng.random(len(x))
    return TriMesh(mesh.V * bump[:, None], mesh.F)


@pytest.fixture(scope="module")
def chart(bumpy: TriMesh) -> _core.area.SurfaceChart:
    return _core.area.SurfaceChart(bumpy.topology, conformal_map(bumpy).forms)


@pytest.fixture(scope="module")
def turns(bumpy: TriMesh) -> np.ndarray:
    rng = np.random.default_rng(1)
    conformal = conformal_map(bumpy)
    return conformal.turns + 1e-3 * rng.normal(size=conformal.turns.shape)


@pytest.fixture(scope="module")
def glide(
    bumpy: TriMesh, chart: _core.area.SurfaceChart
) -> tuple[_core.area.GlideProblem, np.ndarray]:
    rng = np.random.default_rng(2)
    result = area_map(bumpy, finish="none", sem_iter=2)
    reference = _core.area.SurfaceReference(bumpy.V, bumpy.F)
    angles = result.angles + 5e-3 * rng.normal(size=result.angles.shape)
    return _core.area.GlideProblem(chart, reference, result.ratio), angles
