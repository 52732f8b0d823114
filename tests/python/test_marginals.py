"""Volumes between level surfaces: equalised marginals against exact cuts and a known distortion."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import _core, samples
from stretchmap._marginals import Marginals

TORUS = sm.Torus(3.0, 1.0)


def marginals(solid, torus, held=False):
    shares = solid.tet_volumes / solid.tet_volumes.sum()
    return Marginals(solid.T, shares, solid.boundary_vertices, torus, held)


@pytest.mark.parametrize("axis", ["s", "u", "v"])
def test_a_known_shift_along_one_coordinate_is_undone(axis):
    """The image is the source moved by a smooth function of one coordinate."""
    solid = samples.solid_torus(60_000, R=3.0, r=1.0)
    u, v, s = TORUS.coordinates(solid.V)
    if axis == "s":
        moved = TORUS.xi(u, v, s * (1.0 + 0.05 * (1.0 - s)))
    elif axis == "u":
        moved = TORUS.xi(u + 0.03 * np.sin(u), v, s)
    else:
        moved = TORUS.xi(u, v + 0.03 * np.sin(2.0 * v), s)
    tool = marginals(solid, TORUS)
    back, first = tool.equalise(moved)
    for _ in range(3):
        back, last = tool.equalise(back)
    assert first > 0.004
    assert last < 0.05 * first
    before = np.linalg.norm(moved - solid.V, axis=1).max()
    # The constant of a turn is free, and the mean of the levels' shifts is not that of the volume.
    assert np.linalg.norm(back - solid.V, axis=1).max() < 0.25 * before


def test_the_torus_is_mapped_to_itself_and_a_held_boundary_stays():
    solid = samples.solid_torus(20_000, R=3.0, r=1.0)
    ids = solid.boundary_vertices
    u, v, s = TORUS.coordinates(solid.V)
    moved = TORUS.xi(u + 0.03 * np.sin(u), v, s * (1.0 + 0.05 * (1.0 - s)))
    free, _ = marginals(solid, TORUS).equalise(moved)
    assert np.abs(TORUS.coordinates(free[ids])[2] - 1.0).max() < 1e-12
    assert np.abs(free[ids] - moved[ids]).max() > 1e-3
    held, _ = marginals(solid, TORUS, held=True).equalise(moved)
    assert np.array_equal(held[ids], moved[ids])
    assert np.abs(held - moved).max() > 1e-3


def test_uncorrected_fifths_of_a_vertebra(load_solid):
    """The paper's cumulative errors for fifths, Table 7.1, are 0.06 to 0.17 per cent."""
    result = sm.volume_map(load_solid("vertebra_L3_ssm_16420"))
    assert result.certificate.certified
    for by in "suv":
        parts = sm.partition(result, 5, by)
        assert np.abs(parts.uncorrected_errors).max() < 1e-3
        assert np.abs(parts.errors).max() < 1e-12


def test_too_few_tets_change_nothing():
    solid = samples.solid_torus(400, R=3.0, r=1.0)
    tool = marginals(solid, TORUS)
    x, error = tool.equalise(solid.V)
    volumes = _core.signed_tet_volumes(x, solid.T)
    assert (volumes > 0.0).all()
    assert error < 0.1
