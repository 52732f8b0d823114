"""What a mesh file holds."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_reals, as_rows
from ..errors import ArrayError, FileFormatError
from ..mesh.exchange import Cells

_log = logging.getLogger("stretchmap")


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

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.io import MeshArrays
    >>> MeshArrays(np.zeros((3, 3)), F=np.array([[0, 1, 2]])).elements.tolist()
    [[0, 1, 2]]
    """

    V: NDArray[Any]
    F: NDArray[Any] | None = None
    T: NDArray[Any] | None = None
    point_data: dict[str, NDArray[Any]] = field(default_factory=dict)
    cell_data: dict[str, NDArray[Any]] = field(default_factory=dict)
    extra: dict[str, NDArray[Any]] = field(default_factory=dict)
    corner_uv: NDArray[np.float64] | None = None

    @classmethod
    def of(cls, cells: Cells) -> MeshArrays:
        """Triangles or tets with their data."""
        F, T = (None, cells.cells) if cells.kind == "tetra" else (cells.cells, None)
        return cls(cells.points, F, T, cells.point_data, cells.cell_data)

    @property
    def elements(self) -> NDArray[Any]:
        """Tets where there are any, else triangles.

        Raises
        ------
        ArrayError
            There are neither.
        """
        found = self.F if self.T is None else self.T
        if found is None:
            raise ArrayError("neither triangles nor tets are given")
        return found


def checked(data: Mapping[str, ArrayLike] | None, rows: int, what: str) -> dict[str, NDArray[Any]]:
    """Point or cell data as arrays of numbers with so many rows.

    Raises
    ------
    ArrayError
        They are not.
    """
    arrays: dict[str, NDArray[Any]] = {}
    if data is None:
        return arrays
    if not isinstance(data, Mapping):
        raise ArrayError(f"{what} must be a dict of arrays by name, not a {type(data).__name__}")
    for name, values in data.items():
        if not isinstance(name, str) or not name.isprintable() or not name.strip():
            raise ArrayError(f"arrays in {what} are named by a word, not by {name!r:.60}")
        arrays[name] = as_rows(values, f"{what}[{name!r}]", rows)
    return arrays


def checked_uv(
    corner_uv: ArrayLike | None, suffix: str, faces: NDArray[np.int32]
) -> NDArray[np.float64] | None:
    """Texture coordinates of the corners of faces, or None.

    Raises
    ------
    FileFormatError
        The format has none.
    ArrayError, NonFiniteError
        Not (m, 3, 2) finite numbers.
    """
    if corner_uv is None:
        return None
    if suffix != ".obj":
        raise FileFormatError(f"{suffix} files hold no texture coordinates; write an .obj")
    return as_reals(corner_uv, "corner_uv", (len(faces), 3, 2))


def lines_of(data: bytes) -> bytes:
    """The text of a file without a byte order mark, lines ending as on this system."""
    return data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
