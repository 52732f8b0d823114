"""Even triangles, the topology kept: explicit remeshing by the optional package gpytoolbox.

Botsch, Kobbelt (SGP 2004): edges are split, collapsed and flipped towards one length, vertices
move within the surface. An edge is collapsed only where that keeps the surface a manifold, so the
genus stays what it was.
"""

from __future__ import annotations

import importlib.util
import math

from ..errors import MissingDependencyError, SolverError
from ..mesh.meshes import TriMesh

__all__ = ["even"]


def even(surface: TriMesh, faces: int, iterations: int = 10) -> TriMesh:
    """A closed surface with about so many triangles of about one size.

    Parameters
    ----------
    surface : TriMesh
        Closed, manifold.
    faces : int
    iterations : int
        Three make it coarse, ten even.

    Returns
    -------
    TriMesh
        Same genus; it may cross itself where it is thinner than its new edges.

    Raises
    ------
    MissingDependencyError
        If ``gpytoolbox`` is not installed.
    SolverError
        If what comes back is not a closed manifold of the same genus.
    """
    if importlib.util.find_spec("gpytoolbox") is None:
        raise MissingDependencyError(
            "remeshing needs gpytoolbox: pip install 'stretchmap[prepare]'"
        )
    from gpytoolbox import remesh_botsch

    edge = math.sqrt(surface.area / faces * 4.0 / math.sqrt(3.0))
    V, F = remesh_botsch(surface.V.copy(), surface.F.copy(), iterations, edge, True)
    after = TriMesh(V, F, orient=True)
    diagnosis = after.diagnose()
    if not diagnosis.ok or after.genus != surface.genus:
        found = ", ".join(d.name for d in diagnosis.defects) or f"genus {after.genus}"
        raise SolverError(f"remeshing to {faces} faces changed the surface ({found})")
    return after
