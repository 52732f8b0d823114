"""Layers of prescribed thickness at the boundary of a grid."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import samples
from stretchmap.errors import OptionError, SolverError
from stretchmap.resample import hexes
from stretchmap.resample.hexes import hex_mesh
from stretchmap.resample.layout import swept_layout

TORUS = sm.Torus(3.0, 1.0)
NUMBERS = {"sections": 24, "block": 3}


@pytest.fixture(scope="module")
def result():
    solid = samples.solid_torus(6000, R=3.0, r=1.0)
    return a_map(solid, solid.V, TORUS)


@pytest.fixture(scope="module", autouse=True)
def grids_are_optimized_once() -> Iterator[None]:
    """All are of one solid; layers are added to what is optimized."""
    optimized, known = hexes.coarse_grid, {}

    def coarse_grid(result, solid, candidates, *rest):
        which = candidates.tobytes()
        if which not in known:
            known[which] = optimized(result, solid, candidates, *rest)
        return known[which]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hexes, "coarse_grid", coarse_grid)
        yield


@pytest.mark.parametrize("rings", [1, 2])
def test_layers_have_their_thickness_and_the_rest_stays(result, rings):
    plain = hex_mesh(result, **NUMBERS, rings=rings)
    grid = hex_mesh(result, **NUMBERS, rings=rings, layers=[0.02, 0.05])
    assert grid.n_invalid == 0 and len(grid.H) == len(plain.H) + 2 * 24 * 12
    assert np.array_equal(grid.H, swept_layout(24, 3, rings + 2).H)
    assert grid.volume == pytest.approx(plain.volume, rel=1e-2)
    assert {tuple(p) for p in plain.V} <= {tuple(p) for p in grid.V}
    # Along the normals, which the torus has in closed form.
    per, around = len(grid.V) // 24, 12
    outer = (per * np.arange(24)[:, None] + np.arange(per - around, per)).ravel()
    for rows, thickness in ((around, 0.02), (2 * around, 0.07)):
        away = grid.V[outer] - grid.V[outer - rows]
        normal = TORUS.normal(*TORUS.coordinates(grid.V[outer])[:2])
        depth = (away * normal).sum(axis=1)
        assert np.allclose(depth, thickness, rtol=0.1)


def test_coordinates_follow_the_layers(result):
    grid = hex_mesh(result, **NUMBERS, rings=2, layers=[0.02])
    s = grid.coordinates[:, 2]
    first = np.unique(grid.H[grid.layer == 0])
    assert s[first].min() > 0.8 * s.max()


@pytest.mark.parametrize("layers", [[0.0], [-1.0], [np.nan], "thin", [[0.1]], 0.1])
def test_thicknesses_that_are_none_are_refused(result, layers):
    with pytest.raises(OptionError, match="layers"):
        hex_mesh(result, **NUMBERS, rings=2, layers=layers)


def test_layers_that_do_not_fit_are_refused_with_the_points(result):
    with pytest.raises(SolverError, match="thinner") as refused:
        hex_mesh(result, **NUMBERS, rings=2, layers=[5.0])
    assert len(refused.value.ids) > 0
