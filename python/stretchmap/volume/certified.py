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
from ..errors import OrientationError, SolverError
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
# Tets stuck at most, or share of all, and share of the time left, where a start that made room is
# gone on with before another follows: nearly there, it may take much of the time yet. So it is
# where what is left would not do for another one.
_NEARLY, _NEARLY_SHARE, _LATE = 30, 2e-3, 0.2
_QUICKER = 0.3  # times as long as one that leaves tets stuck, one that serves takes at least
# Mean abs(ratio - 1) from which on another torus is tried, so many times thinner, if so many times
# the time the last start took is left: where areas of the boundary fit best, what few edges round a
# handle or a limb leave room for can be far less than what belongs there.
_POOR, _THINNER, _SPARE = 0.1, 2.0, 0.8
_UNFINISHED = 2.0  # times as much counts the energy of a map with held vertices, or cut short


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
    which tets stay stuck makes room for the next one. The best is gone on with if none serves, or
    if no time is left for another: less than one that serves takes at least or, where few tets are
    stuck, than the last one took. A map that keeps volumes badly is made again on thinner and
    thinner tori, while that helps and time lasts.

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
    best, least, best_took = None, (True, 0, math.inf, True), 0.0
    vain, clock, failed = 0.0, time.perf_counter(), None
    left_off = None  # the best one, where it made room
    before, latest = budget.left, 0.0  # processor seconds the last start took, but for comparing it

    def nearly() -> bool:
        return 0 < least[1] <= max(_NEARLY, _NEARLY_SHARE * solid.n_tets)

    def in_turn() -> Iterator[Start]:
        nonlocal left_off
        for another in itertools.chain(starts, [None]):
            if another is not None:
                only = budget.left < latest  # hardly another one follows
                yield dataclasses.replace(another, patience=1.0) if only else another
            while best is not None and _done(least):
                thinner = _thinner(solid, options, best, budget, progress)
                if thinner is None:
                    return
                yield thinner
            late = max(_LATE * budget.seconds, latest) if nearly() else _QUICKER * latest
            if left_off is not None and (another is None or budget.left < late):
                begin, left_off = left_off, None
                yield begin

    for begin in in_turn():
        try:
            outcome = solve(
                begin.problem,
                options,
                glide=glide,
                budget=budget,
                patience=begin.patience,
                hasty=begin.hasty,
                afar=left_off is None or not nearly(),
                resumed=begin.resumed,
                progress=progress,
            )
        except SolverError as error:
            _log.info("a start has broken down: %s", error)
            failed, before = failed or error, budget.left
            clock, took = time.perf_counter(), time.perf_counter() - clock
            vain += took
            # One on a thinner torus would be the same again.
            if best is not None and (_done(least) or _is_late(budget)):
                break
            continue
        seconds = {**outcome.seconds, "start": begin.seconds + outcome.seconds["start"]}
        outcome = dataclasses.replace(outcome, seconds=seconds)
        found = volume_result(outcome, "certified", "glide" if glide else "frozen", begin.map)
        clock, took = time.perf_counter(), time.perf_counter() - clock
        vain += begin.others
        before, latest = budget.left, before - budget.left - begin.others
        rank = _rank(outcome, found)
        gained = best is None or rank < least
        if best is None or gained:
            vain += best_took
            best, least, best_took = found, rank, took
            again = dataclasses.replace(
                begin, problem=outcome.problem, patience=1.0, hasty=False, resumed=True, others=0.0
            )
            left_off = again if begin.hasty else None
        else:
            vain += took
        if _done(least):
            free = start is None and glide and options.ratio is None and outcome.converged
            poor = best.distortion.element_error_mean > _POOR
            if not (gained and free and poor and budget.left > _SPARE * latest):
                break
            _log.info("volumes are kept badly: once more on a thinner torus")
            continue
        if _is_late(budget):
            break
        if not best.certificate.checks.get("source_embedded", True):
            break  # no start mends the source
        held = f"{len(outcome.problem.held)} vertices are held"
        why = held if found.certificate.certified else f"not certified ({best.certificate.reason})"
        _log.info("%s: once more from another start", why)
    if best is None:
        assert failed is not None
        raise failed
    if not vain:
        return best
    return dataclasses.replace(best, seconds={**best.seconds, "other starts": vain})


def _is_late(budget: Budget) -> bool:
    """Whether too little time is left for another start."""
    return budget.left < _WORTH_A_START * budget.seconds


def _thinner(
    solid: TetMesh,
    options: VolumeOptions,
    found: VolumeMap,
    budget: Budget,
    progress: Progress | None,
) -> Start | None:
    """A start on a thinner torus than that of a map, if there is one; it is the last for now."""
    there = dataclasses.replace(options, ratio=_THINNER * found.torus.ratio)
    try:
        start = next(ranked_starts(solid, there, budget, glide=True, progress=progress), None)
    except (OrientationError, SolverError):  # so few faces may enclose nothing there
        return None
    return start and dataclasses.replace(start, hasty=False)


_Rank = tuple[bool, int, float, bool]


def _rank(outcome: Outcome, found: VolumeMap) -> _Rank:
    """Least of what is certified, or else has fewest flipped tets, then of the lowest energy. Last,
    whether vertices are held."""
    minimized = [record.energy for record in outcome.history if record.stage in _MINIMIZED]
    held = len(outcome.problem.held) > 0
    energy = minimized[-1] if minimized else math.inf
    return (
        not found.certificate.certified,
        found.distortion.flips or 0,
        energy if outcome.converged and not held else _UNFINISHED * energy,
        held,
    )


def _done(rank: _Rank) -> bool:
    """Whether a map is certified with nothing held, so that other starts could but keep volumes
    better."""
    return not rank[0] and not rank[-1]
