"""The certified route: from one start after the other, until a map is proven."""

from __future__ import annotations

import dataclasses
import logging
import time

from ..base.progress import Progress
from ..mesh.meshes import TetMesh
from .budget import Budget
from .engine import solve
from .options import VolumeOptions
from .ranked_starts import Start, ranked_starts
from .result import VolumeMap, volume_result

__all__ = ["certified_map"]

_log = logging.getLogger("stretchmap")

_WORTH_A_START = 0.1  # share of the time; with less left no further one is made


def certified_map(
    solid: TetMesh,
    options: VolumeOptions,
    start: Start | None,
    *,
    glide: bool,
    progress: Progress | None,
) -> VolumeMap:
    """The map from the first start that leads to a certified one, or the best there is.

    Parameters
    ----------
    solid : TetMesh
    options : VolumeOptions
    start : Start or None
        The only one, or None: those of `ranked_starts`.
    glide : bool
        Whether the boundary moves on the torus.
    progress : Progress or None
    """
    budget = Budget.of(options, solid.n_tets)
    starts = iter([start] if start is not None else [])
    if start is None:
        starts = ranked_starts(solid, options, budget, glide=glide, progress=progress)
    best, clock, vain = None, time.perf_counter(), 0.0
    for begin in starts:
        outcome = solve(
            begin.problem,
            options,
            glide=glide,
            budget=budget,
            patience=begin.patience,
            progress=progress,
        )
        seconds = {**outcome.seconds, "start": begin.seconds + outcome.seconds["start"]}
        outcome = dataclasses.replace(outcome, seconds=seconds)
        vain += begin.others
        found = volume_result(outcome, "certified", "glide" if glide else "frozen", begin.map)
        if best is None or _better(found, best):
            best = found
        if best.certificate.certified or budget.left < _WORTH_A_START * budget.seconds:
            break
        if not best.certificate.checks.get("source_embedded", True):
            break  # no start mends the source
        vain = time.perf_counter() - clock
        _log.info("not certified (%s): once more from another start", best.certificate.reason)
    assert best is not None
    if not vain:
        return best
    return dataclasses.replace(best, seconds={**best.seconds, "other starts": vain})


def _better(one: VolumeMap, other: VolumeMap) -> bool:
    """Certified, or else with fewer flipped tets."""

    def rank(result: VolumeMap) -> tuple[bool, int]:
        return result.certificate.certified, -int(result.distortion.flips or 0)

    return rank(one) > rank(other)
