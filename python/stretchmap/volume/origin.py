"""Where u and v begin, by a rule: comparable from one individual and one mesh to another.

A map to the torus leaves open where its angles begin and which way they run. Either two landmarks
decide, or the shape: with x the place of a tet in the body, c the body's center of mass and

    M(a) = sum vol(t) |x_t - c|^2 exp(i a_t),

u begins at the phase of M(u), the direction round the hole in which the body reaches farthest,
and v at the phase of M(v). Both angles may be reversed together, and nothing else keeps
orientation: they run so that, taken from there, the moment

    sum vol(t) |x_t - c|^2 (sin 2 u_t + sin 2 v_t + sin(2 u_t - v_t))

is positive. It is one sum, not the largest of its terms, for of two of nearly the same size and of
opposite signs the mesh would decide. A body with mirror planes across both leaves that sign open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_points
from ..base.torus import TWO_PI
from ..errors import ArrayError, LandmarkError
from ..maps.given import as_map_of_solid
from ..maps.result import MapResult

__all__ = ["Origin", "origin_of"]


@dataclass(frozen=True)
class Origin:
    """Where the angles of a map begin, and which way they run.

    Attributes
    ----------
    u, v : float
        Of the map's own coordinates, radians.
    sign : int
        -1: both are reversed.
    sureness : tuple of float
        By shape: ``|M|`` of u and of v, and the moment that decides the sign, over
        ``sum vol(t) |x_t - c|^2``.
        Of a body that looks the same all round they are zero, and the rule means nothing. By
        landmarks: ones.

    Examples
    --------
    >>> import stretchmap as sm
    >>> found = sm.volume_map(sm.samples.vertebra_like(1500))
    >>> origin = sm.origin_of(found)
    >>> origin.coordinates(found.coordinates()).shape == found.image.shape
    True
    """

    u: float
    v: float
    sign: int
    sureness: tuple[float, float, float]

    def coordinates(self, given: ArrayLike) -> NDArray[np.float64]:
        """Coordinates (n, 3) of the map from this origin on, angles in [0, 2 pi).

        Rows of NaN, which a map gives to points outside its solid, stay as they are.
        """
        uvs = as_points(given, "given", or_none=True, or_lost=True)
        angles = self.sign * (uvs[:, :2] - [self.u, self.v])
        return np.column_stack([np.mod(angles, TWO_PI), uvs[:, 2]])


def origin_of(result: MapResult, landmarks: ArrayLike | None = None) -> Origin:
    """Fix where u and v of a map to the torus begin.

    Parameters
    ----------
    result : MapResult
        Of a solid, to a torus, as from `volume_map` or `load_map`.
    landmarks : array_like, shape (2, 3), optional
        Points of the source: u and v are zero at the first, and u of the second is below pi.
        Without them the shape decides, see above.

    Returns
    -------
    Origin

    Raises
    ------
    KindError
        No map of a solid.
    OptionError
        The map goes to no torus.
    ArrayError
        Not two landmarks.
    LandmarkError
        A landmark lies outside the solid, ``ids`` say which.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> found = sm.volume_map(sm.samples.vertebra_like(1500))
    >>> marks = found.mesh.V[found.mesh.boundary_vertices[[0, 40]]]
    >>> origin = sm.origin_of(found, marks)
    >>> turn = origin.coordinates(found.coordinates(marks))[0, :2] / (2 * np.pi)
    >>> bool(np.allclose(turn, np.round(turn)))
    True
    """
    mapped, mesh = as_map_of_solid(result, "where u and v begin")
    if landmarks is not None:
        return _by_landmarks(mapped, landmarks)
    u, v, _ = mapped.coordinates(mesh.V[mesh.T].mean(axis=1)).T
    volumes = mesh.tet_volumes
    centers = mesh.V[mesh.T].mean(axis=1)
    reach = volumes * ((centers - volumes @ centers / volumes.sum()) ** 2).sum(axis=1)
    known = np.isfinite(u)
    reach = np.where(known, reach, 0.0) / reach[known].sum()

    def moment(angle: NDArray[np.float64]) -> complex:
        return complex((reach * np.exp(1j * np.where(known, angle, 0.0))).sum())

    first = moment(u), moment(v)
    begin = [float(np.angle(m)) for m in first]
    odd = float(reach @ np.where(known, _odd(u - begin[0], v - begin[1]), 0.0))
    return Origin(
        begin[0], begin[1], 1 if odd >= 0.0 else -1, (abs(first[0]), abs(first[1]), abs(odd))
    )


def _odd(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Changes its sign where both angles do."""
    return np.asarray(np.sin(2.0 * u) + np.sin(2.0 * v) + np.sin(2.0 * u - v))


def _by_landmarks(result: MapResult, landmarks: ArrayLike) -> Origin:
    points = as_points(landmarks, "landmarks")
    if len(points) != 2:
        raise ArrayError(f"two landmarks fix where angles begin and which way, got {len(points)}")
    found = result.coordinates(points)
    outside = np.flatnonzero(~np.isfinite(found[:, 0]))
    if len(outside):
        raise LandmarkError("a landmark lies outside the solid", outside)
    if np.array_equal(points[0], points[1]):
        raise LandmarkError(
            "the two landmarks are the same point, so they tell no direction", [0, 1]
        )
    ahead = np.mod(found[1, 0] - found[0, 0], TWO_PI) < np.pi
    return Origin(float(found[0, 0]), float(found[0, 1]), 1 if ahead else -1, (1.0, 1.0, 1.0))
