"""Classes and loops are integers of this surface, or refused."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import TetMesh, homology_basis, samples
from stretchmap.errors import ArrayError, IndexRangeError, KindError, OptionError


@pytest.fixture(scope="module")
def basis():
    return homology_basis(samples.torus_surface(12, 8))


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ([1.9, 0], ArrayError, "must hold integers, not float64"),
        ([0.5, 0], ArrayError, "must hold integers"),
        ([np.nan, 0], ArrayError, "must hold integers"),
        ([1.0, 0.0], ArrayError, "must hold integers"),
        ([True, False], ArrayError, "truth values"),
        (["1", "0"], ArrayError, "text"),
        ([1 + 0j, 0], ArrayError, "complex"),
        ([2**32 + 1, 0], IndexRangeError, "between -100 and 100, row 0"),
        ([0, -(2**31)], IndexRangeError, "row 1"),
        ([10**30, 0], ArrayError, "Python objects"),
        ([1], ArrayError, r"shape \(2,\)"),
        ([[1, 0]], ArrayError, r"shape \(2,\)"),
        ([0, 0], ArrayError, "not all zero"),
        (None, ArrayError, "coefficients"),
    ],
)
def test_what_is_no_class(basis, given, error, words):
    with pytest.raises(error, match=words):
        basis.shortest_loop(given)


def test_any_integer_type_is_a_class(basis):
    loop = basis.shortest_loop([1, 0])
    for kind in (np.int8, np.int64, np.uint16, ">i4"):
        assert np.array_equal(basis.shortest_loop(np.array([1, 0], kind)), loop)


@pytest.mark.parametrize("method", ["length", "classes"])
def test_what_is_no_loop(basis, method):
    measure = getattr(basis, method)
    loop = basis.generators[0]
    measure(loop.tolist())
    for bad, error in (
        (loop + 1000, IndexRangeError),
        (-loop - 1, IndexRangeError),
        (loop.astype(np.int64) + 2**32, IndexRangeError),
        (loop.astype(float), ArrayError),
        (loop[:, None], ArrayError),
        (None, ArrayError),
    ):
        with pytest.raises(error):
            measure(bad)


def test_the_solid_has_to_be_that_of_the_surface():
    solid = samples.solid_torus(400)
    other = TetMesh(2.0 * solid.V, solid.T)
    with pytest.raises(KindError, match=r"rows of V differ; pass solid\.surface"):
        homology_basis(other.surface, solid)
    with pytest.raises(KindError, match=r"its boundary is \.surface"):
        homology_basis(solid)
    with pytest.raises(KindError, match="a TetMesh is needed"):
        homology_basis(solid.surface, solid.surface)


def test_a_basis_or_conformal_map_of_another_surface_is_refused():
    surface = samples.torus_surface(12, 8)
    other = samples.torus_surface(12, 8, R=4.0)
    basis = homology_basis(other)
    for use in (sm.harmonic_forms, sm.holomorphic_forms, sm.conformal_map, sm.area_map):
        with pytest.raises(KindError, match="basis is of another surface: 96 rows of V differ"):
            use(surface, basis=basis)
        with pytest.raises(OptionError, match="basis must be a HomologyBasis"):
            use(surface, basis=surface)
    with pytest.raises(KindError, match="conformal map is of another surface"):
        sm.area_map(surface, conformal=sm.conformal_map(other))
