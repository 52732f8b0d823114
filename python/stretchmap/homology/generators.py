"""Loops that generate the first homology of a closed surface, and the forms dual to them (3.1)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_integers
from .integer import integer_inverse

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

__all__ = ["Generators", "generators_of"]


@dataclass(frozen=True, eq=False)
class Generators:
    """2g loops of a closed surface that generate its homology, their dual forms and intersections.

    Attributes
    ----------
    surface : TriMesh
    genus : int
    generators : tuple of (k,) ndarray of int32
    dual_forms : ndarray, shape (2g, e), int32
    intersection : ndarray, shape (2g, 2g), int64
    """

    surface: TriMesh = field(repr=False)
    genus: int
    generators: tuple[NDArray[np.int32], ...] = field(repr=False)
    dual_forms: NDArray[np.int32] = field(repr=False)
    intersection: NDArray[np.int64]

    def length(self, loop: ArrayLike) -> float:
        """Length of a closed polygon through vertices of the surface, in units of ``V``.

        Raises
        ------
        ArrayError, IndexRangeError
            The loop is no array (k,) of vertices.
        """
        points = self.surface.V[self._vertices(loop)]
        return float(np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1).sum())

    def classes(self, loop: ArrayLike) -> NDArray[np.int64]:
        """Class (2g,) of a loop of edges over ``generators``: its periods, exact.

        Raises
        ------
        ArrayError
            The loop is no array (k,), or two consecutive vertices are not joined by an edge.
        IndexRangeError
            No vertex of the surface; ``ids`` are the places in the loop.
        """
        ids = self._vertices(loop).tolist()
        return _core.homology.periods(self.surface.topology, self.dual_forms, ids).astype(np.int64)

    def _vertices(self, loop: ArrayLike) -> NDArray[np.int64]:
        return as_integers(loop, "loop", (None,), 0, self.surface.n_vertices - 1)


def generators_of(
    surface: TriMesh,
) -> tuple[list[NDArray[np.int32]], NDArray[np.int32], NDArray[np.int64]]:
    """2g loops, the (2g, e) closed forms with period ``i == j`` over them, and their intersection.

    By a tree of short edges and one of the faces across the others, paper section 3.1.
    """
    top = surface.topology
    lists, forms = _core.homology.tree_cotree(top, _core.mesh.edge_lengths(top, surface.V))
    wedge = np.rint(_core.homology.wedge_matrix(top, forms.astype(float))).astype(np.int64)
    loops = [np.array(loop, dtype=np.int32) for loop in lists]
    return loops, forms, integer_inverse(wedge).T
