"""Hexahedra of good shape whose boundary fits the surface of the solid.

The energy of the grid (`hex_energy.hpp`) has two parts: the distortion of every corner against a
box with its own sides, so that angles count and sizes hardly do, and squared distances between the
grid's boundary and the surface, seen from both. The boundary glides along the surface at no cost
and lies about it, now outside, now inside, so that the volume comes out right; points held on a
curved surface would enclose less than it does. First corners that are not positive are turned by a
regularized energy (Garanzha et al., ACM TOG 40(4), 2021), then a barrier keeps them while the worst
count more and more. Hexahedra that could turn over between corners are guarded by further triples
of their edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress, report
from ..mesh.meshes import TriMesh
from .quality import DIRECTIONS, EDGES, angle_weighted_normals, boundary_quads
from .schedule import ANY_SIZES, EVEN_SIZES, Schedule
from .sites import surface_sites

__all__ = ["GridOptimizer"]

_LARGEST_EPSILON, _LEAST_EPSILON = 0.3, 1e-3
_RESIDUAL = 0.01  # of their linear systems
_SMOOTHING = 1  # rounds that the logarithms of the boxes' sides are averaged
_MEAN = 0.3  # share of those means in the boxes; the rest are the edges themselves
_GUARD = 0.5  # hexahedra whose edge triples are all better are judged by their corners alone
_PER_SIDE = (3, 5)  # samples of a quad, squared, its corners among them; looked at closely
_FAR = 0.5  # of the tolerance: gaps that are longer are closed along themselves
_FIT = 60.0  # strength: a gap as large as the side of a mean quad costs as much as psi = 60
_LOOSE = 0.5  # share of it while corners are not positive
_TOLERANCE = 0.005  # of the diagonal: larger gaps count more ...
_NORM = 2.0  # ... with the power 2 _NORM at least
_OFFSET = 0.5  # share by which the error of the volume is made good from round to round ...
_MOST_OFFSET = 1.0  # ... by a surface moved in or out by this many tolerances at most
# Times the least gap so far: in needles the shape can win over the fit, and the grid swells.
_AWAY, _LOST = 1.5, 2.5
_LOOSER = 0.6  # factor of the fit where it is in the way
_HALVINGS = 4  # of a round whose steps led away from the surface
_HARDER = 2.0  # factor of the weight of a hexahedron each time it is found invalid
_REPAIRS = 10
_INVALID_ROUNDS = 12


class GridOptimizer:
    """A grid on its way.

    Parameters
    ----------
    V : ndarray, shape (n, 3)
    H : ndarray of int32, shape (k, 8)
    surface : TriMesh
        Boundary of the solid.
    closely : bool
        More samples, and distances to the quads of the boundary instead of triangles between their
        corners.

    Attributes
    ----------
    V : ndarray, shape (n, 3)
        Replaced as the grid gets better.
    """

    def __init__(
        self, V: NDArray[np.float64], H: NDArray[np.int32], surface: TriMesh, closely: bool = False
    ) -> None:
        self.V, self.H = np.array(V), H
        self._counts = np.bincount(H.ravel(), minlength=len(V))
        self._newton = _core.resample.HexNewton(H, len(V))
        quads = boundary_quads(H)
        per_side = _PER_SIDE[closely]
        self._tolerance = _TOLERANCE * float(np.linalg.norm(np.ptp(surface.V, axis=0)))
        self._fit = _core.resample.BoundaryFit(
            surface.V, surface.F, angle_weighted_normals(surface),
            *surface_sites(surface, per_side**2 * len(quads)), quads, per_side,
            _FAR * self._tolerance, closely,
        )  # fmt: skip
        self._strength = _FIT * len(quads) / surface.area
        self._area, self._volume, self._inward = surface.area, surface.volume, 0.0
        self._log_size = np.log(_core.resample.hex_volumes(V, H).sum() / len(H)) / 3.0
        self._weights = np.full(len(H), 1.0 / len(H))
        self._guarded = np.zeros(len(H), bool)
        self._sizes, self._steps = ANY_SIZES, Schedule.steps
        self._preconditioner, self._norm_share = Schedule.preconditioner, Schedule.norm_share
        self._largest_gap = np.inf
        self._matched: NDArray[np.float64] | None = None  # the points of self._samples

    def run(self, schedule: Schedule, progress: Progress | None = None) -> bool:
        """All stages; stops early, and returns False, where corners cannot be made positive.

        Raises
        ------
        SolverError
            A linear solve broke down.
        """
        self._steps, self._preconditioner = schedule.steps, schedule.preconditioner
        self._norm_share = schedule.norm_share
        if not self._untangle(schedule.untangle, progress):
            return False
        self._sizes = EVEN_SIZES
        for done, fit in enumerate(schedule.even):
            report(progress, "sizes", done, len(schedule.even), fit=fit)
            self._round(1.0, fit)
        self._sizes = ANY_SIZES
        valid, least = None, np.inf
        for done, power in enumerate(schedule.powers):
            report(progress, "optimize", done, len(schedule.powers), power=power)
            self._round(power, schedule.fit)
            if self._invalid().any():
                continue
            gap = max(self._gap(), self._tolerance)
            least = min(least, gap)
            if gap <= _AWAY * least:
                valid = self.V
            elif gap > _LOST * least and valid is not None:
                self.V = valid
                break
        for done in range(_INVALID_ROUNDS):
            invalid = self._invalid()
            report(progress, "validity", done, _INVALID_ROUNDS, invalid=int(invalid.sum()))
            if not invalid.any():
                return True
            # Harder on these, and the boundary gives way.
            self._weights[invalid] *= _HARDER
            self._descend(schedule.powers[-1], _LOOSER ** (done + 1), 1.0)
        if valid is not None and self._invalid().any():
            self.V = valid
        return True

    def _gap(self) -> float:
        if self._matched is not self.V:
            self._match(self.V, 1.0, 1.0)
        return self._largest_gap

    def _invalid(self) -> NDArray[np.bool_]:
        return np.asarray(_core.resample.valid_hexes(self.V, self.H) == 0)

    def _untangle(self, rounds: int, progress: Progress | None) -> bool:
        """Whether all edge triples are positive."""
        strength, least = _LOOSE, len(self.H) * 32
        for done in range(rounds + 1):
            self._prepare(strength, 1.0, drawn=False)
            start = self._newton.value(self.V, self._corner(1.0))
            report(progress, "untangle", done, rounds, bad=start.flips)
            if start.flips == 0:
                return True
            # A fit that holds corners where they cannot be turned is loosened.
            if start.flips >= least:
                strength *= _LOOSER
            least = min(least, start.flips)
            if done < rounds:
                self._regularized(start.min_det)
        return False

    def _round(self, power: float, fit: float) -> None:
        # The longest gaps are where tips are not reached, and closing them inflates the rest.
        excess = float(_core.resample.hex_volumes(self.V, self.H).sum()) - self._volume
        most = _MOST_OFFSET * self._tolerance
        self._inward = float(np.clip(self._inward + _OFFSET * excess / self._area, -most, most))
        # What the shape gains in weight, the fit gains, too.
        self._descend(power, fit * np.sqrt(power), self._norm(power))

    def _norm(self, power: float) -> float:
        """Power of the gaps; that of a grid too coarse to get near the surface stays low."""
        gap = max(self._largest_gap / self._tolerance, 1.0)
        return _NORM + max(self._norm_share * power - _NORM, 0.0) / gap**2

    def _descend(self, power: float, strength: float, norm: float) -> None:
        """Newton steps under the barrier, which guarded triples have to be inside of first."""
        self._prepare(strength, norm)
        if self._min_det() <= 0.0:
            if not self._repaired():
                self._guarded &= _core.resample.least_edge_jacobians(self.V, self.H) > 0.0
            self._prepare(strength, norm, guard=False)
        if self._min_det() > 0.0:
            self._advance(power, strength, norm)

    def _advance(self, power: float, strength: float, norm: float) -> None:
        """Newton steps, shortened until the energy falls with the samples of where they lead to.

        The samples' tangent planes hold nothing where the surface bends away from them: points that
        glide round a sharp crest leave it, and the round after would send them back.
        """
        before = self._newton.value(self.V, self._corner(0.0), power).energy
        V, _ = self._newton.run(
            self.V, self._corner(0.0), power, self._steps, tol=_RESIDUAL,
            preconditioner=self._preconditioner,
        )  # fmt: skip
        for _ in range(_HALVINGS + 1):
            self._match(V, strength, norm)
            if self._newton.value(V, self._corner(0.0), power).energy < before:
                self.V = V
                return
            V = 0.5 * (self.V + V)

    def _repaired(self) -> bool:
        """Whether all guarded triples are positive after regularized steps; undone if not.

        The fit is loose: against one that pulls hard these steps would fold half of the grid.
        """
        before = self.V
        for done in range(_REPAIRS):
            self._prepare(_LOOSE * _LOOSER**done, 1.0, drawn=False)
            min_det = self._min_det()
            if min_det > 0.0:
                return True
            self._regularized(min_det)
        self.V = before
        return False

    def _min_det(self) -> float:
        return self._newton.value(self.V, self._corner(1.0)).min_det

    def _regularized(self, min_det: float) -> None:
        epsilon = float(np.clip(-0.5 * min_det, _LEAST_EPSILON, _LARGEST_EPSILON))
        self.V, _ = self._newton.run(
            self.V, self._corner(epsilon), 1.0, Schedule.steps, preconditioner=self._preconditioner
        )

    def _prepare(
        self, strength: float, norm: float, *, guard: bool = True, drawn: bool = True
    ) -> None:
        """Boxes and samples of the boundary for the present points.

        While hexahedra are inverted, boxes drawn to the mean size would inflate those round them,
        and every round would fold more.
        """
        if guard:
            self._guarded |= _core.resample.least_edge_jacobians(self.V, self.H) < _GUARD
        pull = self._sizes.pull if drawn else 0.0
        self._newton.set_rest(self._sides(_MEAN, pull), self._weights, self._guarded)
        self._match(self.V, strength, norm)

    def _match(self, V: NDArray[np.float64], strength: float, norm: float) -> None:
        if self._matched is not V:
            self._samples, self._matched = self._fit.match(V), V
            self._largest_gap = float(self._samples.distance.max())
        factor = strength * self._strength * self._samples.share
        self._newton.set_fit(self._samples, factor, self._tolerance, norm, self._inward)

    def _sides(self, mean: float, pull: float) -> NDArray[np.float64]:
        """(k, 24) sides of the corners' boxes: their own edges, drawn to local means, and hexahedra
        to the mean size."""
        own = _core.resample.corner_sides(self.V, self.H)
        logs = np.log(np.maximum(own, 1e-12 * own.max()))
        if mean > 0.0:
            means = self._mean_sides()
            logs += mean * (means[:, DIRECTIONS.ravel()] - logs)
            drawn = pull * (self._log_size - means.mean(axis=1))
            logs += np.clip(drawn, -self._sizes.most, self._sizes.most)[:, None]
        return np.ascontiguousarray(np.exp(logs))

    def _mean_sides(self) -> NDArray[np.float64]:
        """(k, 3) logarithms of mean lengths of parallel edges, smoothed over the hexahedra round
        each point."""
        edges = self.V[self.H[:, EDGES[..., 1]]] - self.V[self.H[:, EDGES[..., 0]]]
        lengths = np.sqrt(np.einsum("kdei,kdei->kde", edges, edges)).mean(axis=-1)
        logs = np.log(np.maximum(lengths, 1e-12 * lengths.max()))
        corners = self.H.ravel()
        for _ in range(_SMOOTHING):
            sums = [np.bincount(corners, np.repeat(column, 8)) for column in logs.T]
            logs = (np.stack(sums, axis=1) / self._counts[:, None])[self.H].mean(axis=1)
        return np.asarray(logs)

    def _corner(self, epsilon: float) -> _core.volume.EnergyWeights:
        return _core.volume.EnergyWeights(1.0, self._sizes.volume, epsilon)
