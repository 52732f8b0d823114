"""Where the optimization of a grid starts: pulled back by the map, the best of some numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import describe
from ..base.progress import Progress
from ..base.torus import Torus
from ..errors import SolverError
from ..maps.given import as_map_of_solid, torus_of
from .layout import Layout, swept_layout
from .optimize import GridOptimizer
from .quality import MOST_MISSED, boundary_distances, boundary_quads, missed_volume
from .schedule import Schedule

if TYPE_CHECKING:
    from ..maps.points import PointMap
    from ..maps.result import MapResult
    from ..mesh.meshes import TetMesh

__all__ = ["TRIAL", "Start", "best_starts", "equal_axes", "pulled_back"]

_BISECTIONS = 40
_ON_TORUS = 1e-6  # of its radius, how far vertices of the boundary may be off
_DEEP = 0.1  # of its radius, below the torus: faces to be named where the core is outside
_KEPT = 2  # after the first rounds: which of them ends closer is not known yet
TRIAL = Schedule(even=tuple(np.geomspace(0.003, 1.0, 16)), powers=(1.0,) * 2 + (2.0,) * 2)


@dataclass(frozen=True, eq=False)
class Start:
    """A grid in the image and in the source.

    Attributes
    ----------
    numbers : tuple of int
        Sections, block, rings.
    layout : Layout
    grid : ndarray, shape (n, 3)
        In the image.
    pulled : ndarray, shape (n, 3)
        Pulled back to the source.
    V : ndarray, shape (n, 3)
        The same after the first rounds of optimization, if there were any.
    """

    numbers: tuple[int, int, int]
    layout: Layout
    grid: NDArray[np.float64]
    pulled: NDArray[np.float64]
    V: NDArray[np.float64]


def best_starts(
    result: MapResult,
    solid: TetMesh,
    candidates: Sequence[Sequence[int]] | NDArray[np.int_],
    progress: Progress | None = None,
) -> list[Start]:
    """The two grids whose boundaries are the closest to the surface after the first rounds.

    Where none is valid after them, or all have lost the surface, the closest as it was pulled back.

    Raises
    ------
    SolverError
        No candidate could be pulled back and begun with.
    """
    sound: list[tuple[float, Start]] = []
    lost: list[tuple[float, Start]] = []
    failure = None
    for numbers in candidates:
        start = pulled_back(result, numbers)
        H = start.layout.H
        optimizer = GridOptimizer(start.V, H, solid.surface)
        try:
            positive = optimizer.run(TRIAL, progress)
        except SolverError as error:
            failure = error
            continue
        away = max(boundary_distances(optimizer.V, boundary_quads(H), solid.surface))
        # Of what is tangled throughout, validity takes long to decide.
        if positive and missed_volume(optimizer.V, H, solid.surface) <= MOST_MISSED:
            sound.append((away, replace(start, V=optimizer.V)))
        else:
            lost.append((away, start))
    if not sound and not lost:
        raise SolverError(f"no grid could be begun with: {failure}") from failure
    ranked = sorted(sound or lost, key=lambda pair: pair[0])
    return [start for _, start in ranked[: _KEPT if sound else 1]]


def equal_axes(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric (3, 3) matrix A such that ``points @ A`` are spread alike in all directions."""
    variances, axes = np.linalg.eigh(np.cov(points.T))
    return np.asarray(axes / np.sqrt(np.maximum(variances, 1e-12 * variances.max())) @ axes.T)


def pulled_back(result: MapResult, numbers: Sequence[int] | NDArray[np.int_]) -> Start:
    """The grid as the map leaves it.

    The outermost points lie where the ray from the core through them leaves the image, so that they
    come to lie on the boundary of the source.
    """
    sections, block, rings = (int(k) for k in numbers)
    layout = swept_layout(sections, block, rings)
    torus, points = torus_of(result), result.point_map
    core = torus.xi(layout.u, layout.v, np.zeros(len(layout.u)))
    if not points.inverse(core).inside.all():
        raise _core_outside(result, torus)
    grid = torus.xi(layout.u, layout.v, layout.share * _reach(points, torus, layout.u, layout.v))
    located = points.inverse(grid)
    lost = np.flatnonzero(~located.inside)
    if len(lost):
        raise SolverError(f"{len(lost)} points of the grid lie outside the image", lost)
    return Start((sections, block, rings), layout, grid, located.points, located.points)


def _reach(
    points: PointMap, torus: Torus, u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest s, up to r, for which xi(u, v, s) lies in the image; by bisection."""
    low, high = np.zeros(len(u)), np.full(len(u), torus.r)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        inside = points.inverse(torus.xi(u, v, middle)).inside
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


def _core_outside(result: MapResult, torus: Torus) -> SolverError:
    """What keeps the core of the torus, which rays start from, outside the image.

    Vertices of the boundary lie on the torus, flat faces between them below it.
    """
    _, solid = as_map_of_solid(result, "a grid of hexahedra")
    corners = result.image[solid.boundary_vertices][solid.surface.F]  # (m, 3, 3)
    off = float(np.abs(torus.coordinates(corners.reshape(-1, 3))[2] / torus.r - 1.0).max())
    if off > _ON_TORUS:
        return SolverError(
            f"the core of the torus lies outside the image, whose boundary is up to {off:.2g} r "
            "off the torus; a grid needs the torus that the map goes to"
        )
    below = 1.0 - torus.coordinates(corners.mean(axis=1))[2] / torus.r
    deep = np.unique(solid.boundary_tets[below >= min(_DEEP, below.max())])
    return SolverError(
        f"the core of the torus lies outside the image: its boundary is too coarse at "
        f"{describe('tet', deep)}, whose flat faces lie up to {below.max():.2g} r below the torus; "
        "mesh the boundary finer and more evenly, as prepare() does, and map the solid again",
        deep,
    )
