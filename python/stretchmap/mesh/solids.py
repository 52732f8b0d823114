"""Tetrahedral meshes."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_indices, as_points, read_only
from ..base.options import flag
from .diagnosis import Diagnosis, diagnose_solid
from .exchange import Cells
from .immutable import Mesh, compacted, restore, turned
from .surfaces import TriMesh

__all__ = ["TetMesh"]


class TetMesh(Mesh):
    """A tetrahedral mesh.

    Parameters
    ----------
    V : (n, 3) array_like of real numbers
        Points.
    T : (k, 4) array_like of integers
        Vertices of each tet, positively oriented. Any integer type and byte order.
    orient : bool
        Turn tets until neighbours agree and the volume of every component is positive; ``n_turned``
        says how many were turned. A tet that then is still negative is folded over its neighbours;
        turning it would only hide the fold, so it is left and reported by `diagnose`.

    Attributes
    ----------
    V : (n, 3) ndarray of float64, read-only copy
    T : (k, 4) ndarray of int32, read-only copy
    n_turned : int
        Tets turned by ``orient=True``.

    Raises
    ------
    ArrayError
        Wrong shape or type.
    IndexRangeError
        An index outside the points; ``ids`` are the tets.
    NonFiniteError
        A NaN or an infinity; ``ids`` are the vertices.

    Notes
    -----
    Construction checks the arrays, not the topology: a mesh with defects can be held, diagnosed
    (`diagnose`) and repaired. What needs more says so (`require_solid_torus`).

    Examples
    --------
    >>> import stretchmap as sm
    >>> V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = sm.TetMesh(V, [[0, 1, 2, 3]])
    >>> round(6 * mesh.volume), mesh.surface.n_faces
    (1, 4)
    >>> sm.TetMesh(V, [[0, 2, 1, 3]], orient=True).n_turned
    1
    """

    T: NDArray[np.int32]

    def __init__(self, V: ArrayLike, T: ArrayLike, orient: bool = False) -> None:
        points = as_points(V, "V")
        tets = as_indices(T, 4, len(points), "T")
        n_turned = 0
        if flag("orient", orient):
            turn = _core.mesh.misoriented_tets(points, tets)
            n_turned = len(turn)
            tets = turned(tets, turn)
        self._set(V=points, T=tets, n_turned=n_turned)

    def __reduce__(self) -> tuple[Any, ...]:
        return (restore, (TetMesh, self.V, self.T, self.n_turned))

    def __repr__(self) -> str:
        return f"TetMesh({self.n_vertices} vertices, {self.n_tets} tets)"

    @property
    def n_tets(self) -> int:
        """Number of tets."""
        return len(self.T)

    @cached_property
    def _boundary(self) -> _core.mesh.TetBoundary:
        return _core.mesh.TetBoundary(self.T, self.n_vertices)

    @cached_property
    def surface(self) -> TriMesh:
        """The boundary as a `TriMesh` with its own vertex numbering, faces outward.

        Raises
        ------
        NonManifoldError
            A face shared by more than two tets; ``ids`` are the tets.
        """
        return TriMesh(self.V[self._boundary.vertices], self._boundary.faces)

    @property
    def boundary_vertices(self) -> NDArray[np.int32]:
        """(nb,) surface vertex -> solid vertex, ascending."""
        return self._boundary.vertices

    @property
    def boundary_index(self) -> NDArray[np.int32]:
        """(n,) solid vertex -> surface vertex, -1 inside."""
        return self._boundary.index

    @property
    def boundary_tets(self) -> NDArray[np.int32]:
        """(m,) boundary face -> the tet it belongs to."""
        return self._boundary.tets

    @cached_property
    def edges(self) -> NDArray[np.int32]:
        """(e, 2) edges, lower id first, in lexicographic order."""
        return read_only(_core.mesh.tet_edges(self.T, self.n_vertices))

    @cached_property
    def tet_volumes(self) -> NDArray[np.float64]:
        """(k,) signed volumes, negative for an inverted tet."""
        return read_only(_core.mesh.tet_volumes(self.V, self.T))

    @cached_property
    def volume(self) -> float:
        """Sum of the signed volumes."""
        return float(self.tet_volumes.sum())

    @cached_property
    def _diagnosis(self) -> Diagnosis:
        return diagnose_solid(self.V, self.T)

    def as_cells(self) -> Cells:
        """Points, cells and all fields."""
        return Cells(self.V, "tetra", self.T)

    def diagnose(self) -> Diagnosis:
        """List every defect with its ids; faces that cross are `TriMesh.crossing_faces`.

        Returns
        -------
        Diagnosis
        """
        return self._diagnosis

    def require_solid_torus(self) -> None:
        """Raise unless this is a solid torus without defects.

        Raises
        ------
        DegenerateError
            Repeated vertices, copies, tets without volume, unreferenced vertices.
        NonManifoldError, OrientationError, ConnectivityError
            As named; exactly one is raised, with the ids and the remedy.
        GenusError
            The boundary is not one torus, or the Euler characteristic is not zero.

        Notes
        -----
        What is checked is the homology of a solid torus. A ball with a knotted tunnel has the same
        and is not told apart; nor are tets that overlap without a negative one among them.
        """
        self._diagnosis.require()
        self._diagnosis.require_torus()

    def compact(self) -> tuple[TetMesh, NDArray[np.int32]]:
        """Drop the vertices no tet uses.

        Returns
        -------
        mesh : TetMesh
        kept : (n_kept,) ndarray of int32
            Vertex of the result -> vertex of this mesh, ascending.
        """
        kept, tets = compacted(self.T)
        return TetMesh(self.V[kept], tets), kept
