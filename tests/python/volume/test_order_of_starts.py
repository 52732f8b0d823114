"""In which order starts are tried, and when one that made room is gone on with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from stretchmap.errors import OrientationError, SolverError
from stretchmap.volume import certified
from stretchmap.volume.options import VolumeOptions
from stretchmap.volume.problem import Outcome
from stretchmap.volume.ranked_starts import Start


@dataclass
class Found:
    """What is read of a map: how many tets are inverted."""

    flips: int
    seconds: dict[str, float] = field(default_factory=dict)
    mean: float = 0.0  # of the tets' errors
    torus: Any = None

    @property
    def distortion(self) -> Any:
        return SimpleNamespace(flips=self.flips, element_error_mean=self.mean)

    @property
    def certificate(self) -> Any:
        return SimpleNamespace(certified=self.flips == 0, reason="", checks={})


def order(
    monkeypatch: Any,
    stuck: dict[str, int],
    left: list[float],
    kept: int = 0,
    n_tets: int = 1000,
    note: Callable[[dict[str, Any]], object] = id,
) -> list[str]:
    """Names of the starts as they are solved, in capitals where none is to make room.

    ``stuck`` says how many tets each leaves inverted in haste, -1 if it breaks down, ``kept`` how
    many if gone on with, ``left`` what share of the time is left after each. ``note`` is told what
    else they are given.
    """
    solved: list[str] = []
    budget = SimpleNamespace(seconds=1.0, left=1.0)

    def starts(*_: Any, **__: Any) -> Any:
        for name in stuck:
            problem = SimpleNamespace(name=name, held=())
            yield Start(SimpleNamespace(), problem, hasty=True)

    def solve(problem: Any, *_: Any, hasty: bool, **given: Any) -> Outcome:
        note(given)
        solved.append(problem.name if hasty else problem.name.upper())
        budget.left = left[len(solved) - 1]
        flips = stuck[problem.name] if hasty else kept
        if flips < 0:
            raise SolverError("the energy is infinite")
        return Outcome(problem, (), True, str(flips), {"start": 0.0})

    monkeypatch.setattr(certified.Budget, "of", lambda *_: budget)
    monkeypatch.setattr(certified, "ranked_starts", starts)
    monkeypatch.setattr(certified, "solve", solve)
    monkeypatch.setattr(certified, "volume_result", lambda o, *_: Found(int(o.stop_reason)))
    solid = SimpleNamespace(n_tets=n_tets)
    found = certified.certified_map(solid, VolumeOptions(), None, glide=True, progress=None)
    assert (found.distortion.flips == 0) == (solved[-1].isupper() and kept == 0)
    return solved


@pytest.mark.parametrize(
    ("stuck", "left", "kept", "expected"),
    [
        # Nobody serves: the best is gone on with.
        ({"a": 40, "b": 3, "c": 9}, [0.9, 0.8, 0.7, 0.6], 0, "abcB"),
        # Nearly there, and late: before another start.
        ({"a": 4, "b": 9, "c": 2}, [0.7, 0.19, 0.1], 0, "abA"),
        # Late, but far from it: others first.
        ({"a": 400, "b": 900, "c": 31}, [0.6, 0.19, 0.15, 0.12], 0, "abcC"),
        # Less time than one that serves may take, where others took so long: the best so far.
        ({"a": 400, "b": 900, "c": 31}, [0.9, 0.2, 0.15], 0, "abA"),
        # Gone on with in vain, once only: then the others.
        ({"a": 4, "b": 9, "c": 6}, [0.19, 0.18, 0.17, 0.15], 4, "aAbc"),
        # Nearly there, with less time left than another would take as long for.
        ({"a": 4, "b": 9}, [0.45, 0.1], 0, "aA"),
        ({"a": 31, "b": 39}, [0.45, 0.09], 0, "ab"),
        # No time for any other.
        ({"a": 4, "b": 9}, [0.05], 0, "a"),
        # One that breaks down is one less, whether or not others led anywhere before.
        ({"a": 40, "b": -1, "c": 9}, [0.9, 0.8, 0.7, 0.6], 0, "abcC"),
        ({"a": -1, "b": 40, "c": -1}, [0.9, 0.8, 0.7, 0.6], 0, "abcB"),
        ({"a": 4, "b": 9, "c": 6}, [0.19, 0.18, 0.17, 0.15], -1, "aAbc"),
        # So late that no other follows.
        ({"a": 40, "b": -1, "c": 9}, [0.9, 0.05], 0, "ab"),
    ],
)
def test_a_start_that_made_room_is_gone_on_with(monkeypatch, stuck, left, kept, expected) -> None:
    assert "".join(order(monkeypatch, stuck, left, kept)) == expected


@pytest.mark.parametrize(("n_tets", "expected"), [(29_000, "ab"), (31_000, "aA")])
def test_of_many_tets_more_are_few(monkeypatch, n_tets, expected) -> None:
    found = order(monkeypatch, {"a": 60, "b": 90}, [0.45, 0.05], 0, n_tets)
    assert "".join(found) == expected


@pytest.mark.parametrize(
    ("stuck", "expected"),
    [
        ({"a": 400, "b": 900, "c": 90}, [True, True, True]),
        # Gone on with, a serves sooner than what far too many are stuck in.
        ({"a": 4, "b": 900, "c": 90}, [True, False, False]),
        ({"a": 400, "b": 4, "c": 90}, [True, True, False]),
    ],
)
def test_hopeless_starts_are_worth_no_time_where_few_tets_are_stuck_in_another(
    monkeypatch, stuck, expected
) -> None:
    afar: list[bool] = []
    order(monkeypatch, stuck, [0.9, 0.8, 0.7, 0.6], note=lambda given: afar.append(given["afar"]))
    assert afar == [*expected, True]  # what is gone on with is the last


@pytest.mark.parametrize(("left", "expected"), [(1.0, 0.5), (0.55, 1.0)])
def test_one_after_which_hardly_another_follows_may_take_all_the_time(monkeypatch, left, expected):
    patience: list[float] = []
    budget = SimpleNamespace(seconds=1.0, left=left)

    def starts(*_: Any, **__: Any) -> Any:
        for _ in range(2):
            yield Start(SimpleNamespace(), SimpleNamespace(held=()), patience=0.5, hasty=True)

    def solve(problem: Any, *_: Any, **options: Any) -> Outcome:
        patience.append(options["patience"])
        budget.left -= 0.3
        return Outcome(problem, (), True, "40", {"start": 0.0})

    monkeypatch.setattr(certified.Budget, "of", lambda *_: budget)
    monkeypatch.setattr(certified, "ranked_starts", starts)
    monkeypatch.setattr(certified, "solve", solve)
    monkeypatch.setattr(certified, "volume_result", lambda o, *_: Found(int(o.stop_reason)))
    solid = SimpleNamespace(n_tets=1000)
    certified.certified_map(solid, VolumeOptions(), None, glide=True, progress=None)
    assert patience[:2] == [0.5, expected]


@pytest.mark.parametrize(
    ("outcomes", "best"),
    [
        # Held vertices and steps cut short are both unfinished: energy tells.
        ([(2, False, 0.01), (0, False, 0.08)], 0),
        ([(2, False, 0.08), (0, False, 0.01)], 1),
        # At rest without any: better than a little less energy with some, or when cut short.
        ([(2, False, 0.012), (0, True, 0.02)], 1),
        ([(2, True, 0.012), (0, True, 0.02)], 1),
        ([(2, True, 0.012), (0, False, 0.013), (0, True, 0.02)], 2),
        ([(2, False, 0.009), (0, True, 0.02)], 0),
    ],
)
def test_of_unfinished_maps_that_of_the_lowest_energy_is_best(monkeypatch, outcomes, best) -> None:
    def starts(*_: Any, **__: Any) -> Any:
        for held, converged, energy in outcomes:
            problem = SimpleNamespace(held=range(held), converged=converged, energy=energy)
            yield Start(SimpleNamespace(), problem, hasty=True)

    def solve(problem: Any, *_: Any, **__: Any) -> Outcome:
        record = SimpleNamespace(stage="glide", energy=problem.energy)
        return Outcome(problem, (record,), problem.converged, str(problem.energy), {"start": 0.0})

    monkeypatch.setattr(certified, "ranked_starts", starts)
    monkeypatch.setattr(certified, "solve", solve)
    energies = [energy for _, _, energy in outcomes]
    monkeypatch.setattr(
        certified,
        "volume_result",
        lambda o, *_: Found(0, {"which": energies.index(float(o.stop_reason))}),
    )
    solid = SimpleNamespace(n_tets=1000)
    found = certified.certified_map(solid, VolumeOptions(), None, glide=True, progress=None)
    assert found.seconds["which"] == best


@pytest.mark.parametrize(
    ("means", "left", "tried", "best"),
    [
        ((0.05,), 0.9, (), 0),
        ((0.3, 0.2, 0.05), 0.9, (4.0, 8.0), 2),  # until volumes are kept well enough,
        ((0.3, 0.2, 0.25), 0.9, (4.0, 8.0), 1),  # or a thinner torus keeps them less,
        ((0.3, 0.2), 0.3, (), 0),  # or time is short
    ],
)
def test_where_volumes_are_kept_badly_thinner_tori_are_tried(
    monkeypatch, means, left, tried, best
) -> None:
    budget, ratios = SimpleNamespace(seconds=1.0, left=1.0), []
    queue = iter(means)

    def starts(_: Any, options: VolumeOptions, *__: Any, **___: Any) -> Any:
        ratios.append(options.ratio)
        yield Start(SimpleNamespace(), SimpleNamespace(held=(), ratio=options.ratio or 2.0))

    def solve(problem: Any, *_: Any, **__: Any) -> Outcome:
        budget.left *= left
        mean = next(queue)
        record = SimpleNamespace(stage="glide", energy=mean**2)
        return Outcome(problem, (record,), True, str(mean), {"start": 0.0})

    def result(outcome: Any, *_: Any) -> Found:
        torus = SimpleNamespace(ratio=outcome.problem.ratio)
        return Found(0, {}, float(outcome.stop_reason), torus)

    monkeypatch.setattr(certified.Budget, "of", lambda *_: budget)
    monkeypatch.setattr(certified, "ranked_starts", starts)
    monkeypatch.setattr(certified, "solve", solve)
    monkeypatch.setattr(certified, "volume_result", result)
    solid = SimpleNamespace(n_tets=1000)
    found = certified.certified_map(solid, VolumeOptions(), None, glide=True, progress=None)
    assert found.mean == means[best] and tuple(ratios[1:]) == tried
    ratios.clear()
    queue = iter(means)
    budget.left = 1.0
    certified.certified_map(solid, VolumeOptions(ratio=2.0), None, glide=True, progress=None)
    assert ratios == [2.0]


def test_a_map_is_kept_where_so_few_faces_enclose_nothing_on_a_thinner_torus(monkeypatch) -> None:
    def starts(_: Any, options: VolumeOptions, *__: Any, **___: Any) -> Any:
        if options.ratio:
            raise OrientationError("the boundary image encloses no volume")
        yield Start(SimpleNamespace(), SimpleNamespace(held=()))

    record = SimpleNamespace(stage="glide", energy=0.1)
    found = Found(0, {}, 0.3, SimpleNamespace(ratio=2.0))
    monkeypatch.setattr(certified, "ranked_starts", starts)
    monkeypatch.setattr(
        certified,
        "solve",
        lambda problem, *_, **__: Outcome(problem, (record,), True, "", {"start": 0.0}),
    )
    monkeypatch.setattr(certified, "volume_result", lambda *_: found)
    solid = SimpleNamespace(n_tets=1000)
    kept = certified.certified_map(solid, VolumeOptions(), None, glide=True, progress=None)
    assert kept.mean == found.mean
