"""The start with the fewest inverted tets comes first where the usual one turns many over."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.errors import SolverError
from stretchmap.volume import boundary_starts as boundary_starts_module
from stretchmap.volume import ranked_starts as module
from stretchmap.volume.boundary_starts import boundary_starts
from stretchmap.volume.budget import Budget
from stretchmap.volume.options import VolumeOptions

SOLID = sm.samples.bumpy_torus(2000)


@pytest.fixture(scope="module")
def plain() -> sm.AreaMap:
    return next(boundary_starts(SOLID, VolumeOptions(), glide=True, progress=None))


def twisted(plain: sm.AreaMap, by: float) -> sm.AreaMap:
    """Longitudes to and fro round the tube: a homeomorphism of the torus that the inside hates."""
    u, v = plain.angles.T
    return dataclasses.replace(plain, image=plain.torus.xi(u + by * np.sin(v), v))


def ranked(
    monkeypatch, maps: list[sm.AreaMap], *, glide: bool = True, seconds: float = 600.0
) -> tuple[list, list]:
    """Maps in the order tried, and how many had been made when the first was."""
    made, known, order = [], [], []

    def starts(*_, **__):
        for found in maps:
            made.append(found)
            yield found

    monkeypatch.setattr(module, "boundary_starts", starts)
    budget = Budget(seconds)
    for start in module.ranked_starts(SOLID, VolumeOptions(), budget, glide=glide, progress=None):
        known.append(len(made))
        order.append(start.map)
    return order, known


def test_the_first_is_taken_at_once_if_it_turns_few_tets_over(monkeypatch, plain):
    maps = [plain, twisted(plain, 3.0)]
    order, known = ranked(monkeypatch, maps)
    assert order == maps and known == [1, 2]


def test_one_that_turns_many_over_waits_for_better_ones(monkeypatch, plain):
    bad, worse, last = twisted(plain, 2.0), twisted(plain, 4.0), twisted(plain, 0.1)
    order, known = ranked(monkeypatch, [bad, worse, plain, bad, last])
    assert [id(found) for found in order] == [id(k) for k in (plain, bad, bad, worse, last)]
    assert known[0] == 4  # the last is made only when all others have led nowhere


def test_comparing_ends_with_the_starts_and_with_its_share_of_the_time(monkeypatch, plain):
    maps = [twisted(plain, 3.0), plain]
    assert ranked(monkeypatch, maps)[0] == maps[::-1]
    assert ranked(monkeypatch, maps, seconds=0.0)[0] == maps


def test_exact_areas_come_first_where_the_boundary_is_held(monkeypatch, plain):
    maps = [twisted(plain, 3.0), plain]
    assert ranked(monkeypatch, maps, glide=False)[0] == maps


def test_the_better_start_is_what_the_map_begins_with(monkeypatch, plain):
    maps = [twisted(plain, 4.0), plain]
    monkeypatch.setattr(module, "boundary_starts", lambda *_, **__: iter(maps))
    found = sm.volume_map(SOLID)
    assert found.certificate.certified and found.seconds["other starts"] > 0.0
    assert found.boundary_map is plain


def test_a_start_that_cannot_be_made_is_passed_over(monkeypatch):
    def fails(*_):
        raise SolverError("faces are flipped in the chart", ())

    maps = boundary_starts_module._BoundaryMaps
    for name in ("unfolded", "fatter"):
        monkeypatch.setattr(maps, name, fails)
    assert next(boundary_starts(SOLID, VolumeOptions(), glide=True, progress=None)).certificate
    for name in ("gentle", "folded", "after"):
        monkeypatch.setattr(maps, name, fails)
    with pytest.raises(SolverError, match="flipped in the chart"):
        next(boundary_starts(SOLID, VolumeOptions(), glide=True, progress=None))


def test_shapes_weigh_less_where_they_would_lose_a_limb(monkeypatch, plain):
    def chart(least):
        def made(_, ratio, shape=0.0):
            kept = SimpleNamespace(ratios=np.array([1.0, least]))
            certified = SimpleNamespace(certified=shape != 10.0)
            return SimpleNamespace(ratio=ratio, shape=shape, certificate=certified, distortion=kept)

        return made

    maps = boundary_starts_module._BoundaryMaps(SOLID.surface, VolumeOptions(), None)
    monkeypatch.setattr(boundary_starts_module, "finished", lambda found, **_: (found.shape,))
    monkeypatch.setattr(type(maps), "_chart", chart(1e-3))
    assert maps.gentle(2.0).shape == 100.0
    monkeypatch.setattr(type(maps), "_chart", chart(1e-20))
    assert maps.gentle(2.0) == (10.0,)
