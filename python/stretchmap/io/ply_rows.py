"""Rows of numbers in the body of a PLY file, as text or as bytes of either order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError

__all__ = ["Bytes", "Words"]

_LONGEST = 64  # letters of a number


class Words:
    """The body of a text file: every number is one unit long, wherever lines end."""

    def __init__(self, body: bytes) -> None:
        words = body.split()
        if max(map(len, words), default=0) > _LONGEST:
            raise FileFormatError(f"a word of more than {_LONGEST} letters among the numbers")
        self._words = np.array(words, np.bytes_)

    def __len__(self) -> int:
        return len(self._words)

    def follows(self, at: int) -> bool:
        """Whether something stands there or behind."""
        return at < len(self._words)

    def size(self, kind: str) -> int:
        """Units a number takes."""
        return 1

    def count(self, kind: str, at: int) -> int:
        """The whole number there."""
        return int(self._words[at])

    def block(self, rows: int, at: int, width: int) -> NDArray[Any]:
        """(rows, width) units from there on."""
        return self._words[at : at + rows * width].reshape(rows, width)

    def gathered(self, kind: str, places: NDArray[np.int64]) -> NDArray[Any]:
        """(n, size) units of the numbers at some places."""
        return self._words[places][:, None]

    def numbers(self, units: NDArray[Any], kind: str) -> NDArray[Any]:
        """Units (n, size) as numbers of a type.

        Raises
        ------
        FileFormatError
            A whole number the type does not hold.
        ValueError
            A word that is no number.
        """
        words = units.reshape(-1)
        if kind[0] == "f":
            with np.errstate(over="ignore"):
                return np.asarray(words.astype(np.float64).astype(kind))
        whole = words.astype(np.int64)
        limits = np.iinfo(kind)
        if len(whole) and (whole.min() < limits.min or whole.max() > limits.max):
            raise FileFormatError(f"a number that does not fit into {np.dtype(kind)}")
        return np.asarray(whole.astype(kind))


class Bytes:
    """The body of a binary file, in either byte order: every byte is one unit."""

    def __init__(self, body: bytes, order: str) -> None:
        self._bytes, self._order = np.frombuffer(body, np.uint8), order

    def __len__(self) -> int:
        return len(self._bytes)

    def follows(self, at: int) -> bool:
        """Whether something but blanks and zeros stands there or behind."""
        return bool(self._bytes[at:].tobytes().strip(b"\0\r\n\t "))

    def size(self, kind: str) -> int:
        """Units a number takes."""
        return np.dtype(kind).itemsize

    def count(self, kind: str, at: int) -> int:
        """The whole number there."""
        units = self._bytes[at : at + self.size(kind)]
        return int(units.view(self._order + kind)[0])

    def block(self, rows: int, at: int, width: int) -> NDArray[Any]:
        """(rows, width) units from there on."""
        return self._bytes[at : at + rows * width].reshape(rows, width)

    def gathered(self, kind: str, places: NDArray[np.int64]) -> NDArray[Any]:
        """(n, size) units of the numbers at some places."""
        return np.asarray(self._bytes[places[:, None] + np.arange(self.size(kind))])

    def numbers(self, units: NDArray[Any], kind: str) -> NDArray[Any]:
        """Units (n, size) as numbers of a type, in this machine's order."""
        numbers = np.ascontiguousarray(units).view(self._order + kind).reshape(-1)
        return np.asarray(numbers.astype(kind, copy=False))
