"""Fields of the input carried along with a map: groups, materials, loads, measurements."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import read_only
from ..base.options import shown
from ..errors import ArrayError
from ..io.arrays import checked
from ..mesh.halved_faces import SurfaceRefinement
from ..mesh.meshes import TetMesh, TriMesh
from ..mesh.refinement import Refinement

__all__ = ["OF_MAPS", "carried", "is_saved"]

_log = logging.getLogger("stretchmap")

Fields = dict[str, NDArray[Any]]

# What map files hold of their own, by name.
OF_MAPS = frozenset(
    "V F T image angles torus meta target_V target_T ratio ratios ring_ratio ring_ratios file "
    "parent_tet parent_face landmarks forms u v s cos_u sin_u cos_v sin_v grad_u grad_v grad_s "
    "along around radial seam_u seam_v converged".split()
)
# What every file of a map, for viewers, of our own and of its parts, holds together.
_IN_ALL = ({"image", "ring_ratio", "ratio"}, {"image", "ring_ratios", "ratios", "meta"},
           {"image", "part", "parent_tet"})  # fmt: skip


def is_saved(names: Collection[str]) -> bool:
    """Whether a file with arrays of these names was written by a map or a partition: one of its
    names alone others use, too."""
    return any(together <= set(names) for together in _IN_ALL)


def carried(
    mesh: TriMesh | TetMesh,
    refinement: Refinement | SurfaceRefinement | None,
    point_data: Mapping[str, ArrayLike] | None,
    cell_data: Mapping[str, ArrayLike] | None,
) -> tuple[Fields, Fields]:
    """Fields of the mesh that was given as fields of the mesh that was mapped.

    A tet or face has the values of the one it is a part of, an added vertex the mean of its
    parents, or, of whole numbers, which may be labels, the value of the first.

    Raises
    ------
    ArrayError
        Another number of rows than that of either mesh, no numbers, or two names that are one once
        slashes are underscores.
    """
    elements = mesh.T if isinstance(mesh, TetMesh) else mesh.F
    n, m = len(mesh.V), len(elements)
    n_given, m_given = n, m
    if refinement is not None:
        parent = refinement.parent
        n_given, m_given = n - refinement.n_split, int(parent.max()) + 1
    points = _own(checked(point_data, _rows(point_data, n, n_given), "point_data"))
    cells = _own(checked(cell_data, _rows(cell_data, m, m_given), "cell_data"))
    if refinement is not None:
        first = _first_parents(refinement, n_given)
        points = {
            name: array
            if len(array) == n
            else refinement.prolong(array).astype(array.dtype)
            if array.dtype.kind == "f"
            else array[first]
            for name, array in points.items()
        }
        cells = {k: a if len(a) == m else a[parent] for k, a in cells.items()}
    return _copies(points), _copies(cells)


def _copies(fields: Fields) -> Fields:
    """Arrays that stay what they are, whatever the caller does to those that were given."""
    return {name: read_only(array.copy()) for name, array in fields.items()}


def _own(fields: Fields) -> Fields:
    """Without those whose names maps use themselves, and with names every archive takes."""
    own: Fields = {}
    given: dict[str, str] = {}
    for name, array in fields.items():
        word = name.removeprefix("point:").removeprefix("cell:").replace("/", "_")
        if word in given:
            raise ArrayError(
                f"the fields {shown(given[word])} and {shown(name)} would both be {word} in files "
                "of a map; rename one"
            )
        own[word], given[word] = array, name
    left_out = sorted(own.keys() & OF_MAPS)
    if left_out:
        _log.warning(
            "fields named like what a map holds itself are left out: %s; give them other names",
            ", ".join(left_out),
        )
    return {name: array for name, array in own.items() if name not in OF_MAPS}


def _rows(data: Mapping[str, ArrayLike] | None, own: int, given: int) -> int:
    """Number of rows the fields must have: of the mesh that was mapped, if one has so many."""
    if not isinstance(data, Mapping) or own == given:
        return own
    sizes = {len(np.atleast_1d(np.asarray(values))) for values in data.values()}
    if len(sizes) > 1:
        raise ArrayError(f"fields must all have {given} or all {own} rows, not {sorted(sizes)}")
    return own if sizes == {own} else given


def _first_parents(refinement: Refinement | SurfaceRefinement, n: int) -> NDArray[np.intp]:
    """Vertex of the input each vertex is, or comes from."""
    origin = np.arange(n)
    if isinstance(refinement, Refinement):
        for ids, _ in refinement.on_edges:
            origin = np.concatenate([origin, origin[ids[:, 0]]])
        origin = np.concatenate(
            [origin, *(origin[ids[:, 0]] for ids in (refinement.parents, refinement.face_parents))]
        )
    for ids in refinement.halved:
        origin = np.concatenate([origin, origin[ids[:, 0]]])
    return origin
