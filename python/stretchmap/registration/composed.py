"""A start for a registration by way of the solid torus: one volume map, and another one back.

Solids that differ too much for the inside to follow a boundary laid directly on the other may yet
both be mapped onto the solid torus, each keeping its volumes. From there to there, volumes are kept
but for the shapes of the two tori and what is bent within a tet.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.budget import Budget, Spent
from ..base.progress import Progress
from ..base.torus import TWO_PI, wrapped
from ..errors import MeshError, SolverError
from ..maps.points import PointMap
from ..mesh.meshes import TetMesh
from ..mesh.split_edges import SplitSolid
from ..volume.certified import certified_map
from ..volume.options import FillOptions, VolumeOptions
from ..volume.problem import VolumeProblem
from ..volume.result import VolumeMap
from .embed import EmbeddedBoundary, embed_boundary, split_long_edges
from .flat_torus import FlatSurface, Gauge, choose_gauge

__all__ = ["Composed", "composed"]

# Of the target's diagonal: a point that far outside the image of a map, as between the chord of an
# edge and the torus, is carried by the nearest tet.
_OUTSIDE = 0.05
_HALVINGS = 50  # of an angle
_GLIDES = 40  # most steps with a gliding boundary: volumes are made even on the target once more


@dataclass(frozen=True, eq=False)
class Composed:
    """What `composed` leaves behind.

    Attributes
    ----------
    boundary : EmbeddedBoundary
    problem : VolumeProblem
        With the whole image to go on from; a few tets may be inverted.
    gauge : Gauge
    """

    boundary: EmbeddedBoundary
    problem: VolumeProblem
    gauge: Gauge


def composed(
    source: TetMesh,
    target: TetMesh,
    options: FillOptions,
    budget: Budget,
    progress: Progress | None,
) -> Composed | None:
    """The volume map of the source, then the inverse of the target's.

    Parameters
    ----------
    source, target : TetMesh
    options : FillOptions
        Whether the meshes may be refined.
    budget : Budget
        Of both maps.
    progress : Progress or None

    Returns
    -------
    Composed or None
        None if a map could not be had in time, or its boundary would cross itself.
    """
    maps: list[VolumeMap] = []
    for solid in (source, target):
        found = _volume_map(solid, options, budget, progress)
        if found is None:
            return None
        maps.append(found)
    there, back = maps
    try:
        first, second = _flat_of(source, there), _flat_of(target, back)
        second = split_long_edges(SplitSolid.of(target), second)[1]
        gauge = choose_gauge(first, second, None)
        split, first = split_long_edges(SplitSolid.of(source), first.changed(gauge))
        points = second.points(first.turns)
    except (MeshError, SolverError):
        return None  # folded in the flat torus, though not on the one of revolution
    boundary = embed_boundary(split, second, first, points, np.zeros(0, np.int32))
    if len(boundary.crossings):
        return None
    solid = boundary.split.solid
    problem = VolumeProblem.of(solid, boundary.points, ground=target.surface, refine=options.refine)
    inner = np.ones(problem.solid.n_vertices, bool)
    inner[solid.boundary_vertices] = False
    image = _carried(problem.solid.V[inner], there, back, gauge)
    if not np.isfinite(image).all():
        return None
    x = problem.x.copy()
    x[inner] = (image - problem.center) / problem.length
    problem = dataclasses.replace(problem, x=x, warm=True)
    return Composed(boundary, problem, gauge)


def _volume_map(
    solid: TetMesh, options: FillOptions, budget: Budget, progress: Progress | None
) -> VolumeMap | None:
    """A certified one, if it can be had in the time left."""

    def note(stage: str, done: int, total: int, **values: float) -> None:
        if budget.spent:
            raise Spent
        if progress is not None:
            progress(stage, done, total, **values)

    wanted = VolumeOptions(
        refine=options.refine,
        time_limit=max(budget.left, 1e-3) / solid.n_tets,
        glide_iter=_GLIDES,
        target_iter=0,
        shift_iter=0,
    )
    try:
        found = certified_map(solid, wanted, None, glide=True, progress=note)
    except (Spent, MeshError, SolverError):
        return None
    return found if found.certificate.certified else None


def _flat_of(solid: TetMesh, found: VolumeMap) -> FlatSurface:
    """The boundary in (u, s) turns of its image on a torus, s so that areas are even there.

    Raises
    ------
    SolverError
        If edges go so far round that their way is not known.
    """
    surface, began = solid.surface, found.boundary_map
    u, v, _ = found.torus.coordinates(found.image[solid.boundary_vertices])
    turns = np.stack([u, v + np.sin(v) / found.torus.ratio], axis=1) / TWO_PI
    low, high = surface.edges.T
    forms = -np.round(turns[high] - turns[low]).T.astype(np.int32)
    if began is not None and np.array_equal(began.mesh.F, surface.F):
        # Which way long edges go is what they began with.
        turns = began.angles / TWO_PI + wrapped(turns - began.angles / TWO_PI)
        forms = began.forms
    flat = FlatSurface(surface, np.ascontiguousarray(forms), np.ascontiguousarray(turns))
    assert flat.chart is not None
    return flat


def _carried(
    points: NDArray[np.float64], there: VolumeMap, back: VolumeMap, gauge: Gauge
) -> NDArray[np.float64]:
    """Images (n, 3) of points inside the source, NaN where there is none."""
    u, v, far = there.torus.coordinates(PointMap(there, _OUTSIDE).forward(points).points)
    rho = np.minimum(far / there.torus.r, 1.0)
    turns = np.stack([u, v + rho * np.sin(v) / there.torus.ratio], axis=1) / TWO_PI
    turns = turns @ gauge.matrix.T + np.array(gauge.shift)
    u, s = TWO_PI * (turns - np.round(turns)).T
    v = _angles(s, rho / back.torus.ratio)
    if not np.isfinite(u).all():
        return np.full_like(points, np.nan)
    image = back.torus.xi(u, v, s=rho * back.torus.r)
    return PointMap(back, _OUTSIDE).inverse(image).points


def _angles(s: NDArray[np.float64], bend: NDArray[np.float64]) -> NDArray[np.float64]:
    """v with ``v + bend sin v = s``, for s in [-pi, pi] and bend below 1."""
    low, high = np.full_like(s, -np.pi), np.full_like(s, np.pi)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = middle + bend * np.sin(middle) < s
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)
