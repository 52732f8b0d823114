"""A map of the boundary of a thin wall on which both sides stay opposite each other.

Where a wall is one layer of tets thick, every tet has corners on both of its sides, and turns over
where their images are less opposite than they are; where there are a few, volumes pay for it. Areas
made equal on each side by itself drift apart. The conformal map does not: the boundary of such a
wall is nearly the double of a surface with two rims (with one, if it is twisted by an odd number of
half turns), and so the coordinates of both sides are those of that surface. All that is done to
them here can be done to both sides alike: each becomes a function of itself, so that volumes
between its levels are right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .. import _core
from ..area.result import AreaMap, mapped
from ..area.route import Made
from ..base.torus import TWO_PI, wrapped
from ..conformal.map import ConformalMap
from ..mesh.meshes import TetMesh, TriMesh
from ..mesh.normals import vertex_normals

__all__ = ["opposite_sides"]

_SAMPLE = 1_000  # vertices at most whose opposite ones are looked for
_TURNING = 0.25  # of the body's diagonal: how far away a normal is that is off by a radian
# Cosine between the normals of a pair, at most; times the median of their distances; share of the
# vertices that have a partner, at least.
_AWAY, _NEAR, _PAIRED = -0.8, 2.0, 0.3
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_MOST_TWISTS, _AS_GOOD = 12, 0.95  # half turns either way; of few vertices others fit by chance
# Mean of exp(i a), a what a pair is off being mirrored: with less it is no wall all over. Root mean
# square of the logarithm of what areas are off: with more, neither untangling nor gliding gets far.
_MIRRORED, _UNEVEN = 0.9, 0.4
_ANGLES = 1025
_THIN = 1e-12  # between levels, of a face that lies in one


def opposite_sides(solid: TetMesh, conformal: ConformalMap, ratio: float) -> AreaMap | None:
    """Map the boundary of a thin wall so that its sides are mirror images of each other.

    Parameters
    ----------
    solid : TetMesh
    conformal : ConformalMap
        Of ``solid.surface`` or an affine image of it.
    ratio : float
        ``R / r`` of the torus.

    Returns
    -------
    AreaMap or None
        None where the solid is no such wall, or areas would stay far off. Faces may look inward.
    """
    pairs = _opposite(conformal.mesh)
    if pairs is None:
        return None
    mirror = _mirror(conformal, pairs)
    if not mirror.agreement >= _MIRRORED:
        return None
    shares = _volume_shares(solid)
    wall = _leveled(mirror, conformal, shares)
    chart = _core.area.SurfaceChart(conformal.mesh.topology, conformal.forms)
    areas = _core.area.turn_areas(chart, wall.turns)
    if not (areas > 0.0).all():
        return None
    if float(np.average(np.log(areas / shares) ** 2, weights=shares)) > _UNEVEN**2:
        return None
    made = Made(
        wall.angles(ratio), wall.phase, ratio, [], False, "both sides of a thin wall mirrored"
    )
    return mapped(conformal.mesh, conformal.forms, made, None)


def _opposite(surface: TriMesh) -> NDArray[np.intp] | None:
    """Some vertices, each with the nearest that faces the other way: pairs (p, 2).

    Those at a rim, whose nearest is at another, are left out. None where few have one.
    """
    V, normals = surface.V, vertex_normals(surface.V, surface.F)
    known = np.flatnonzero(np.isfinite(normals[:, 0]))
    turning = _TURNING * np.linalg.norm(np.ptp(V, axis=0)) * normals
    # Not every so many: of a regular mesh those may all lie at a rim.
    places = np.arange(1, min(len(known), _SAMPLE) + 1) * _GOLDEN % 1.0
    some = known[np.unique((places * len(known)).astype(np.intp))]
    tree = cKDTree(np.hstack([V[known], turning[known]]))
    nearest = known[tree.query(np.hstack([V[some], -turning[some]]))[1]]
    away = (normals[some] * normals[nearest]).sum(axis=1) < _AWAY
    distances = np.linalg.norm(V[nearest] - V[some], axis=1)
    near = distances <= _NEAR * np.median(distances[away]) if away.any() else away
    pairs: NDArray[np.intp] = np.column_stack([some, nearest])[away & near]
    return pairs if len(pairs) > _PAIRED * len(some) else None


def _volume_shares(solid: TetMesh) -> NDArray[np.float64]:
    """Of the boundary faces, each of its corners giving a part of what is round it: (m,)."""
    volumes = _core.mesh.tet_volumes(solid.V, solid.T)
    rings = _core.measures.ring_sums(solid.T, volumes, solid.n_vertices)[solid.boundary_vertices]
    F = solid.surface.F
    parts = (rings / np.bincount(F.ravel()))[F].sum(axis=1)
    shares: NDArray[np.float64] = parts / parts.sum()
    return shares


@dataclass(frozen=True)
class _Mirror:
    """Sides mirrored at v = axis + twist u / 2, in turns: there a rim is.

    Half a turn of v away is the other one or, if the twist is odd, the same one again.
    """

    axis: float
    twist: int
    agreement: float


def _mirror(conformal: ConformalMap, pairs: NDArray[np.intp]) -> _Mirror:
    """The mirror on which pairs agree best."""
    u, v = conformal.turns[pairs].transpose(2, 1, 0)
    middle = u[0] + 0.5 * wrapped(u[1] - u[0])
    twists = range(-_MOST_TWISTS, _MOST_TWISTS + 1)
    sums = [v[0] + v[1] - twist * middle for twist in twists]
    means = [complex(np.exp(1j * TWO_PI * at).mean()) for at in sums]
    least = _AS_GOOD * max(map(abs, means))
    fitting = [row for row, mean in enumerate(means) if abs(mean) >= least]
    row = min(fitting, key=lambda row: abs(twists[row]))
    # A mean would be drawn aside by those next to a rim, which have no partner but to one side.
    mean = float(np.angle(means[row])) / TWO_PI
    twice = mean + float(np.median(wrapped(sums[row] - mean)))
    return _Mirror(0.5 * twice, twists[row], abs(means[row]))


@dataclass(frozen=True, eq=False)
class _Wall:
    """A thin wall by the volumes between levels of its coordinates.

    Attributes
    ----------
    u, v : ndarray, shape (n,)
        Turns, those along the rims by volume.
    away : ndarray, shape (n,)
        Share of the volume between the axis and each vertex, negative on the other side.
    mirror : _Mirror
    inside : bool
        Whether the rim at the axis is the shorter one.
    """

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    away: NDArray[np.float64]
    mirror: _Mirror
    inside: bool

    @property
    def turns(self) -> NDArray[np.float64]:
        """(n, 2) turns that fill a torus without a curvature evenly."""
        return np.ascontiguousarray(np.column_stack([self.u, self.v + 0.5 * self.away]))

    @property
    def phase(self) -> float:
        """Turns from the axis to where it is to lie on the torus."""
        return 0.0 if self.mirror.twist else (0.5 if self.inside else 0.0) - self.mirror.axis

    def angles(self, ratio: float) -> NDArray[np.float64]:
        """(n, 2) angles on the torus, as much volume of it between levels as of the wall.

        The rims of a wall without a twist lie at the outer and the inner equator, the shorter one
        inside, and its sides above each other.
        """
        phi = np.linspace(0.0, math.pi, _ANGLES)
        # Volume of the solid torus on the axis' side of the chord of angle 2 phi.
        below = ratio * (phi - np.sin(phi) * np.cos(phi))
        v = self.v
        if not self.mirror.twist:
            below += (-2.0 if self.inside else 2.0) / 3.0 * np.sin(phi) ** 3
            v = v + self.phase
        phi = np.interp(np.abs(self.away), below / below[-1], phi)
        angles = np.column_stack([TWO_PI * self.u, TWO_PI * v + np.copysign(phi, self.away)])
        return np.ascontiguousarray(angles)


def _leveled(mirror: _Mirror, conformal: ConformalMap, shares: NDArray[np.float64]) -> _Wall:
    F, (u, v) = conformal.mesh.F, conformal.turns.T
    around = _around(u, F, shares)
    away = wrapped(v - mirror.axis - 0.5 * mirror.twist * u)
    # Between which distances from the axis a face lies, those on both sides taken together. Where u
    # begins anew, the other rim may be the nearer one.
    corners = away[F[:, :1]] + _across(v[F]) - 0.5 * mirror.twist * _across(u[F])
    distances = np.abs(wrapped(corners))
    low, high = corners.min(axis=1), corners.max(axis=1)
    low, high = (
        np.where(np.floor(low) != np.floor(high), 0.0, distances.min(axis=1)),
        np.where(np.floor(low + 0.5) != np.floor(high + 0.5), 0.5, distances.max(axis=1)),
    )
    below = _below(low, high, shares, np.abs(away))
    if mirror.twist % 2:  # one rim, at the axis and half a turn away
        below = 0.5 * (below + 1.0 - _below(low, high, shares, 0.5 - np.abs(away)))
    nearer = float(_below(low, high, shares, np.array([0.25]))[0])
    at_axis = v - away + 0.5 * mirror.twist * (around - u)
    return _Wall(around, at_axis, np.copysign(below, away), mirror, nearer < 0.5)


def _around(
    u: NDArray[np.float64], F: NDArray[np.int32], shares: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Turns with equal shares between them, all round."""
    corners = u[F[:, :1]] + _across(u[F])
    corners -= np.floor(corners.min(axis=1, keepdims=True))
    low, high = corners.min(axis=1), corners.max(axis=1)
    low, high = np.concatenate([low, low - 1.0]), np.concatenate([high, high - 1.0])
    whole = np.floor(u)
    at = np.concatenate([[0.0, 1.0], u - whole])
    below = _below(low, high, np.concatenate([shares, shares]), at)
    around: NDArray[np.float64] = whole + (below[2:] - below[0]) / (below[1] - below[0])
    return around


def _below(
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    shares: NDArray[np.float64],
    at: NDArray[np.float64],
) -> NDArray[np.float64]:
    """What lies below some levels, of shares each of which lies evenly between two."""
    rate = shares / np.maximum(high - low, _THIN)
    levels = np.concatenate([low, high])
    order = np.argsort(levels, kind="stable")
    levels, rates = levels[order], np.cumsum(np.concatenate([rate, -rate])[order])
    below = np.concatenate([[0.0], np.cumsum(rates[:-1] * np.diff(levels))])
    found: NDArray[np.float64] = np.interp(at, levels, below / below[-1])
    return found


def _across(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turns from the first corners of faces (m, 3) to all of them."""
    return wrapped(corners - corners[:, :1])
