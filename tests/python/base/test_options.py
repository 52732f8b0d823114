"""Options are what they say or are refused by name."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from stretchmap.base import options
from stretchmap.errors import FileFormatError, OptionError


class Awkward:
    """Cannot even be shown."""

    def __repr__(self):
        raise RuntimeError("no")

    __str__ = __float__ = __index__ = __repr__


@pytest.mark.parametrize("value", [3, np.int8(3), np.uint64(3), np.array(3)])
def test_whole_numbers(value):
    assert options.whole("n", value, 1, 10) == 3


@pytest.mark.parametrize(
    "value",
    [0, 11, -1, 2**64, 10**400, 3.0, True, np.True_, "3", b"3", None, 3j, math.nan, [3], object()],
)
def test_what_is_no_whole_number_of_the_range(value):
    with pytest.raises(OptionError, match=r"^n must be"):
        options.whole("n", value, 1, 10)


@pytest.mark.parametrize("value", [3, 3.0, np.float32(3), np.array(3.0), Fraction(3), Decimal(3)])
def test_real_numbers(value):
    assert options.real("x", value, 0.0, above=0.0) == 3.0


@pytest.mark.parametrize(
    "value",
    [0.0, -1.0, 10.0, math.nan, math.inf, 10**400, True, "3", b"3", None, 3j, np.complex64(3), [3],
     np.ones(1), object(), Awkward],
)  # fmt: skip
def test_what_is_no_real_number_of_the_range(value):
    with pytest.raises(OptionError, match=r"^x must be"):
        options.real("x", value, above=0.0, below=10.0)


def test_words_flags_and_objects():
    assert options.one_of("h", "a", ("a", "b")) == "a"
    assert options.flag("f", np.False_) is False
    assert options.instance("o", 1.5, float, "a number") == 1.5
    for bad in ("c", b"a", None, 1, ["a"], np.array("a"), {}):
        with pytest.raises(OptionError, match="h must be 'a' or 'b'"):
            options.one_of("h", bad, ("a", "b"))
    for bad in (1, 0, "yes", None, np.ones(1, bool)):
        with pytest.raises(OptionError, match="f must be True or False"):
            options.flag("f", bad)
    with pytest.raises(OptionError, match=r"o must be a float \(a number\), got 'x'"):
        options.instance("o", "x", float, "a number")


def test_paths():
    assert options.as_path("a.npz") == options.as_path(Path("a.npz")) == Path("a.npz")
    for bad in (0, None, b"a.npz", "a\0.npz", "", "\ud800.npz", 1.5, ["a"], Awkward()):
        with pytest.raises(FileFormatError, match="named by a path"):
            options.as_path(bad)


def test_memory_that_is_not_there():
    options.memory("a grid", 1e6)
    with pytest.raises(OptionError, match=r"a grid would need about 9.31e\+05 GiB of memory"):
        options.memory("a grid", 1e15)
