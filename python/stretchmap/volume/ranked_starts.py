"""Starts of the certified route in the order in which they are tried, chosen by measurement."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .. import _core
from ..base.progress import Progress
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh
from .boundary_starts import boundary_starts
from .budget import Budget
from .options import VolumeOptions
from .problem import VolumeProblem
from .start import START_TOL, started

__all__ = ["Start", "ranked_starts"]

# Share of tets the harmonic map turns over from which on it tells more about a start than the order
# in which they are made: of a thin shell it is a fifth from one, and a thousandth from another.
_MANY = 0.05
_COMPARED = 4
_COMPARING = 0.3  # share of the time left that may go into them, each as dear as the first


@dataclass(frozen=True, eq=False)
class Start:
    """A boundary map, or a whole one, and the problem that begins from it."""

    map: MapResult
    problem: VolumeProblem
    seconds: float = 0.0  # the harmonic map took
    others: float = 0.0  # seconds of those it was compared with

    @property
    def inverted(self) -> float:
        """Share of the tets that the harmonic map turns over."""
        volumes = _core.mesh.tet_volumes(self.problem.x, self.problem.solid.T)
        return float(np.mean(~(volumes > 0.0)))


def ranked_starts(
    solid: TetMesh,
    options: VolumeOptions,
    budget: Budget,
    *,
    glide: bool,
    progress: Progress | None,
) -> Iterator[Start]:
    """Those of `boundary_starts`; if the first turns many tets over, the best of a few comes first.

    A boundary that does not glide is kept in order: what counts there is how exact its areas are.
    """

    def begun() -> Iterator[Start]:
        for found in boundary_starts(solid, options, glide=glide, progress=progress):
            clock = time.perf_counter()
            problem = VolumeProblem.of(solid, found.image, torus=found.torus, refine=options.refine)
            problem = started(problem, solver=options.solver, tol=START_TOL)
            yield Start(found, problem, time.perf_counter() - clock)

    starts = begun()
    first = next(starts)
    if glide and first.inverted > _MANY:
        made, allowed = budget.seconds - budget.left, budget.share(_COMPARING)
        few, clock = [first], time.perf_counter()
        while len(few) < _COMPARED and allowed.left > made:
            other = next(starts, None)
            if other is None:
                break
            few.append(other)
        spent = time.perf_counter() - clock if len(few) > 1 else 0.0
        best, *rest = sorted(few, key=lambda start: start.inverted)
        yield replace(best, others=spent)
        yield from rest
    else:
        yield first
    yield from starts
