"""Splitting of interior edges and faces whose vertices all lie on the boundary.

Such an edge or face is placed by the boundary map alone, so no solver that works inside can repair
a flip there. A vertex at its midpoint or centroid sets it free.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._arrays import read_only
from .errors import ArrayError
from .mesh import TetMesh

__all__ = ["BoundaryJoins", "Refinement", "boundary_joins", "refine_boundary_joins"]


@dataclass(frozen=True, eq=False)
class BoundaryJoins:
    """Interior edges and faces whose vertices all lie on the boundary.

    Attributes
    ----------
    edges : (a, 2) ndarray of int32
        Interior edges, lower id first, in lexicographic order.
    faces : (b, 3) ndarray of int32
        Interior faces whose edges lie on the boundary, too: they cut off corners of the solid. A
        face with an interior edge is not listed, it goes with its edge.
    tets : (c,) ndarray of int32
        Tets at those edges and faces, ascending.
    """

    edges: NDArray[np.int32]
    faces: NDArray[np.int32]
    tets: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.edges) + len(self.faces)


@dataclass(frozen=True, eq=False)
class Refinement:
    """A solid without boundary joins, and the way back to the one it came from.

    Attributes
    ----------
    solid : TetMesh
        Its first n vertices are those of the input, unchanged, and its boundary is the same. Then
        follow the midpoints of ``parents`` and the centroids of ``face_parents``.
    parents : (a, 2) ndarray of int32
        Vertices of the edge each added midpoint halves.
    face_parents : (b, 3) ndarray of int32
        Vertices of the face each added centroid lies in.
    parent_tet : (k',) ndarray of int32
        Input tet of each tet, ascending.
    """

    solid: TetMesh
    parents: NDArray[np.int32]
    face_parents: NDArray[np.int32]
    parent_tet: NDArray[np.int32]

    @property
    def n_split(self) -> int:
        """Number of edges and faces split: the number of added vertices."""
        return len(self.parents) + len(self.face_parents)

    @property
    def n_added_tets(self) -> int:
        """Number of tets beyond those of the input."""
        return len(self.parent_tet) - (int(self.parent_tet[-1]) + 1)

    def prolong(self, values: ArrayLike) -> NDArray[np.float64]:
        """Carry values over to the added vertices by averaging their parents.

        Parameters
        ----------
        values : (n, ...) array_like of float
            One row per vertex of the input.

        Returns
        -------
        (n + n_split, ...) ndarray of float64
            ``values`` first, unchanged.

        Raises
        ------
        ArrayError
            Another number of rows.
        """
        array = np.asarray(values, dtype=np.float64)
        n = self.solid.n_vertices - self.n_split
        if array.ndim == 0 or len(array) != n:
            raise ArrayError(f"values must have {n} rows, not shape {array.shape}")
        rows: list[NDArray[Any]] = [array]
        rows += [array[ids].mean(axis=1) for ids in (self.parents, self.face_parents) if len(ids)]
        return np.concatenate(rows)


def boundary_joins(solid: TetMesh) -> BoundaryJoins:
    """Find the interior edges and faces whose vertices all lie on the boundary.

    Parameters
    ----------
    solid : TetMesh

    Returns
    -------
    BoundaryJoins
        Empty (``len`` zero) exactly when no tet has more than one face, or all vertices, on the
        boundary, no interior edge joins two boundary vertices and no interior face three; a tet
        that is a component of its own apart.

    Raises
    ------
    NonManifoldError
        A face shared by more than two tets; ``ids`` are the tets.
    DegenerateError
        Tets that repeat a vertex; ``ids`` are the tets.
    """
    found = _core.BoundaryJoins(solid.T, solid.n_vertices)
    return BoundaryJoins(found.edges, found.faces, found.tets)


def refine_boundary_joins(solid: TetMesh) -> Refinement:
    """Split every interior edge and face whose vertices all lie on the boundary.

    Each such edge is halved at its midpoint, with all tets round it; each such face whose edges lie
    on the boundary is split into three at its centroid, with the two tets beside it. Orientation,
    boundary and volume are kept. The result depends on the input only.

    Parameters
    ----------
    solid : TetMesh

    Returns
    -------
    Refinement
        With `boundary_joins` of ``solid`` empty; ``solid`` is the input itself when there was
        nothing to split.

    Raises
    ------
    NonManifoldError
        A face shared by more than two tets; ``ids`` are the tets.
    DegenerateError
        Tets that repeat a vertex; ``ids`` are the tets.
    """
    found = _core.Refinement(solid.V, solid.T)
    joins = found.joins
    split = len(joins.edges) + len(joins.faces)
    return Refinement(
        solid=TetMesh(found.points, found.tets) if split else solid,
        parents=read_only(joins.edges),
        face_parents=read_only(joins.faces),
        parent_tet=read_only(found.parent_tet),
    )
