"""Interior edges and faces that join boundary vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .meshes import TetMesh

__all__ = ["OverconstrainedElements", "overconstrained_elements"]


@dataclass(frozen=True, eq=False)
class OverconstrainedElements:
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

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.mesh.overconstrained import overconstrained_elements
    >>> found = overconstrained_elements(sm.samples.solid_double_torus(1))
    >>> len(found.edges) > 0
    True
    """

    edges: NDArray[np.int32]
    faces: NDArray[np.int32]
    tets: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.edges) + len(self.faces)


def overconstrained_elements(solid: TetMesh) -> OverconstrainedElements:
    """Find the interior edges and faces whose vertices all lie on the boundary.

    Parameters
    ----------
    solid : TetMesh

    Returns
    -------
    OverconstrainedElements
        Empty (``len`` zero) exactly when no tet has more than one face, or all vertices, on the
        boundary, no interior edge joins two boundary vertices and no interior face three; a tet
        that is a component of its own apart.

    Raises
    ------
    NonManifoldError
        A face shared by more than two tets; ``ids`` are the tets.
    DegenerateError
        Tets that repeat a vertex; ``ids`` are the tets.

    Examples
    --------
    A single layer of cubes has nothing but its boundary:

    >>> import stretchmap as sm
    >>> from stretchmap.mesh.overconstrained import overconstrained_elements
    >>> len(overconstrained_elements(sm.samples.solid_double_torus(1))) > 0
    True
    >>> len(overconstrained_elements(sm.samples.solid_torus(1500)))
    0
    """
    found = _core.mesh.OverconstrainedElements(solid.T, solid.n_vertices)
    return OverconstrainedElements(found.edges, found.faces, found.tets)
