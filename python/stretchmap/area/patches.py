"""The last few faces that look inward, turned with all but their neighborhood held."""

from __future__ import annotations

import math
from dataclasses import replace

from .. import _core
from ..base.progress import Progress
from ..maps.history import IterationRecord
from .finish import Pace, unfold_faces
from .work import Work

_RINGS = 2, 4, 8, 16  # of faces round those that look inward, wider where fewer do not serve
_MOST = 60  # steps in patches of one width
_WHOLE = 0.4  # share of the vertices from which on steps on the whole surface cost little more


def turn_in_patches(
    newton: _core.area.SurfaceNewton,
    progress: Progress | None,
    pace: Pace,
    work: Work,
) -> list[IterationRecord]:
    """Newton steps on the patches round faces that look inward, until none does; records.

    Where areas are nearly right such faces are few and far between. A step on the whole surface
    costs as much as hundreds on the patches, and disturbs all areas.
    """
    history: list[IterationRecord] = []
    for rings in _RINGS:
        if not (inward := newton.inward()):
            break
        patch = _core.area.SurfacePatch(newton, inward, rings)
        angles = newton.angles
        if len(patch.vertices) > _WHOLE * len(angles):
            break
        part = _core.area.SurfaceNewton(patch.problem, angles[patch.vertices], patch.held)
        records = unfold_faces(part, _MOST, progress, pace, work.late)
        # Areas are compared within the patch there.
        history += [replace(r, ring_std=math.nan, element_std=math.nan) for r in records]
        work.spend(part.solves, patch.n_faces)
        angles[patch.vertices] = part.angles
        newton.angles = angles
    return history
