"""Fields carried from one solid to another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from ..errors import ArrayError, OptionError

if TYPE_CHECKING:
    from ..maps.files import LoadedMap
    from ..registration.map import Registration

__all__ = ["transfer"]


def transfer(
    registration: Registration | LoadedMap,
    values: ArrayLike,
    *,
    conserve: str = "integral",
    per: str = "vertex",
) -> NDArray[np.float64]:
    """Carry a scalar field from the source to the target of a registration.

    Every target tet gets the mean of the field over it, by a four-point rule of the pulled-back
    field; a point in the thin space between the image's and the target's boundary takes the value
    of the nearest image vertex. The rule does not see the kinks of the field, so that the sum comes
    out right only nearly; one factor for all tets then makes it exact.

    Parameters
    ----------
    registration : Registration or LoadedMap
    values : array_like, shape (n,) or (k,)
        At the vertices of ``registration.solid`` or in its tets, see ``per``.
    conserve : {"integral", "mean"}
        What agrees exactly: the integral over the solid (for a density), or its mean. They differ
        if the volumes do.
    per : {"vertex", "tet"}

    Returns
    -------
    ndarray, shape (target.n_tets,)

    Raises
    ------
    ArrayError
        If ``values`` has the wrong shape.
    OptionError
        If an option is unknown, the map is no registration, or the sum is zero while the carried
        field's is not, so that no factor exists.
    """
    solid, target = registration.solid, getattr(registration, "target", None)
    if solid is None or target is None:
        raise OptionError("a field is carried by a registration; this map has no target solid")
    if conserve not in ("integral", "mean") or per not in ("vertex", "tet"):
        raise OptionError(f"conserve is integral or mean, per is vertex or tet: {conserve}, {per}")
    field = np.asarray(values, float)
    count = solid.n_vertices if per == "vertex" else solid.n_tets
    if field.shape != (count,):
        raise ArrayError(f"values must have shape ({count},), got {field.shape}")
    weight = (5.0 - np.sqrt(5.0)) / 20.0
    rule = np.full((4, 4), weight) + (1.0 - 4.0 * weight) * np.eye(4)
    samples = np.einsum("qc,tcx->tqx", rule, target.V[target.T]).reshape(-1, 3)
    found = registration.point_map.inverse(samples)
    if per == "vertex":
        carried = found.interpolate(solid.T, field)
        sites, at_sites = registration.image, field
        total = float((solid.tet_volumes * field[solid.T].mean(axis=1)).sum())
    else:
        carried = field[found.tets]
        sites, at_sites = registration.image[solid.T].mean(axis=1), field
        total = float((solid.tet_volumes * field).sum())
    outside = ~found.inside
    if outside.any():
        carried[outside] = at_sites[cKDTree(sites).query(samples[outside])[1]]
    means = carried.reshape(-1, 4).mean(axis=1)
    if conserve == "mean":
        total *= target.volume / solid.volume
    have = float((target.tet_volumes * means).sum())
    if have == total:
        return means
    if have == 0.0 or total == 0.0:
        raise OptionError("the field sums to zero: no factor conserves its sum; add a constant")
    return means * (total / have)
