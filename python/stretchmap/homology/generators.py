"""Loops that generate the first homology of a closed surface, and the forms dual to them (3.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .integer import integer_inverse

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

__all__ = ["generators_of"]


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
