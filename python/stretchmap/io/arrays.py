"""What a mesh file holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """What a mesh file holds, before it is checked.

    Attributes
    ----------
    V : (n, 3) ndarray
        Points, as stored.
    F : (m, 3) ndarray of integers or None
        Triangles.
    T : (k, 4) ndarray of integers or None
        Tets.
    point_data : dict
        Arrays with one row per point, by name.
    cell_data : dict
        Arrays with one row per tet, or per triangle where there are no tets, by name.
    extra : dict
        Further arrays of an ``.npz`` file, by name.
    corner_uv : (m, 3, 2) ndarray or None
        Texture coordinates of the triangle corners of an ``.obj`` file.
    """

    V: NDArray[Any]
    F: NDArray[Any] | None = None
    T: NDArray[Any] | None = None
    point_data: dict[str, NDArray[Any]] = field(default_factory=dict)
    cell_data: dict[str, NDArray[Any]] = field(default_factory=dict)
    extra: dict[str, NDArray[Any]] = field(default_factory=dict)
    corner_uv: NDArray[np.float64] | None = None


def triangles_only(sizes: NDArray[Any]) -> None:
    odd = np.unique(sizes[sizes != 3])
    if len(odd):
        raise FileFormatError(
            f"faces with {', '.join(map(str, odd[:5].tolist()))} corners; split them into triangles"
        )
