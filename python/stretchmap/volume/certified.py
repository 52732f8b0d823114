"""The certified route: from one start after the other, until a map is proven and all of it free."""

from __future__ import annotations

import dataclasses
import itertools
import logging
import math
import time
from collections.abc import Iterator

from ..base.budget import Budget
from ..base.progress import Progress
from ..mesh.meshes import TetMesh
from .engine import solve
from .options import VolumeOptions
from .problem import Outcome
from .ranked_starts import Start, ranked_starts
from .result import VolumeMap, volume_result

__all__ = ["certified_map"]

_log = logging.getLogger("stretchmap")

_MINIMIZED = ("frozen", "glide")  # stages whose energies are comparable
_WORTH_A_START = 0.1  # share of the time; with less left no further one is made
# Tets stuck at most, and share of the time left, where a start that made room is gone on with
# before another follows: nearly there, it may take much of the time yet.
_NEARLY, _LATE = 30, 0.35


def certified_map(
    solid: TetMesh,
    options: VolumeOptions,
    start: Start | None,
    *,
    glide: bool,
    progress: Progress | None,
) -> VolumeMap:
    """The map from the first start that leads to a certified one, or the best there is.

    Where folded faces had to be held for that, the others are tried in the time left. A start in
    which tets stay stuck makes room for the next one; if none serves, or no more time is left than
    the last one took, or two thirds are spent and few are stuck, the best is gone on with.

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
    budget = Budget.of(options.time_limit, solid.n_tets)
    starts = iter([start] if start is not None else [])
    if start is None:
        starts = ranked_starts(solid, options, budget, glide=glide, progress=progress)
    best, least, best_took, best_held = None, (True, 0, True, math.inf), 0.0, False
    vain, clock = 0.0, time.perf_counter()
    left_off = None  # the best one, where it made room
    before, latest = budget.left, 0.0  # processor seconds the last start took, but for comparing it

    def in_turn() -> Iterator[Start]:
        nonlocal left_off
        for another in itertools.chain(starts, [None]):
            if another is not None:
                yield another
            nearly = 0 < least[1] <= _NEARLY and budget.left < _LATE * budget.seconds
            late = nearly or budget.left < latest
            if left_off is not None and (another is None or late):
                begin, left_off = left_off, None
                yield begin

    for begin in in_turn():
        outcome = solve(
            begin.problem,
            options,
            glide=glide,
            budget=budget,
            patience=begin.patience,
            hasty=begin.hasty,
            resumed=begin.resumed,
            progress=progress,
        )
        seconds = {**outcome.seconds, "start": begin.seconds + outcome.seconds["start"]}
        outcome = dataclasses.replace(outcome, seconds=seconds)
        found = volume_result(outcome, "certified", "glide" if glide else "frozen", begin.map)
        clock, took = time.perf_counter(), time.perf_counter() - clock
        vain += begin.others
        before, latest = budget.left, before - budget.left - begin.others
        rank = _rank(outcome, found)
        if best is None or rank < least:
            vain += best_took
            best, least, best_took = found, rank, took
            best_held = len(outcome.problem.held) > 0
            again = dataclasses.replace(
                begin, problem=outcome.problem, patience=1.0, hasty=False, resumed=True, others=0.0
            )
            left_off = again if begin.hasty else None
        else:
            vain += took
        if best.certificate.certified and not best_held:
            break
        if budget.left < _WORTH_A_START * budget.seconds:
            break
        if not best.certificate.checks.get("source_embedded", True):
            break  # no start mends the source
        held = f"{len(outcome.problem.held)} vertices are held"
        why = held if found.certificate.certified else f"not certified ({best.certificate.reason})"
        _log.info("%s: once more from another start", why)
    assert best is not None
    if not vain:
        return best
    return dataclasses.replace(best, seconds={**best.seconds, "other starts": vain})


def _rank(outcome: Outcome, found: VolumeMap) -> tuple[bool, int, bool, float]:
    """Least of what is certified, or else has fewest flipped tets; then of what has converged, with
    nothing held, and last of the lowest energy."""
    minimized = [record.energy for record in outcome.history if record.stage in _MINIMIZED]
    return (
        not found.certificate.certified,
        found.distortion.flips or 0,
        not outcome.converged or len(outcome.problem.held) > 0,
        minimized[-1] if minimized else math.inf,
    )
