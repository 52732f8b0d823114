"""Even triangles, the topology kept: explicit remeshing by the optional package gpytoolbox.

Botsch, Kobbelt (SGP 2004): edges are split, collapsed and flipped towards one length, vertices
move within the surface. An edge is collapsed only where that keeps the surface a manifold, so the
genus stays what it was. Long edges are split first: vertices move to the mean of their neighbors,
which at the end of a long edge are far away, so that surfaces of long, thin triangles, as CAD gives
them, would fold and shrink.
"""

from __future__ import annotations

import importlib.util
import math
import warnings

import numpy as np

from ..errors import MissingDependencyError, SolverError
from ..mesh.meshes import TriMesh
from .split import split_long_edges

__all__ = ["even", "has_long_edges"]

_LONG = 4.0  # of an edge that is split, over the edges aimed at


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
    with warnings.catch_warnings():  # of names in SciPy and NumPy that it imports
        warnings.filterwarnings("ignore", category=DeprecationWarning, module=r"gpytoolbox(\.|$)")
        from gpytoolbox import remesh_botsch

    edge = math.sqrt(surface.area / faces * 4.0 / math.sqrt(3.0))
    halved = split_long_edges(surface, _LONG * edge)
    V, F = remesh_botsch(halved.V.copy(), halved.F.copy(), iterations, edge, True)
    after = TriMesh(V, F, orient=True)
    diagnosis = after.diagnose()
    if not diagnosis.ok or after.genus != surface.genus:
        found = ", ".join(d.name for d in diagnosis.defects) or f"genus {after.genus}"
        raise SolverError(f"remeshing to {faces} faces changed the surface ({found})")
    return after


def has_long_edges(surface: TriMesh, edge: float) -> bool:
    """Whether edges are split before a surface is remeshed to edges of a length."""
    ends = surface.V[surface.edges]
    return bool(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max() > _LONG * edge)
