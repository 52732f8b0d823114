"""What both kinds of mesh share: points, immutability, pickling."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from ..base.tables import html, table
from .exchange import Exchanged

__all__ = ["Mesh", "compacted", "restore", "turned"]


class Mesh(Exchanged):
    """Base of `TriMesh` and `TetMesh`."""

    V: NDArray[np.float64]
    n_turned: int

    def _set(self, **values: Any) -> None:
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable; make a new one")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable; make a new one")

    @property
    def n_vertices(self) -> int:
        """Number of rows of ``V``."""
        return len(self.V)

    def _repr_html_(self) -> str:
        name, _, counts = repr(self).rstrip(")").partition("(")
        low, high = self.V.min(axis=0), self.V.max(axis=0)
        box = [f"{a:.4g} to {b:.4g}" for a, b in zip(low, high, strict=True)]
        return html(table({name: counts, "bounding box": " x ".join(box)}))


def compacted(elements: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The vertices that are used, ascending, and the elements over them."""
    kept, inverse = np.unique(elements, return_inverse=True)
    return read_only(kept), inverse.reshape(elements.shape).astype(np.int32)


def turned(elements: NDArray[np.int32], ids: NDArray[np.int32]) -> NDArray[np.int32]:
    """Swap the last two corners of the elements named."""
    if not len(ids):
        return elements
    result = elements.copy()
    result[ids, -2], result[ids, -1] = elements[ids, -1], elements[ids, -2]
    return read_only(result)


def restore(kind: type, points: Any, elements: Any, n_turned: int) -> Any:
    """A mesh from a pickle."""
    mesh = kind(points, elements)
    mesh._set(n_turned=n_turned)
    return mesh
