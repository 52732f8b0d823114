"""Values no argument of a kind may have, by kind."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from typing import Any

import numpy as np

GRID = np.arange(12.0).reshape(4, 3)


class Evil:
    """Fails at whatever is asked of it, each time with an error of its own."""

    def _fail(self, *args: Any, **keywords: Any) -> Any:
        raise ZeroDivisionError("evil")

    __array__ = __bool__ = __float__ = __fspath__ = __index__ = __int__ = __iter__ = _fail
    __len__ = __repr__ = __str__ = __getitem__ = __eq__ = __lt__ = __hash__ = _fail


def _itself() -> list[Any]:
    loop: list[Any] = []
    loop.append(loop)
    return loop


# Names, so that a job can be written down; functions, so that each call gets a fresh value.
_ANY: dict[str, Callable[[], Any]] = {
    "object": object,
    "evil": Evil,
    "bytes": lambda: b"\xff",
    "complex": lambda: 1 + 1j,
    "class": lambda: dict,
    "mapping": lambda: {"a": 1},
    "set": lambda: {1.0, 2.0},
    "generator": lambda: (i for i in range(3)),
    "date": lambda: datetime.date(2000, 1, 1),
    "itself": _itself,
    "not implemented": lambda: NotImplemented,
}
_SCALAR = {
    "nan": lambda: float("nan"),
    "infinity": lambda: float("inf"),
    "beyond floats": lambda: 10**400,
    "word": lambda: "nonsense",
    "empty word": lambda: "",
    "true": lambda: True,
    "ones": lambda: np.ones(3),
    "no array": lambda: np.zeros(0),
    "list": lambda: [1.0],
    "masked": lambda: np.ma.masked,
    "numpy nan": lambda: np.float64("nan"),
    "objects": lambda: np.array([None, "a"], object),
}
_NOT_WHOLE = {
    "one and a half": lambda: 1.5,
    "two as a float": lambda: 2.0,
    "minus one": lambda: -1,
    "2^31": lambda: 2**31,
    "2^64": lambda: 2**64,
    "10^9": lambda: 10**9,
}
_NO_ARRAY = {
    "masked": lambda: np.ma.masked_less(GRID, 2.0),
    "complex": lambda: GRID + 1j,
    "truth": lambda: GRID > 2,
    "text": lambda: GRID.astype(str),
    "objects": lambda: GRID.astype(object),
    "dates": lambda: GRID.astype("M8[s]"),
    "ragged": lambda: [[1.0, 2.0, 3.0], [1.0]],
    "nan": lambda: np.full((4, 3), np.nan),
    "infinity": lambda: np.full((4, 3), np.inf),
    "five axes": lambda: np.zeros((1, 1, 1, 1, 1)),
    "no rows": lambda: np.zeros((0, 3)),
    "a number": lambda: 3.0,
    "a word": lambda: "points",
    "beyond floats": lambda: [[10**400, 0, 0]] * 4,
    "wide": lambda: np.zeros((4, 7)),
}
# Of these a function of arrays of any shape has to see that they are no numbers.
_NO_NUMBERS = ("masked", "complex", "truth", "text", "objects", "dates", "ragged", "nan")
_NO_NUMBERS += ("infinity", "a word", "beyond floats")
_NO_OBJECT = {
    "a number": lambda: 1.0,
    "a word": lambda: "nonsense",
    "an array": lambda: GRID,
    "a list": lambda: [1, 2],
    "true": lambda: True,
}
_NO_PATH = {
    "null": lambda: "a\0b.npz",
    "a file number": lambda: 0,
    "nan": lambda: float("nan"),
    "a list": lambda: ["a.npz"],
    "a long name": lambda: "x" * 5000 + ".npz",
    "a folder that is not there": lambda: "nowhere/at/all.npz",
    "a lone surrogate": lambda: "\udcff\ud800.npz",
    "no suffix": lambda: "name",
    "empty": lambda: "",
}
_SOUND_FOLDERS = ("a folder that is not there", "no suffix")  # are made

_FRACTIONS = {
    "one part": lambda: 1,
    "no part": lambda: 0,
    "minus one": lambda: -1,
    "10^9 parts": lambda: 10**9,
    "2^64 parts": lambda: 2**64,
    "two as a float": lambda: 2.0,
    "one share": lambda: [1.0],
    "shares beyond one": lambda: [0.5, 0.6],
    "a share below zero": lambda: [1.5, -0.5],
    "nan shares": lambda: [float("nan"), 0.5],
    "infinite shares": lambda: [float("inf"), 0.5],
    "nested shares": lambda: [[0.5, 0.5], [0.5, 0.5]],
    "shares in words": lambda: ["0.5", "0.5"],
    "true": lambda: True,
    "a word": lambda: "5",
    "masked": lambda: np.ma.masked_less([0.5, 0.5, 0.0], 0.1),
}
_PAIR = {
    "a word": lambda: "ab",
    "a number": lambda: 4,
    "three": lambda: (4, 4, 4),
    "one": lambda: (4,),
    "floats": lambda: (4.5, 4.5),
    "nan": lambda: (float("nan"), 4),
    "words": lambda: ("4", "4"),
    "minus": lambda: (-4, -4),
    "10^9": lambda: (10**9, 10**9),
    "2^64": lambda: (2**64, 4),
    "none": lambda: None,
    "truth": lambda: (True, True),
}
_NONE = {"none": lambda: None}

# An argument that may be left out is never given None; kinds with a "?" take it.
HOSTILE: dict[str, dict[str, Callable[[], Any]]] = {
    "whole": _ANY | _SCALAR | _NOT_WHOLE | _NONE,
    "seed": _ANY | _SCALAR | _NONE | {"a half": lambda: 0.5, "minus one": lambda: -1},
    "real": _ANY | _SCALAR | _NONE,
    "positive": _ANY | _SCALAR | _NONE | {"zero": lambda: 0.0, "minus one": lambda: -1.0},
    "share": _ANY | _SCALAR | _NONE | {"minus one": lambda: -1.0},
    "flag": _ANY | _SCALAR | _NONE | {"one": lambda: 1},
    "word": _ANY | _SCALAR | _NONE | {"zero": lambda: 0},
    "array": _ANY | _NO_ARRAY | _NONE,
    "numbers": _ANY | {name: _NO_ARRAY[name] for name in _NO_NUMBERS} | _NONE,
    "object": _ANY | _NO_OBJECT | _NONE,
    "progress": _ANY | _NO_OBJECT,
    "path": _ANY | _NO_PATH | _NONE,
    "folder": {k: v for k, v in (_ANY | _NO_PATH).items() if k not in _SOUND_FOLDERS},
    "arrays": _ANY | _NO_OBJECT | {"of nothing": lambda: {"a": None}, "no name": lambda: {1: GRID}},
    "fractions": _ANY | _FRACTIONS | _NONE,
    "pair": _ANY | _PAIR,
}
HOSTILE["steps"] = {name: make for name, make in HOSTILE["whole"].items() if name != "10^9"}
HOSTILE["gaps"] = {name: make for name, make in HOSTILE["numbers"].items() if name != "nan"}
HOSTILE["ceiling"] = {k: v for k, v in HOSTILE["positive"].items() if k != "infinity"}
del HOSTILE["flag"]["true"]
del HOSTILE["progress"]["class"]  # it can be called
