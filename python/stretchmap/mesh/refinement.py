"""Refining a solid where it is too coarse for a map: at its boundary, inside, along single edges.

An interior edge or face whose vertices all lie on the boundary is placed by the boundary map alone,
so no solver that works inside can repair a flip there. A vertex at its midpoint or centroid sets it
free. Likewise, an interior vertex with a good part of the boundary round it may have no place from
where it sees the inner side of all those faces; halving the edges from it to the boundary gives
them vertices of their own to be seen by.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import given_rows, read_only, with_means
from .meshes import TetMesh
from .split_edges import TET_EDGES, SplitSolid, split_edges

__all__ = ["TETS_PER_EDGE", "Refinement", "refine_overconstrained"]

TETS_PER_EDGE = 6  # that halving an inner edge adds, about


@dataclass(frozen=True, eq=False)
class Refinement:
    """A solid without overconstrained elements, and the way back to the one it came from.

    Attributes
    ----------
    solid : TetMesh
        Its first n vertices are those of the input, unchanged, and its boundary is the same but for
        the edges of ``on_edges``. Then follow the points of ``on_edges``, the midpoints of
        ``parents``, the centroids of ``face_parents`` and the midpoints of ``halved``.
    parents : (a, 2) ndarray of int32
        Vertices of the edge each added midpoint halves.
    face_parents : (b, 3) ndarray of int32
        Vertices of the face each added centroid lies in.
    parent_tet : (k',) ndarray of int32
        Input tet of each tet, ascending if ``on_edges`` is empty.
    halved : tuple of (c, 2) ndarrays of int32
        Edges halved after that, those of one pass in one array; their ends may have been added
        before.
    on_edges : tuple of (ndarray of int32, shape (d, 2); ndarray, shape (d,))
        Edges split before all else, and where, see `SplitSolid`.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> from stretchmap.mesh.refinement import refine_overconstrained
    >>> plate = sm.samples.solid_double_torus(1)
    >>> refined = refine_overconstrained(plate)
    >>> heights = refined.prolong(plate.V[:, 2])
    >>> bool(np.allclose(heights, refined.solid.V[:, 2]))
    True
    """

    solid: TetMesh
    parents: NDArray[np.int32]
    face_parents: NDArray[np.int32]
    parent_tet: NDArray[np.int32]
    halved: tuple[NDArray[np.int32], ...] = ()
    on_edges: tuple[tuple[NDArray[np.int32], NDArray[np.float64]], ...] = ()

    @property
    def parent(self) -> NDArray[np.int32]:
        """``parent_tet``."""
        return self.parent_tet

    @property
    def n_split(self) -> int:
        """Number of edges and faces split: the number of added vertices."""
        before = (edges for edges, _ in self.on_edges)
        return sum(map(len, (*before, self.parents, self.face_parents, *self.halved)))

    @property
    def n_added_tets(self) -> int:
        """Number of tets beyond those of the input."""
        return len(self.parent_tet) - self.n_given_tets

    @property
    def n_given_tets(self) -> int:
        """Number of tets of the input."""
        return int(self.parent_tet.max()) + 1

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
        array = given_rows(values, self.solid.n_vertices - self.n_split)
        for ends, shares in self.on_edges:
            share = shares.reshape(-1, *np.ones(array.ndim - 1, int))
            between = (1.0 - share) * array[ends[:, 0]] + share * array[ends[:, 1]]
            array = np.concatenate([array, between])
        return with_means(array, (self.parents, self.face_parents, *self.halved))

    @classmethod
    def of(cls, split: SplitSolid) -> Refinement:
        """What was split, and nothing else."""
        edges, faces = np.zeros((0, 2), np.int32), np.zeros((0, 3), np.int32)
        return cls(split.solid, edges, faces, split.parent_tet, on_edges=split.passes)

    def after(self, split: SplitSolid) -> Refinement:
        """The same of the solid whose edges were split before.

        Parameters
        ----------
        split : SplitSolid
            What was refined is its solid.
        """
        parent = read_only(split.parent_tet[self.parent_tet])
        return dataclasses.replace(self, parent_tet=parent, on_edges=split.passes)

    def halve(self, edges: NDArray[np.int32]) -> Refinement:
        """Halve interior edges of ``solid``, with all tets round them; none may be left over.

        Parameters
        ----------
        edges : (e, 2) ndarray of int32
            Different interior edges of ``solid``. Of those with a tet in common, the first is
            halved first.

        Returns
        -------
        Refinement
            Of the same input.
        """
        solid, parent, passes = self.solid, self.parent_tet, list(self.halved)
        while len(edges):
            split = split_edges(solid, edges, np.full(len(edges), 0.5))
            order = np.argsort(parent[split.parent_tet], kind="stable")
            parent = parent[split.parent_tet][order]
            solid = TetMesh(split.solid.V, split.solid.T[order])
            passes.append(read_only(edges[split.kept]))
            edges = np.delete(edges, split.kept, axis=0)
        return dataclasses.replace(
            self, solid=solid, parent_tet=read_only(parent), halved=tuple(passes)
        )


def refine_overconstrained(solid: TetMesh, seen: NDArray[np.float64] | None = None) -> Refinement:
    """Split every interior edge and face whose vertices all lie on the boundary.

    Each such edge is halved at its midpoint, with all tets round it; each such face whose edges lie
    on the boundary is split into three at its centroid, with the two tets beside it. Of edges with
    a tet in common the longest is halved first, which keeps the pieces in shape. Orientation,
    boundary and volume are kept. The result depends on the input only.

    Parameters
    ----------
    solid : TetMesh
    seen : ndarray, shape (n, 3), optional
        Where the vertices are when lengths are compared, if not where they are in the solid.

    Returns
    -------
    Refinement
        With `overconstrained_elements` of ``solid`` empty; ``solid`` is the input itself when
        there was nothing to split.

    Raises
    ------
    NonManifoldError
        A face shared by more than two tets; ``ids`` are the tets.
    DegenerateError
        Tets that repeat a vertex; ``ids`` are the tets.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.mesh.overconstrained import overconstrained_elements
    >>> from stretchmap.mesh.refinement import refine_overconstrained
    >>> plate = sm.samples.solid_double_torus(1)
    >>> refined = refine_overconstrained(plate)
    >>> len(overconstrained_elements(refined.solid)), refined.n_split > 0
    (0, True)
    """
    found = _core.mesh.Refinement(solid.V, solid.T, solid.V if seen is None else seen)
    split = found.split
    n_split = len(split.edges) + len(split.faces)
    return Refinement(
        solid=TetMesh(found.points, found.tets) if n_split else solid,
        parents=read_only(split.edges),
        face_parents=read_only(split.faces),
        parent_tet=read_only(found.parent_tet),
    )


def crowded_edges(solid: TetMesh, tets: NDArray[np.intp]) -> NDArray[np.int32]:
    """Edges to halve so that the interior vertices of some tets see fewer faces of the boundary.

    Parameters
    ----------
    solid : TetMesh
        Without overconstrained elements.
    tets : ndarray of intp

    Returns
    -------
    (e, 2) ndarray of int32
        The edges from each interior vertex of those tets to the boundary, in lexicographic order;
        if there are none, the edges of those tets.
    """
    inside = solid.boundary_index < 0
    stuck = np.zeros(solid.n_vertices, bool)
    stuck[solid.T[tets]] = True
    first, second = solid.edges.T
    chosen = (stuck & inside)[first] & ~inside[second] | (stuck & inside)[second] & ~inside[first]
    if chosen.any():
        return np.ascontiguousarray(solid.edges[chosen])
    own = np.sort(solid.T[tets][:, TET_EDGES].reshape(-1, 2), axis=1)
    return np.unique(own, axis=0)


def surrounding_edges(solid: TetMesh, tets: NDArray[np.intp]) -> NDArray[np.int32]:
    """Edges to halve so that all that is round some tets gets room, not they alone.

    Parameters
    ----------
    solid : TetMesh
    tets : ndarray of intp

    Returns
    -------
    (e, 2) ndarray of int32
        Those of each interior vertex of those tets, and of each that shares a tet with one of their
        vertices, in lexicographic order.
    """
    near = np.zeros(solid.n_vertices, bool)
    near[solid.T[tets]] = True
    near[solid.T[near[solid.T].any(axis=1)]] = True
    near &= solid.boundary_index < 0
    return np.ascontiguousarray(solid.edges[near[solid.edges].any(axis=1)])


def longest_inner_edges(
    solid: TetMesh, points: NDArray[np.float64], tets: NDArray[np.intp]
) -> NDArray[np.int32]:
    """The longest edge of each of some tets, of those with an end inside the solid.

    Parameters
    ----------
    solid : TetMesh
    points : ndarray, shape (n, 3)
        Where its vertices are to be seen for that.
    tets : ndarray of intp
        One without a vertex inside has none.

    Returns
    -------
    (e, 2) ndarray of int32
        In lexicographic order.
    """
    edges = np.sort(solid.T[tets][:, TET_EDGES], axis=2)
    ends = points[edges]
    length = np.where(
        (solid.boundary_index[edges] < 0).any(axis=2),
        np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2),
        0.0,
    )
    longest = edges[np.arange(len(edges)), length.argmax(axis=1)]
    return np.unique(longest[length.max(axis=1, initial=0.0) > 0.0], axis=0)
