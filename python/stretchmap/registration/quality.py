"""How good a registration is, beyond what every map is measured by."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import KindError
from ..maps.given import as_map_of_solid
from ..maps.points import PointMap
from ..mesh.meshes import TetMesh

__all__ = ["inverse_consistency", "surface_distance"]


class RegistrationLike(Protocol):
    """A `Registration`, or one that was loaded."""

    @property
    def mesh(self) -> TetMesh: ...
    @property
    def target(self) -> TetMesh: ...
    @property
    def image(self) -> NDArray[np.float64]: ...


def inverse_consistency(there: RegistrationLike, back: RegistrationLike) -> NDArray[np.float64]:
    """How far points end from where they began, after one map and then the one that leads back.

    Parameters
    ----------
    there, back : Registration
        From A to B, and from B to A.

    Returns
    -------
    ndarray, shape (n,)
        Of every vertex of ``there.mesh``: the distance from its image under ``back`` after
        ``there``, as a share of the diagonal of A's bounding box. NaN where the point in between
        lies outside B's mesh, which nothing but rounding can do.

    Raises
    ------
    KindError
        ``back`` does not lead back: its source is not B, or its target not A; or one of them is no
        map onto a solid.

    Notes
    -----
    Christensen and Johnson, IEEE Trans. Med. Imaging 20(7), 2001, ask of a registration that this
    be zero. Two maps that are found apart from each other, each for its own least distortion, have
    it as their common measure of how far the correspondence is determined.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> pair = sm.samples.vertebra_pair(n_landmarks=4, n_tets=(600, 800))
    >>> there = sm.register(pair.source, pair.target)
    >>> back = sm.register(pair.target, pair.source)
    >>> bool(np.nanmedian(sm.inverse_consistency(there, back)) < 0.1)
    True
    """
    for given in (there, back):
        if as_map_of_solid(given, "inverse_consistency")[0].target is None:
            raise KindError("inverse_consistency needs maps onto solids; see register")
    n, m = there.target.n_vertices, back.target.n_vertices
    if not (
        np.array_equal(back.mesh.V[:n], there.target.V)
        and np.array_equal(there.mesh.V[:m], back.target.V)
    ):
        raise KindError("back must lead from the target of there to its source")
    ends = PointMap(back).forward(there.image).points
    size = float(np.linalg.norm(np.ptp(back.target.V, axis=0)))
    return np.asarray(np.linalg.norm(ends - there.mesh.V, axis=1) / size)


def surface_distance(result: RegistrationLike) -> float:
    """Hausdorff distance of the image's boundary from the target's surface, over the diagonal.

    From the target it is taken at the vertices, from the image at vertices, middles of edges and of
    faces; vertices lie on the target. What is sharper than the source's triangles is cut off.

    Parameters
    ----------
    result : Registration

    Returns
    -------
    float

    Examples
    --------
    >>> import stretchmap as sm
    >>> pair = sm.samples.vertebra_pair(n_landmarks=4, n_tets=(600, 800))
    >>> result = sm.register(pair.source, pair.target)
    >>> result.surface_distance < 0.1
    True
    """
    skin, F = result.image[result.mesh.boundary_vertices], result.mesh.surface.F
    goal = result.target.surface
    corners = skin[F]
    tried = np.concatenate(
        [corners.mean(axis=1), 0.5 * (corners + corners[:, [1, 2, 0]]).reshape(-1, 3)]
    )
    far = 0.0
    for surface, faces, points in ((goal.V, goal.F, tried), (skin, F, goal.V)):
        tree = _core.maps.SurfaceTree(np.ascontiguousarray(surface), faces)
        feet = tree.closest(np.ascontiguousarray(points))[0]
        far = max(far, float(np.linalg.norm(feet - points, axis=1).max()))
    return far / float(np.linalg.norm(np.ptp(goal.V, axis=0)))
