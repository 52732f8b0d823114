"""Edges of a surface halved, with the faces beside them, and the way back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import given_rows, read_only, with_means
from .surfaces import TriMesh

__all__ = ["HalvedFaces", "SurfaceRefinement", "halve_edges"]

# Faces that take the place of one, by what edges are halved: corners are 0, 1, 2 and the midpoints
# of the edges from them on 3, 4, 5; the first edge, or all but the last, or all are halved.
_ONE = ((0, 3, 2), (3, 1, 2))
_CORNER = ((3, 1, 4),)
_ACROSS = ((0, 3, 4), (0, 4, 2)), ((0, 3, 2), (3, 4, 2))  # what the second diagonal leaves, too
_ALL = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
_Parts = tuple[tuple[int, int, int], ...]


@dataclass(frozen=True, eq=False)
class SurfaceRefinement:
    """A surface some of whose edges were halved, and the way back to the one it came from.

    Attributes
    ----------
    surface : TriMesh
        Its first n vertices are those of the input, then come the midpoints of ``halved``; it is
        the same set of points in space.
    parent_face : ndarray of int32, shape (m',)
        Input face of each face, ascending.
    halved : tuple of (a, 2) ndarrays of int32
        Ends of the edges halved, those of one pass in one array; the ends may have been added
        before.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> from stretchmap.mesh.halved_faces import SurfaceRefinement, halve_edges
    >>> surface = sm.samples.torus_surface(24, 12)
    >>> lengths = np.ones(len(surface.edges))
    >>> first = np.arange(len(lengths)) < 10
    >>> finer = SurfaceRefinement.of(surface).after(halve_edges(surface, first, lengths))
    >>> finer.n_split >= 10, bool(np.allclose(finer.prolong(surface.V), finer.surface.V))
    (True, True)
    """

    surface: TriMesh
    parent_face: NDArray[np.int32]
    halved: tuple[NDArray[np.int32], ...] = ()

    @classmethod
    def of(cls, surface: TriMesh) -> SurfaceRefinement:
        """A surface as it is."""
        return cls(surface, read_only(np.arange(surface.n_faces, dtype=np.int32)))

    def after(self, pass_: HalvedFaces) -> SurfaceRefinement:
        """With one pass more."""
        parent = read_only(self.parent_face[pass_.parent])
        return SurfaceRefinement(pass_.surface, parent, (*self.halved, pass_.edges))

    @property
    def parent(self) -> NDArray[np.int32]:
        """``parent_face``."""
        return self.parent_face

    @property
    def n_split(self) -> int:
        """Number of added vertices."""
        return sum(map(len, self.halved))

    @property
    def n_added_faces(self) -> int:
        """Number of faces beyond those of the input."""
        return len(self.parent_face) - int(self.parent_face.max()) - 1

    def prolong(self, values: ArrayLike) -> NDArray[np.float64]:
        """Carry values over to the added vertices by averaging their parents.

        Parameters
        ----------
        values : (n, ...) array_like of float
            One row per vertex of the input.

        Raises
        ------
        ArrayError
            Another number of rows.
        """
        array = given_rows(values, self.surface.n_vertices - self.n_split)
        return with_means(array, self.halved)


@dataclass(frozen=True, eq=False)
class HalvedFaces:
    """What `halve_edges` leaves behind.

    Attributes
    ----------
    surface : TriMesh
        Its first n vertices are those of the input, then the midpoints of ``edges``.
    edges : ndarray of int32, shape (a, 2)
        Ends of the edges halved.
    parent : ndarray of intp, shape (m',)
        Input face of each face, ascending.
    corners : ndarray of intp, shape (m', 3)
        What of that face each corner is: 0, 1, 2 its corners, 3, 4, 5 the midpoints of the edges
        that begin there.
    """

    surface: TriMesh
    edges: NDArray[np.int32]
    parent: NDArray[np.intp]
    corners: NDArray[np.intp]


def halve_edges(
    surface: TriMesh, marked: NDArray[np.bool_], lengths: NDArray[np.float64]
) -> HalvedFaces:
    """Halve some edges of a closed surface, and the longest of every face that has one of them.

    Parameters
    ----------
    surface : TriMesh
    marked : ndarray of bool, shape (e,)
        Of ``surface.edges``.
    lengths : ndarray, shape (e,)
        By which one edge is longer than another, and the diagonal to its middle shorter.
    """
    edge = surface.topology.edge.reshape(-1, 3)
    marked = _with_longest(surface, marked, lengths)
    ends = surface.edges[marked]
    number = np.full(len(surface.edges), -1, np.int32)
    number[marked] = surface.n_vertices + np.arange(len(ends), dtype=np.int32)
    ids = np.concatenate([surface.F, number[edge]], axis=1)  # corners, then midpoints
    cut = marked[edge]
    count = cut.sum(axis=1)
    parents: list[NDArray[np.intp]] = []
    corners: list[NDArray[np.intp]] = []

    def put(faces: NDArray[np.intp], turn: NDArray[np.intp], parts: _Parts) -> None:
        for part in parts:
            slots = np.array(part)
            parents.append(faces)
            corners.append(np.where(slots < 3, 0, 3) + (slots % 3 + turn[:, None]) % 3)

    whole, one, two, three = (np.flatnonzero(count == k) for k in range(4))
    put(whole, np.zeros_like(whole), ((0, 1, 2),))
    put(one, cut[one].argmax(axis=1), _ONE)
    turn = (~cut[two]).argmax(axis=1) + 1  # the edge left whole comes last
    put(two, turn, _CORNER)
    # Of two medians that to the longer side is the shorter.
    first, second = (lengths[edge[two, side % 3]] for side in (turn, turn + 1))
    for chosen, parts in zip((second > first, second <= first), _ACROSS, strict=True):
        put(two[chosen], turn[chosen], parts)
    put(three, np.zeros_like(three), _ALL)
    parent = np.concatenate(parents)
    order = np.argsort(parent, kind="stable")
    parent, slots = parent[order], np.concatenate(corners)[order]
    V = np.concatenate([surface.V, surface.V[ends].mean(axis=1)])
    finer = TriMesh(V, ids[parent[:, None], slots])
    return HalvedFaces(finer, read_only(ends), parent, slots)


def _with_longest(
    surface: TriMesh, marked: NDArray[np.bool_], lengths: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """The edges marked, and the longest of every face that has a marked one (Rivara)."""
    edge = surface.topology.edge.reshape(-1, 3)
    longest = edge[np.arange(len(edge)), lengths[edge].argmax(axis=1)]
    marked = marked.copy()
    while (missing := marked[edge].any(axis=1) & ~marked[longest]).any():
        marked[longest[missing]] = True
    return marked
