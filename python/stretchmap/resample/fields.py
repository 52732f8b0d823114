"""Fields carried from one solid to another."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from ..base.arrays import as_reals
from ..base.options import one_of
from ..errors import DegenerateError
from ..maps.given import as_map_of_solid, target_of
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh

__all__ = ["transfer"]


def transfer(
    registration: MapResult,
    values: ArrayLike,
    *,
    conserve: Literal["integral", "mean"] = "integral",
    per: Literal["vertex", "tet"] = "vertex",
) -> NDArray[np.float64]:
    """Carry a field from the source to the target of a registration.

    Every target tet gets the mean of the field over it, by a four-point rule of the pulled-back
    field; a point in the thin space between the image's and the target's boundary takes the value
    of the nearest image vertex. What then misses of the integral is added tet by tet, in
    proportion to the room between the mean and the extreme values the rule met in that tet: most
    where the field is steep, nothing where it is constant. Only what does not fit into that room
    (the map does not preserve volume where the field is large) is added in proportion to the
    distance from the extreme values of the whole field. So the result stays within the range of
    the field, whatever its sign and however small its mean, and a constant stays one.

    Parameters
    ----------
    registration : Registration, or LoadedMap of one
    values : array_like, shape (n,) or (k,), or (n, c) or (k, c)
        At the vertices of ``registration.mesh`` or in its tets, see ``per``. The columns of a
        vector field are carried one by one; their directions are not turned.
    conserve : {"integral", "mean"}
        What agrees, to rounding: the integral over the solid (for a density), or its mean. They
        differ, by a factor common to all tets, if the volumes do.
    per : {"vertex", "tet"}

    Returns
    -------
    ndarray, shape (target.n_tets,) or (target.n_tets, c)

    Raises
    ------
    ArrayError
        If ``values`` has the wrong shape or holds no real numbers.
    NonFiniteError
        If ``values`` holds a NaN or an infinity; ``ids`` are the rows.
    OptionError
        If an option is unknown or the map is no registration.
    KindError
        If it is no map of a solid.
    DegenerateError
        If a tet of source or target has no positive volume; ``ids`` are the tets.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> result = sm.register(sm.samples.solid_torus(600), sm.samples.bumpy_torus(1000))
    >>> source, target = result.mesh, result.target
    >>> mass = sm.transfer(result, np.full(source.n_tets, 2.0), per="tet")  # a density
    >>> bool(np.isclose(mass @ target.tet_volumes, 2.0 * source.volume))
    True
    """
    registration, solid = as_map_of_solid(registration, "carrying a field")
    target = target_of(registration, "carrying a field")
    one_of("conserve", conserve, ("integral", "mean"))
    one_of("per", per, ("vertex", "tet"))
    for mesh, name in ((solid, "source"), (target, "target")):
        flat = np.flatnonzero(~(mesh.tet_volumes > 0.0))
        if len(flat):
            raise DegenerateError(f"{len(flat)} tets of the {name} have no positive volume", flat)
    count = solid.n_vertices if per == "vertex" else solid.n_tets
    field = as_reals(values, "values", (count,), (count, None))
    columns = field.reshape(count, -1)
    # A power of two, so that no sum overflows and nothing is rounded.
    unit = np.ldexp(1.0, np.frexp(np.abs(columns).max(initial=0.0))[1] - 1)
    columns = columns / unit
    samples = _samples(registration, solid, target, columns, per)
    means = np.clip(samples.mean(axis=1), samples.min(axis=1), samples.max(axis=1))
    per_tet = columns[solid.T].mean(axis=1) if per == "vertex" else columns
    wanted = solid.tet_volumes @ per_tet / solid.volume
    rounding = _rounding(solid, np.abs(per_tet)) + _rounding(target, np.abs(means))
    for low, high in (
        (samples.min(axis=1), samples.max(axis=1)),
        (columns.min(axis=0), columns.max(axis=0)),
    ):
        means = _shifted(means, target.tet_volumes, wanted, rounding, low, high)
    if conserve == "integral":
        means *= solid.volume / target.volume
    return np.reshape(means * unit, (target.n_tets, *field.shape[1:]))


def _samples(
    registration: MapResult,
    solid: TetMesh,
    target: TetMesh,
    columns: NDArray[np.float64],
    per: str,
) -> NDArray[np.float64]:
    """(k, 4, c) The pulled-back field at the points of a rule of degree two in the target tets."""
    weight = (5.0 - np.sqrt(5.0)) / 20.0
    rule = np.full((4, 4), weight) + (1.0 - 4.0 * weight) * np.eye(4)
    points = np.einsum("qc,tcx->tqx", rule, target.V[target.T]).reshape(-1, 3)
    found = registration.point_map.inverse(points)
    if per == "vertex":
        carried = found.interpolate(solid.T, columns)
        corners = columns[solid.T[found.tets]]  # weights sum to one but for rounding
        carried = np.clip(carried, corners.min(axis=1), corners.max(axis=1))
        sites = registration.image
    else:
        carried = columns[found.tets]
        sites = registration.image[solid.T].mean(axis=1)
    outside = ~found.inside
    if outside.any():
        carried[outside] = columns[cKDTree(sites).query(points[outside])[1]]
    return carried.reshape(target.n_tets, 4, -1)


def _rounding(mesh: TetMesh, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """What rounding may make of a mean over so many tets, their errors being as if at random."""
    unit = np.finfo(float).eps * np.sqrt(mesh.n_tets)
    return np.asarray(unit * (mesh.tet_volumes @ sizes) / mesh.volume)


def _shifted(
    means: NDArray[np.float64],
    volumes: NDArray[np.float64],
    wanted: NDArray[np.float64],
    rounding: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The means moved towards a bound, all by the same share, until theirs is as wanted.

    At most up to the bound. Rounding is not made up for: nothing is to be spread over tets where
    the field is zero that is missing nowhere.
    """
    missing = volumes.sum() * wanted - volumes @ means
    missing[np.abs(missing) <= volumes.sum() * rounding] = 0.0
    room = np.where(missing > 0.0, high - means, low - means)
    most = volumes @ room
    share = np.divide(missing, most, out=np.zeros_like(missing), where=most != 0.0)
    return np.asarray(means + np.clip(share, 0.0, 1.0) * room)
