"""Numbers of a section of one of Gmsh's files one after the other, as text or as bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError

__all__ = ["Binary", "Source", "Text"]

_RUN = 10_000  # elements of version 2 looked at together


class Text:
    """Numbers of a section one after the other."""

    def __init__(self, data: bytes, at: int, mark: bytes) -> None:
        self.end = max(data.find(mark, at), at)
        self._words, self._at = data[at : self.end].split(), 0

    def take(self, kind: str, count: int) -> NDArray[Any]:
        words = self._words[self._at : self._at + count]
        if count < 0 or len(words) != count:
            raise FileFormatError("the file ends within a section")
        self._at += count
        return np.array(words, np.bytes_).astype(kind) if count else np.empty(0, kind)

    def rows(self, count: int, width: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Rows of a tag and numbers."""
        table = self.take("<f8", count * (1 + width)).reshape(count, 1 + width)
        return table[:, 0].astype(np.int64), table[:, 1:]

    def run(self, most: int) -> tuple[int, int, int]:
        """Type and number of tags of the next elements of version 2, and at most how many."""
        kind, n_tags = (int(word) for word in self._words[self._at + 1 : self._at + 3])
        return kind, n_tags, most

    def run_rows(self, kind: int, n_tags: int, most: int, width: int) -> NDArray[Any]:
        """Number, tags and nodes of the elements that are like the next one."""
        width += 3 + n_tags
        most = min(most, (len(self._words) - self._at) // width, _RUN)
        words = self._words[self._at : self._at + most * width]
        rows = np.array(words, np.bytes_).reshape(most, width)
        same = (rows[:, 1] == rows[0, 1]) & (rows[:, 2] == rows[0, 2]) if most else np.empty(0)
        count = most if same.all() else int(np.argmin(same))
        self._at += count * width
        return np.delete(rows[:count], [1, 2], axis=1).astype(np.int64)


class Binary:
    """Numbers of a section one after the other."""

    def __init__(self, data: bytes, at: int, mark: bytes) -> None:
        self._data, self.end = data, at

    def take(self, kind: Any, count: int) -> NDArray[Any]:
        size = np.dtype(kind).itemsize * count
        if size < 0 or self.end + size > len(self._data):
            raise FileFormatError("the file ends within a section")
        self.end += size
        return np.frombuffer(self._data, kind, count, self.end - size)

    def rows(self, count: int, width: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Rows of a tag and numbers."""
        table = self.take(np.dtype([("tag", "<i4"), ("values", "<f8", (width,))]), count)
        return table["tag"].astype(np.int64), table["values"]

    def run(self, most: int) -> tuple[int, int, int]:
        """Type and number of tags of the next elements of version 2, and how many there are."""
        kind, count, n_tags = self.take("<i4", 3).tolist()
        return kind, n_tags, min(count, most)

    def run_rows(self, kind: int, n_tags: int, most: int, width: int) -> NDArray[Any]:
        """Number, tags and nodes of these elements."""
        width += 1 + n_tags
        return self.take("<i4", most * width).reshape(most, width).astype(np.int64)


Source = Text | Binary
