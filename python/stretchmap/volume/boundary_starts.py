"""Maps of the boundary that the certified route starts from, one after the other."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

from ..area.finish import Steps
from ..area.map import SHAPES, along, finished
from ..area.result import AreaMap
from ..area.route import Route
from ..area.search import Ratio
from ..base.progress import Progress
from ..conformal.map import conformal_map
from ..mesh.meshes import TetMesh, TriMesh
from .anisotropy import unstretching
from .options import VolumeOptions

__all__ = ["boundary_starts"]

_STEPS, _TOL = 100, 0.05
_SEM_STEPS = 10
_GENTLE = SHAPES[2:]  # lighter ones leave folds, which opened become needles


def boundary_starts(
    solid: TetMesh, options: VolumeOptions, *, glide: bool, progress: Progress | None
) -> Iterator[AreaMap]:
    """Each is for the case that those before it lead nowhere, and made only then.

    A gliding boundary loses exact areas again; a held one is only as good as they are. Their last
    per cent costs triangles their shape, which the interior has to pay for.

    Parameters
    ----------
    solid : TetMesh
    options : VolumeOptions
        ``ratio`` and ``phase`` count.
    glide : bool
        Whether the boundary will move. Then a stretch common to all tets is undone first, and the
        maps say so: they do not preserve the areas of the surface as it is.
    progress : Progress or None

    Yields
    ------
    AreaMap
        Of ``solid.surface``, certified or not.
    """
    surface = solid.surface
    unstretch = unstretching(solid.V, solid.T) if glide else None
    if unstretch is not None:
        surface = TriMesh(surface.V @ unstretch, surface.F)
    conformal = conformal_map(surface, progress=progress)

    def chart(ratio: Ratio | float, shape: float = 0.0) -> AreaMap:
        route = Route(options.phase, ratio, _SEM_STEPS, "none", Steps(0, _TOL, math.inf), shape)
        return along(route, surface, conformal, progress)

    ratio: Ratio | float = options.ratio or "search"
    first = chart(ratio)

    def steps(number: int) -> AreaMap:
        return finished(first, max_iter=number, tol=_TOL, progress=progress)

    def of_the_solid(found: AreaMap) -> AreaMap:
        if unstretch is None:
            return found
        reason = f"{found.stop_reason}, a stretch of the surface undone"
        return dataclasses.replace(found, mesh=solid.surface, converged=False, stop_reason=reason)

    def gentle(ratio: Ratio | float) -> Iterator[AreaMap]:
        # A long branch with few edges round it is folded wherever it has its area, and of a thin
        # shell both sides end up far from each other.
        maps = (chart(ratio, shape) for shape in _GENTLE)
        found = next((found for found in maps if found.certificate.certified), None)
        if found is not None:
            yield of_the_solid(found)

    def fatter() -> Iterator[AreaMap]:
        # The torus whose areas fit best can be too thin for what is inside; one halfway, on the
        # scale of log(R / r), to where its hole closes has cured that wherever it was met.
        if options.ratio is not None:
            return
        ratio = math.sqrt(first.ratio)
        found = chart(ratio)
        if not found.certificate.certified:
            found = finished(found, max_iter=0, tol=_TOL, progress=progress)
        yield of_the_solid(found)
        yield from gentle(ratio)

    if not glide:
        yield steps(_STEPS)
        yield steps(0)
        for found in gentle(ratio):
            yield finished(found, max_iter=_STEPS, tol=_TOL, progress=progress)
        return
    # Faces that look inward cost the interior more steps than unfolding them beforehand; but where
    # that gets stuck, it leaves needles that no gliding opens again.
    unfolded = first if first.certificate.certified else steps(0)
    stuck = unfolded.history[-1].flips > 0
    if not stuck:
        yield of_the_solid(unfolded)
    yield from fatter()
    yield from gentle(ratio)
    if first is not unfolded:
        yield of_the_solid(first)
    yield of_the_solid(steps(_STEPS))
