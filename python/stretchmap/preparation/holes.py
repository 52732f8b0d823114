"""Closing holes, and removing the faces where a surface crosses itself."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import describe
from ..errors import SelfIntersectionError
from ..mesh.meshes import TriMesh
from .soup import Faces, Points, keep_largest, part_sheets

__all__ = ["close_holes", "crossings", "remove_crossings"]

_MOST_PAIRS = 1_000_000
_ROUNDS = 8


def close_holes(V: Points, F: Faces) -> tuple[Points, Faces, dict[str, Any]]:
    """Fill every hole with a triangulation of least area over its border.

    Parameters
    ----------
    V, F : ndarrays
        A manifold, oriented, as `part_sheets` returns it.

    Returns
    -------
    V, F : ndarrays
        Closed; the faces of the fillings come last.
    counts : dict
        ``holes``, ``longest`` border (number of edges), ``faces`` added.
    """
    fill = _core.mesh.BorderFill(V, _core.mesh.SurfaceTopology(F, len(V)))
    counts = {
        "holes": len(fill.loops),
        "longest": max(map(len, fill.loops), default=0),
        "faces": len(fill.faces),
    }
    if not fill.loops:
        return V, F, counts
    V = np.ascontiguousarray(np.vstack([V, fill.centers]))
    F = np.ascontiguousarray(np.vstack([F, fill.faces]))
    turn = _core.mesh.misoriented_faces(V, F)  # of a closed surface: which side is outside
    F[turn] = F[turn][:, [0, 2, 1]]
    return V, F, counts


def crossings(surface: TriMesh) -> NDArray[np.int32]:
    """Pairs of faces (k, 2) that meet beyond what they share by number."""
    return _core.certificate.crossing_faces(surface.V, surface.F, _MOST_PAIRS)


def remove_crossings(surface: TriMesh) -> tuple[TriMesh, dict[str, int]]:
    """Cut out the faces that cross others, with wider surroundings in every round, and refill.

    Parameters
    ----------
    surface : TriMesh
        Closed and manifold.

    Returns
    -------
    surface : TriMesh
        Without self-intersections; its genus may be less.
    counts : dict
        ``crossing`` pairs found at first, ``removed`` faces, ``rounds``.

    Raises
    ------
    SelfIntersectionError
        It still crosses itself in the end; ``ids`` are the faces.
    """
    counts = {"crossing": 0, "removed": 0, "rounds": 0}
    for rings in range(_ROUNDS):
        pairs = crossings(surface)
        if not len(pairs):
            return surface, counts
        counts["crossing"] = counts["crossing"] or len(pairs)
        bad = _grown(surface.F, np.unique(pairs), rings)
        if bad.sum() > 0.5 * len(bad):
            break
        counts["removed"] += int(bad.sum())
        counts["rounds"] += 1
        V, F, _ = part_sheets(surface.V, surface.F[~bad])
        V, F, _ = keep_largest(V, F)
        V, F, _ = close_holes(V, F)
        surface = TriMesh(V, F)
    ids = np.unique(crossings(surface))
    if not len(ids):
        return surface, counts
    raise SelfIntersectionError(
        f"the surface crosses itself at {describe('face', ids)} and cutting those out did not "
        "help; repair it there, or ask for more faces",
        ids.tolist(),
    )


def _grown(F: Faces, ids: NDArray[np.int32], rings: int) -> NDArray[np.bool_]:
    """Mask of some faces and of those within so many rings of neighbors."""
    grown: NDArray[np.bool_] = np.zeros(len(F), bool)
    grown[ids] = True
    at = np.zeros(F.max() + 1, bool)
    for _ in range(rings):
        at[F[grown]] = True
        grown = np.asarray(at[F].any(axis=1))
    return grown
