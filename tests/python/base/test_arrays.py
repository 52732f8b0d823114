"""Arrays come in as numbers of the right shape or not at all."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from stretchmap.base.arrays import as_indices, as_integers, as_points, as_reals, describe
from stretchmap.errors import ArrayError, IndexRangeError, NonFiniteError


class Explosive:
    """An object whose conversion fails in a way of its own."""

    def __array__(self, *args, **keywords):
        raise RuntimeError("boom")


GRID = np.arange(12.0).reshape(4, 3)
NO_NUMBERS = {
    "masked": np.ma.masked_less(GRID, 2.0),
    "masked rows": list(np.ma.masked_less(GRID, 2.0)),
    "complex": GRID + 1j,
    "truth": GRID > 2,
    "text": GRID.astype(str),
    "bytes": GRID.astype("S8"),
    "objects": GRID.astype(object),
    "dates": GRID.astype("M8[s]"),
    "records": np.zeros(4, "f8,f8,f8"),
    "ragged": [[1.0, 2.0, 3.0], [1.0]],
    "nothing": None,
    "a word": "points",
    "a mapping": {"x": 1.0},
    "explosive": Explosive(),
    "huge": [[10**400, 0, 0]] * 4,
}


@pytest.mark.parametrize("name", NO_NUMBERS)
def test_no_numbers(name):
    for convert in (
        lambda a: as_reals(a, "a", (4, 3)),
        lambda a: as_integers(a, "a", (4, 3)),
        lambda a: as_points(a, "a"),
        lambda a: as_indices(a, 3, 99, "a"),
    ):
        with pytest.raises(ArrayError, match="a "):
            convert(NO_NUMBERS[name])


@pytest.mark.filterwarnings("ignore:Warning. converting a masked element")
def test_a_masked_entry_of_a_list_is_no_nan():
    with pytest.raises(ArrayError, match="a has masked entries"):
        as_reals([1.0, np.ma.masked], "a", (2,), finite=False)


def test_a_conversion_leaves_the_filters_of_warnings_alone():
    """They belong to the process: threads that overlap would restore those of one another."""
    seen = []

    class Lazy:
        def __array__(self, *args, **keywords):
            seen.append(list(warnings.filters))
            return GRID

    as_points(Lazy())
    assert seen == [warnings.filters]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite(value):
    bad = GRID.copy()
    bad[2, 1] = value
    for convert in (as_points, lambda a: as_reals(a, "a", (4, 3))):
        with pytest.raises(NonFiniteError) as caught:
            convert(bad)
        assert caught.value.ids == (2,)
    assert np.isnan(as_reals(np.nan, "a", (), finite=False))


def test_numbers_beyond_double_precision():
    if np.longdouble(1e300) * 1e100 == np.inf:
        pytest.skip("long double is double here")
    with pytest.raises(NonFiniteError, match="double precision"):
        as_points(np.full((4, 3), np.longdouble(1e300) * 1e100))


def test_coordinates_whose_volumes_are_no_numbers():
    points = np.zeros((4, 3))
    points[2] = 1e46
    with pytest.raises(ArrayError, match=r"V has coordinates beyond 1e\+45 at vertex 2") as caught:
        as_points(points)
    assert caught.value.ids == (2,)
    as_points(0.01 * points)


def test_shapes():
    assert as_reals(GRID.astype(np.float32), "a", (None, 3)).dtype == np.float64
    assert as_reals(GRID.T[::2], "a", (2, 4)).flags.c_contiguous
    with pytest.raises(ArrayError, match=r"a must have shape \(any, 2\), not \(4, 3\)"):
        as_reals(GRID, "a", (None, 2))
    with pytest.raises(ArrayError, match=r"a must have shape \(5,\), not \(4, 3\)"):
        as_integers(GRID.astype(int), "a", (5,))


def test_integers():
    assert as_integers([1, -2], "a", (2,)).tolist() == [1, -2]
    with pytest.raises(ArrayError, match="must hold integers, not float64"):
        as_integers([1.0, 2.0], "a", (2,))
    for big in (2**32 + 1, -(2**31), 2**63, 2**64 - 1):
        with pytest.raises(IndexRangeError, match=f"row 1 does not: {big}") as caught:
            as_integers(np.array([0, big], np.int64 if big < 2**63 else np.uint64), "a", (2,))
        assert caught.value.ids == (1,)


@pytest.mark.parametrize(
    ("what", "said"),
    [("face", "2 faces (0, 1)"), ("boundary vertex", "2 boundary vertices (0, 1)")],
)
def test_ids_are_named_in_english(what, said):
    assert describe(what, [0, 1]) == said and describe(what, [7]) == f"{what} 7"
