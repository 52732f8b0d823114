"""Triangle meshes."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_indices, as_points, read_only
from ..base.options import flag
from .diagnosis import Diagnosis, diagnose_surface
from .exchange import Cells
from .immutable import Mesh, compacted, restore, turned

__all__ = ["TriMesh"]

# Defects that leave a surface without a genus.
_NO_GENUS = ("nonmanifold_edges", "nonmanifold_vertices", "border_edges", "not_orientable")
MOST_PAIRS = 1000  # of faces that cross: one does as much harm as all


class TriMesh(Mesh):
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
            faces = turned(faces, turn)
        self._set(V=points, F=faces, n_turned=n_turned)

    def __reduce__(self) -> tuple[Any, ...]:
        return (restore, (TriMesh, self.V, self.F, self.n_turned))

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

    @cached_property
    def crossing_faces(self) -> NDArray[np.int32]:
        """(k, 2) pairs of faces that meet beyond the vertices they share, the first thousand.

        Decided by exact tests.
        """
        return read_only(_core.certificate.crossing_faces(self.V, self.F, MOST_PAIRS))

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
        """List every defect with its ids; faces that cross are `crossing_faces`.

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
        kept, faces = compacted(self.F)
        return TriMesh(self.V[kept], faces), kept
