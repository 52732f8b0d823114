"""A grid optimized from coarse to fine: the best of some choices, then split in eight."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress
from ..base.torus import Torus
from ..errors import SolverError
from ..mesh.meshes import TriMesh
from .layout import prolongation, swept_layout
from .optimize import GridOptimizer
from .quality import MOST_MISSED, boundary_distances, boundary_quads, missed_volume
from .schedule import Schedule
from .start import TRIAL, Start, best_starts, equal_axes, pulled_back

if TYPE_CHECKING:
    from ..maps.result import MapResult
    from ..mesh.meshes import TetMesh

__all__ = ["coarse_grid", "halvings_for", "levels_for", "refined", "require_valid"]

_COARSE = 16_000  # hexahedra that are optimized at once ...
_COMPARED = 6_000  # ... and, of grids split more than once, that choices are compared with
_MANY = 100_000  # are finished with few steps, between two splits, too
# Of grids as close to the surface as these shares of the diagonal, or none of them, but all within
# this factor of the closest, the shape decides. Of half a per cent samples may miss some.
_CLOSE, _ALIKE = (0.0045, 0.005), 1.25
# A grid that is farther off, by up to this factor of those: one rim or tip is outweighed by all
# that lies well round it. Angles pay for it, for nothing where half a per cent is not reached.
_REACH = 2.0
_CLOSING = Schedule(powers=(12.0,) * 8, norm_share=4.0 / 3.0)
# Of a grid that was split in eight: smaller quads fit better.
_FINER = Schedule(
    fit=3.0,
    powers=(*(2.0,) * 2, *(3.0,) * 2, *(4.0,) * 2, *(6.0,) * 3, *(8.0,) * 3, *(12.0,) * 3),
)
_BETWEEN = Schedule(fit=3.0, powers=(2.0, 3.0, 4.0, 6.0, 8.0, 12.0))  # to be split once more
# Split twice or more.
_FINEST = Schedule(fit=3.0, powers=(4.0, 8.0, 12.0), steps=1, preconditioner="jacobi")
_CHOSEN = replace(_FINER, even=TRIAL.even, fit=1.0)  # what half of its numbers was compared with


def levels_for(count: float) -> int:
    """How many times the grid to begin with is split in eight for so many hexahedra."""
    levels = 0
    while count > _COARSE * 8**levels:
        levels += 1
    return levels


def halvings_for(count: float) -> int:
    """How many times all numbers are to be even: once more where choices are compared by halves."""
    levels = levels_for(count)
    return levels + (levels > 1 and count > _COMPARED * 8**levels)


def coarse_grid(
    result: MapResult,
    solid: TetMesh,
    candidates: NDArray[np.int_],
    levels: int,
    progress: Progress | None,
) -> Start:
    """The best of some grids, optimized, to be split so many times.

    Which one it is, half of the numbers tell of a large grid to be split more than once.

    Parameters
    ----------
    result : VolumeMap or LoadedMap
    solid : TetMesh
    candidates : ndarray of int, shape (m, 3)
        Sections, block, rings.
    levels : int
    progress : Progress, optional

    Raises
    ------
    SolverError
        Hexahedra are left that could not be made valid.
    """
    count = (candidates[:, 0] * candidates[:, 1] * (candidates[:, 1] + 4 * candidates[:, 2])).max()
    if levels < 2 or count <= _COMPARED or (candidates % 2).any() or len(candidates) == 1:
        return _best_optimized(best_starts(result, solid, candidates, progress), solid, progress)
    best = best_starts(result, solid, candidates // 2, progress)[0]
    start = pulled_back(result, [2 * k for k in best.numbers])
    return replace(start, V=optimized(start.V, start.layout.H, solid, _CHOSEN, progress))


def refined(
    start: Start, torus: Torus, levels: int, solid: TetMesh, progress: Progress | None
) -> Start:
    """The grid after it was split in eight so many times, and optimized each time.

    Raises
    ------
    SolverError
        Hexahedra are left that could not be made valid.
    """
    for level in range(1, levels + 1):
        finer = prolongation(*start.numbers)
        sections, block, rings = (2 * k for k in start.numbers)
        layout = swept_layout(sections, block, rings)
        V, pulled = (np.ascontiguousarray(finer @ points) for points in (start.V, start.pulled))
        finest = level == levels or len(layout.H) > _MANY
        schedule = _FINER if levels == 1 else _FINEST if finest else _BETWEEN
        V = optimized(V, layout.H, solid, schedule, progress)
        grid = torus.xi(layout.u, layout.v, layout.share * torus.r)
        start = Start((sections, block, rings), layout, grid, pulled, V)
    return start


def optimized(
    V: NDArray[np.float64],
    H: NDArray[np.int32],
    solid: TetMesh,
    schedule: Schedule,
    progress: Progress | None,
) -> NDArray[np.float64]:
    """Points of a grid after all rounds, its hexahedra valid.

    Raises
    ------
    SolverError
        Hexahedra are left that could not be made valid.
    """
    surface = solid.surface
    optimizer = GridOptimizer(V, H, surface)
    better = optimizer.V if optimizer.run(schedule, progress) else None
    if better is None or missed_volume(better, H, surface) > MOST_MISSED:
        # Of a solid tens of times as long as thick, edges are next to parallel: angles do not
        # untangle it, or swell it; what is valid with its axes equal is valid as it is.
        axes = equal_axes(surface.V)
        evened = TriMesh(np.ascontiguousarray(surface.V @ axes), surface.F)
        optimizer = GridOptimizer(np.ascontiguousarray(V @ axes), H, evened)
        optimizer.run(schedule, progress)
        other = np.ascontiguousarray(np.linalg.solve(axes, optimizer.V.T).T)
        if better is None or missed_volume(other, H, surface) < missed_volume(better, H, surface):
            better = other
    require_valid(
        better, H, "try other numbers of sections, block or rings, optimize=False returns the "
        "grid as it was pulled back",
    )  # fmt: skip
    return better


def require_valid(V: NDArray[np.float64], H: NDArray[np.int32], remedy: str) -> None:
    """Raise SolverError with the ids of hexahedra that are not valid, if there are any."""
    left = np.flatnonzero(_core.resample.valid_hexes(V, H) == 0)
    if len(left):
        raise SolverError(f"{len(left)} hexahedra could not be made valid; {remedy}", left)


def _best_optimized(starts: list[Start], solid: TetMesh, progress: Progress | None) -> Start:
    """The start that ends best, its points optimized: close to the surface, then of good shape.

    Raises
    ------
    SolverError
        Hexahedra of each are left that could not be made valid; those of the first.
    """
    ended: list[tuple[float, float, Start]] = []
    failure = None
    for start in starts:
        H = start.layout.H
        try:
            V = optimized(start.V, H, solid, Schedule(), progress)
        except SolverError as error:
            failure = failure or error
            continue
        ended.append(_judged(start, V, solid))
        if _CLOSE[0] < ended[-1][0] <= _REACH * _CLOSE[-1]:
            closer = _closer(V, H, solid, progress)
            further = None if closer is None else _judged(start, closer, solid)
            if further is not None and further[0] <= _CLOSE[-1]:
                ended.append(further)
    if failure is not None and not ended:
        raise failure
    closest = min(away for away, _, _ in ended)
    limit = next((close for close in _CLOSE if closest <= close), _ALIKE * closest)
    return max((end for end in ended if end[0] <= limit), key=lambda end: end[1])[2]


def _judged(start: Start, V: NDArray[np.float64], solid: TetMesh) -> tuple[float, float, Start]:
    """Distance from the surface over the diagonal, least scaled Jacobian, and the grid."""
    H = start.layout.H
    diagonal = float(np.linalg.norm(np.ptp(solid.V, axis=0)))
    away = max(boundary_distances(V, boundary_quads(H), solid.surface)) / diagonal
    return away, float(_core.resample.scaled_jacobians(V, H).min()), replace(start, V=V)


def _closer(
    V: NDArray[np.float64], H: NDArray[np.int32], solid: TetMesh, progress: Progress | None
) -> NDArray[np.float64] | None:
    """Points after rounds in which the largest gaps count more; None where these break down."""
    optimizer = GridOptimizer(V, H, solid.surface, closely=True)
    try:
        optimizer.run(_CLOSING, progress)
    except SolverError:
        return None
    return optimizer.V if missed_volume(optimizer.V, H, solid.surface) <= MOST_MISSED else None
