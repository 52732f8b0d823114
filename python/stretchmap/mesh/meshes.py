"""Triangle and tet meshes: validated once at construction, immutable afterwards.

Points are ``(n, 3) float64``, faces ``(m, 3) int32``, tets ``(k, 4) int32``, all C-contiguous and
read-only. A tet is positively oriented when ``det(v1 - v0, v2 - v0, v3 - v0) > 0``; the faces of a
surface are when their normals point outward.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_indices, as_points, read_only
from ..base.options import flag
from ..base.tables import html, table
from .diagnosis import Diagnosis, diagnose_solid, diagnose_surface
from .exchange import Cells, Exchanged

__all__ = ["TetMesh", "TriMesh"]

# Defects that leave a surface without a genus.
_NO_GENUS = ("nonmanifold_edges", "nonmanifold_vertices", "border_edges", "not_orientable")


class _Mesh(Exchanged):
    """What both kinds share: points, immutability, pickling."""

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


class TriMesh(_Mesh):
    """A triangle mesh.

    Parameters
    ----------
    V : (n, 3) array_like of real numbers
        Points.
    F : (m, 3) array_like of integers
        Vertices of each face, counter-clockwise seen from outside. Any integer type and byte order.
    orient : bool
        Turn faces until neighbours agree and closed components have their normals outward;
        ``n_turned`` says how many were turned. Without it the mesh is taken as it is.

    Attributes
    ----------
    V : (n, 3) ndarray of float64, read-only copy
    F : (m, 3) ndarray of int32, read-only copy
    n_turned : int
        Faces turned by ``orient=True``.

    Raises
    ------
    ArrayError
        Wrong shape or type.
    IndexRangeError
        An index outside the points; ``ids`` are the faces.
    NonFiniteError
        A NaN or an infinity; ``ids`` are the vertices.

    Notes
    -----
    Construction checks the arrays, not the topology: a mesh with defects can be held, diagnosed
    (`diagnose`) and repaired. What needs more says so (`require_closed`, `require_genus_one`).

    Examples
    --------
    A cube's corner cut off, with one face turned over:

    >>> import stretchmap as sm
    >>> V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> F = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 3, 2]]
    >>> mesh = sm.TriMesh(V, F)
    >>> mesh.diagnose().misoriented.tolist()
    [3]
    >>> mesh = sm.TriMesh(V, F, orient=True)
    >>> mesh.n_turned, mesh.genus, round(6 * mesh.volume)
    (1, 0, 1)
    """

    F: NDArray[np.int32]

    def __init__(self, V: ArrayLike, F: ArrayLike, orient: bool = False) -> None:
        points = as_points(V, "V")
        faces = as_indices(F, 3, len(points), "F")
        n_turned = 0
        if flag("orient", orient):
            turn = _core.mesh.misoriented_faces(points, faces)
            n_turned = len(turn)
            faces = _turned(faces, turn)
        self._set(V=points, F=faces, n_turned=n_turned)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restore, (TriMesh, self.V, self.F, self.n_turned))

    def __repr__(self) -> str:
        return f"TriMesh({self.n_vertices} vertices, {self.n_faces} faces)"

    @property
    def n_faces(self) -> int:
        """Number of faces."""
        return len(self.F)

    @cached_property
    def topology(self) -> _core.mesh.SurfaceTopology:
        """Half-edges and edges (core object).

        Raises
        ------
        NonManifoldError
            An edge with more than two faces; ``ids`` are the faces.
        OrientationError
            Two faces that run along an edge in the same direction; ``ids`` are the faces.
        """
        return _core.mesh.SurfaceTopology(self.F, self.n_vertices)

    @cached_property
    def edges(self) -> NDArray[np.int32]:
        """(e, 2) edges, lower id first, in lexicographic order.

        Raises
        ------
        NonManifoldError, OrientationError
            As `topology`.
        """
        return self.topology.edges

    @cached_property
    def face_areas(self) -> NDArray[np.float64]:
        """(m,) unsigned face areas."""
        return read_only(_core.mesh.face_areas(self.V, self.F))

    @cached_property
    def area(self) -> float:
        """Total area."""
        return float(self.face_areas.sum())

    @cached_property
    def volume(self) -> float:
        """Signed enclosed volume, positive with outward normals; meaningless with a border."""
        return float(_core.mesh.enclosed_volume(self.V, self.F))

    @property
    def n_components(self) -> int:
        """Number of components (faces that share a vertex belong together)."""
        return self._diagnosis.n_components

    @property
    def euler(self) -> int:
        """Euler characteristic, vertices no face uses not counted."""
        return int(self._diagnosis.euler.sum())

    @property
    def genus(self) -> int:
        """Genus, summed over the components.

        Raises
        ------
        MeshError
            The surface is not closed, manifold and orientable; the defect at fault.
        """
        diagnosis = self._diagnosis
        if (diagnosis.genus < 0).any():
            diagnosis.require(_NO_GENUS)
        return int(diagnosis.genus.sum())

    @cached_property
    def _diagnosis(self) -> Diagnosis:
        return diagnose_surface(self.V, self.F)

    def as_cells(self) -> Cells:
        """Points, cells and all fields."""
        return Cells(self.V, "triangle", self.F)

    def diagnose(self) -> Diagnosis:
        """List every defect with its ids.

        Returns
        -------
        Diagnosis
        """
        return self._diagnosis

    def require_closed(self) -> None:
        """Raise unless this is one closed, manifold, outward oriented surface without defects.

        Any genus will do.

        Raises
        ------
        DegenerateError
            Repeated vertices, copies, faces without area, unreferenced vertices.
        NonManifoldError, OpenSurfaceError, OrientationError, ConnectivityError
            As named; exactly one is raised, with the ids and the remedy.
        """
        self._diagnosis.require()

    def require_genus_one(self) -> None:
        """Raise unless this is a torus without defects.

        Raises
        ------
        MeshError
            As `require_closed`.
        GenusError
            Another genus.
        """
        self._diagnosis.require()
        self._diagnosis.require_torus()

    def compact(self) -> tuple[TriMesh, NDArray[np.int32]]:
        """Drop the vertices no face uses.

        Returns
        -------
        mesh : TriMesh
        kept : (n_kept,) ndarray of int32
            Vertex of the result -> vertex of this mesh, ascending.
        """
        kept, faces = _compacted(self.F)
        return TriMesh(self.V[kept], faces), kept


class TetMesh(_Mesh):
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
            tets = _turned(tets, turn)
        self._set(V=points, T=tets, n_turned=n_turned)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restore, (TetMesh, self.V, self.T, self.n_turned))

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
        """List every defect with its ids.

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
        kept, tets = _compacted(self.T)
        return TetMesh(self.V[kept], tets), kept


def _compacted(elements: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    kept, inverse = np.unique(elements, return_inverse=True)
    return read_only(kept), inverse.reshape(elements.shape).astype(np.int32)


def _turned(elements: NDArray[np.int32], ids: NDArray[np.int32]) -> NDArray[np.int32]:
    """Swap the last two corners of the elements named."""
    if not len(ids):
        return elements
    turned = elements.copy()
    turned[ids, -2], turned[ids, -1] = elements[ids, -1], elements[ids, -2]
    return read_only(turned)


def _restore(kind: type, points: Any, elements: Any, n_turned: int) -> Any:
    mesh = kind(points, elements)
    mesh._set(n_turned=n_turned)
    return mesh
