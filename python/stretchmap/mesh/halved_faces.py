"""Edges of a surface halved, with the faces beside them, and the way back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import given_rows, read_only, with_means
from .surfaces import TriMesh

__all__ = ["HalvedFaces", "SurfaceRefinement", "halve_edges"]


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
    parent : ndarray of int32, shape (m',)
        Input face of each face, ascending.
    corners : HalvedFaces of the core
        What of that face each corner is, as charts of the surface want to know.
    """

    surface: TriMesh
    edges: NDArray[np.int32]
    parent: NDArray[np.int32]
    corners: _core.mesh.HalvedFaces


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
    done = _core.mesh.HalvedFaces(surface.topology, marked.view(np.uint8), lengths)
    V = np.concatenate([surface.V, surface.V[done.ends].mean(axis=1)])
    finer = TriMesh(V, done.faces)
    return HalvedFaces(finer, read_only(done.ends), read_only(done.parent), done)
