"""Maps of the boundary that the certified route starts from, one after the other."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

from ..area.map import area_map, finished
from ..area.result import AreaMap
from ..base.progress import Progress
from ..mesh.meshes import TetMesh, TriMesh
from .anisotropy import unstretching
from .options import VolumeOptions

__all__ = ["boundary_starts"]

_STEPS, _TOL = 100, 0.05


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
    first = area_map(
        surface, ratio=options.ratio or "search", phase=options.phase, finish="none",
        keep_best=True, progress=progress,
    )  # fmt: skip

    def steps(number: int) -> AreaMap:
        return finished(first, max_iter=number, tol=_TOL, progress=progress)

    def of_the_solid(found: AreaMap) -> AreaMap:
        if unstretch is None:
            return found
        reason = f"{found.stop_reason}, a stretch of the surface undone"
        return dataclasses.replace(found, mesh=solid.surface, converged=False, stop_reason=reason)

    def fatter() -> Iterator[AreaMap]:
        # The torus whose areas fit best can be too thin for what is inside; one halfway, on the
        # scale of log(R / r), to where its hole closes has cured that wherever it was met.
        if options.ratio is not None:
            return
        found = area_map(
            surface, ratio=math.sqrt(first.ratio), phase=options.phase, finish="none",
            keep_best=True, progress=progress,
        )  # fmt: skip
        if not found.certificate.certified:
            found = finished(found, max_iter=0, tol=_TOL, progress=progress)
        yield of_the_solid(found)

    if not glide:
        yield steps(_STEPS)
        yield steps(0)
        return
    # Faces that look inward cost the interior more steps than unfolding them beforehand; but where
    # that gets stuck, it leaves needles that no gliding opens again.
    unfolded = first if first.certificate.certified else steps(0)
    begin = first if unfolded.history[-1].flips else unfolded
    yield of_the_solid(begin)
    yield from fatter()
    if unfolded is not begin:
        yield of_the_solid(unfolded)
    yield of_the_solid(steps(_STEPS))
    if first is not begin:
        yield of_the_solid(first)
