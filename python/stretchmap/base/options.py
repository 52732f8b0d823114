"""Options at the edge: numbers, choices, flags and objects of a class, each refused by its name.

Python takes ``True`` for 1, ``"3"`` for true and a NaN for a number that no bound refuses; what an
option means is decided here and nowhere else.
"""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import FileFormatError, OptionError

__all__ = [
    "as_path",
    "callback",
    "flag",
    "instance",
    "memory",
    "one_of",
    "pair",
    "real",
    "shown",
    "whole",
]

_T = TypeVar("_T")

# What `float` takes all the same.
_NO_REALS = (bool, np.bool_, str, bytes, np.complexfloating, type(np.ma.masked))

# Of the core's linear systems; the last one in builds that have it.
SOLVERS = ("auto", "direct", "multigrid", "jacobi", "cholmod")


def whole(name: str, value: Any, low: int, high: int = 2**31 - 1) -> int:
    """The option as an integer from ``low`` to ``high``.

    Raises
    ------
    OptionError
        It is none: 2.0, True and "2" are not.
    """
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        number = operator.index(value)
    except Exception:  # whatever an object's own conversion raises
        raise OptionError(f"{name} must be an integer, got {shown(value)}") from None
    if number < low:
        raise OptionError(f"{name} must be at least {low}, got {shown(number)}")
    if number > high:
        raise OptionError(f"{name} must be at most {high}, got {shown(number)}")
    return number


def real(
    name: str,
    value: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: float = -math.inf,
    below: float = math.inf,
) -> float:
    """The option as a finite number with ``low <= value <= high`` and ``above < value < below``.

    Raises
    ------
    OptionError
        It is none.
    """
    number = math.nan
    if not isinstance(value, _NO_REALS) and not getattr(value, "shape", ()):
        try:
            number = float(value)
        except Exception:  # whatever an object's own conversion raises
            number = math.nan
    if not math.isfinite(number):
        raise OptionError(f"{name} must be a finite number, got {shown(value)}")
    if not (low <= number <= high and above < number < below):
        bounds = [(low, "at least"), (high, "at most"), (above, "above"), (below, "below")]
        words = [f"{word} {bound:g}" for bound, word in bounds if math.isfinite(bound)]
        raise OptionError(f"{name} must be {' and '.join(words)}, got {number:g}")
    return number


def one_of(name: str, value: Any, choices: Sequence[str]) -> Any:
    """The option, which is one of a few words.

    Raises
    ------
    OptionError
        It is another; names them all.
    """
    if not isinstance(value, str) or value not in choices:
        words = " or ".join([", ".join(map(repr, choices[:-1])), repr(choices[-1])])
        raise OptionError(f"{name} must be {words}, got {shown(value)}")
    return value


def flag(name: str, value: Any) -> bool:
    """The option as True or False.

    Raises
    ------
    OptionError
        It is neither, such as 1 or "no".
    """
    if not isinstance(value, (bool, np.bool_)):
        raise OptionError(f"{name} must be True or False, got {shown(value)}")
    return bool(value)


def instance(name: str, value: Any, kind: type[_T], remedy: str) -> _T:
    """The option as an object of a class.

    Raises
    ------
    OptionError
        It is of another; ``remedy`` says where one comes from.
    """
    if not isinstance(value, kind):
        raise OptionError(f"{name} must be a {kind.__name__} ({remedy}), got {shown(value)}")
    return value


def callback(name: str, value: Any) -> None:
    """Raise unless the option is None or can be called.

    Raises
    ------
    OptionError
        It is something else.
    """
    if value is not None and not callable(value):
        raise OptionError(f"{name} must be a function or None, got {shown(value)}")


def pair(name: str, value: Any, low: int, high: int = 2**31 - 1) -> tuple[int, int]:
    """The option as two integers, each as `whole`.

    Raises
    ------
    OptionError
        It is no tuple or list of two, or an entry is out of range.
    """
    if not isinstance(value, (tuple, list, np.ndarray)) or len(value) != 2:
        raise OptionError(f"{name} must be two integers, got {shown(value)}")
    return whole(f"{name}[0]", value[0], low, high), whole(f"{name}[1]", value[1], low, high)


def as_path(path: Any) -> Path:
    """A path as `open` takes it, but no file number and no bytes.

    Raises
    ------
    FileFormatError
        It is no path, or one that no file can have.
    """
    try:
        text = os.fspath(path)
        if isinstance(text, bytes) or not text or b"\0" in os.fsencode(text):
            raise TypeError
    except Exception:  # of an object with a path of its own, whatever that raises
        raise FileFormatError(f"a file is named by a path, got {shown(path)}") from None
    return Path(text)


def memory(what: str, wanted: float) -> None:
    """Refuse what would not fit into the memory of this machine.

    Parameters
    ----------
    what : str
        What needs it, for the message.
    wanted : float
        Bytes, as far as they can be told beforehand.

    Raises
    ------
    OptionError
        More than there is.
    """
    there = installed_memory()
    if wanted > there:
        raise OptionError(
            f"{what} would need about {wanted / 2**30:.3g} GiB of memory, this machine has "
            f"{there / 2**30:.3g} GiB"
        )


def installed_memory() -> float:
    """Bytes of memory, or what 32-bit ids can use of it where the system does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * float(os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return 2.0**40


def shown(value: Any) -> str:
    """A value in a message, whatever its size and its ``__repr__`` do."""
    if isinstance(value, int) and value.bit_length() > 256:
        return f"an integer of {value.bit_length()} bits"
    if isinstance(value, (str, int, float, complex, bool, type(None))):
        text = repr(value)
        return text if len(text) <= 60 else text[:57] + "..."
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    return f"an object of type {type(value).__name__}"
