"""The start with the fewest inverted tets comes first where the usual one turns many over."""

from __future__ import annotations

import dataclasses
import time
from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from shapes import mug
from stretchmap import _core
from stretchmap.area import balance, route
from stretchmap.area.balance import balance_areas
from stretchmap.base.budget import Budget
from stretchmap.errors import CertificationError, SolverError
from stretchmap.samples.solids import cut_cells
from stretchmap.volume import boundary_starts as boundary_starts_module
from stretchmap.volume import certified
from stretchmap.volume import ranked_starts as module
from stretchmap.volume.boundary_starts import boundary_starts
from stretchmap.volume.options import VolumeOptions
from stretchmap.volume.problem import Outcome

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
    bad, worse, worst = (twisted(plain, by) for by in (2.0, 3.0, 4.0))
    order, known = ranked(monkeypatch, [worse, worst, bad, worse, plain])
    assert [id(found) for found in order] == [id(k) for k in (bad, worse, worse, worst, plain)]
    assert known[0] == 4  # the last is made only when all others have led nowhere


def test_one_that_turns_few_over_is_not_compared_further(monkeypatch, plain):
    bad, worse = twisted(plain, 2.0), twisted(plain, 4.0)
    order, known = ranked(monkeypatch, [bad, worse, plain, bad])
    assert [id(found) for found in order] == [id(k) for k in (plain, bad, bad, worse)]
    assert known[0] == 3


def test_one_that_turns_a_tenth_as_many_over_is_not_compared_further(monkeypatch, plain):
    shares = {}
    monkeypatch.setattr(module.Start, "inverted", property(lambda self: shares[id(self.map)]))
    maps = [dataclasses.replace(plain) for _ in range(5)]
    shares.update(zip(map(id, maps), (0.5, 0.04, 0.03, 0.0, 0.0), strict=True))
    order, known = ranked(monkeypatch, maps)
    assert [id(found) for found in order] == [id(maps[k]) for k in (1, 2, 3, 0, 4)]
    assert known[:4] == [2, 3, 4, 4]  # the first, beaten by far, comes after what was not compared
    shares[id(maps[1])] = 0.06
    order, known = ranked(monkeypatch, maps)
    assert [id(found) for found in order] == [id(maps[k]) for k in (2, 1, 3, 0, 4)]
    assert known[0] == 3


def test_comparing_ends_with_the_starts_and_with_its_share_of_the_time(monkeypatch, plain):
    maps = [twisted(plain, 3.0), plain]
    assert ranked(monkeypatch, maps)[0] == maps[::-1]
    assert ranked(monkeypatch, maps, seconds=0.0)[0] == maps


def test_one_that_takes_most_of_the_time_left_is_given_up_for_the_next(monkeypatch, plain):
    def endless(maps):
        while True:
            maps.progress("area", 0, 0)

    def gliding(maps):
        yield lambda: plain
        yield lambda: endless(maps)
        yield lambda: endless(maps)  # no time of its own
        yield lambda: twisted(plain, 3.0)
        yield lambda: endless(maps)

    monkeypatch.setattr(boundary_starts_module._BoundaryMaps, "gliding", gliding)
    budget = Budget(0.4)
    found = list(boundary_starts(SOLID, VolumeOptions(), glide=True, budget=budget, progress=None))
    assert len(found) == 2 and found[0] is plain
    # A like share went into the first, and of the rest into the last.
    assert budget.left <= 0.12


def test_kept_shapes_are_made_from_equal_areas_and_end_where_they_do_without():
    maps = boundary_starts_module._BoundaryMaps(mug(9, 1, 9).surface, VolumeOptions(), None)
    areas, _ = maps.equal.balanced(0.0)
    _, all_steps = balance_areas(maps.equal.level, 100.0, None)
    found = maps._chart(2.0, 100.0)
    _, steps = maps.equal.balanced(100.0)
    begun = dataclasses.replace(maps.equal.level, turns=areas)
    first = balance_areas(begun, 100.0, None, most=1)[1][0]
    assert steps[0].energy == first.energy and found.history[-1] == steps[-1]
    assert steps[-1].energy == pytest.approx(all_steps[-1].energy, rel=0.01)


def test_kept_shapes_end_where_weights_and_areas_go_round_in_circles(monkeypatch):
    maps = boundary_starts_module._BoundaryMaps(mug(11, 1, 11).surface, VolumeOptions(), None)
    _, short = balance_areas(maps.equal.level, 10.0, None)
    monkeypatch.setattr(balance, "_CIRCLING", 1000)
    _, long = balance_areas(maps.equal.level, 10.0, None)
    assert len(short) < 20 and len(long) > 3 * len(short)
    assert short[-1].element_std == pytest.approx(long[-1].element_std, rel=0.03)


def test_where_there_is_no_time_for_any_the_first_comes_as_it_is():
    limits = [{"budget": Budget(0.0)}, {}]
    first, made = (
        next(boundary_starts(mug(7, 1, 6), VolumeOptions(), glide=True, progress=None, **limit))
        for limit in limits
    )
    assert not first.certificate.certified and made.certificate.certified


def test_one_that_is_as_dear_as_all_there_is_is_not_waited_for(monkeypatch, plain):
    bad = twisted(plain, 3.0)

    def starts(*_, **__):
        yield bad
        end = time.process_time() + 0.3
        while time.process_time() < end:
            pass
        yield bad
        raise AssertionError("as long as the one before is more than is left")

    monkeypatch.setattr(module, "boundary_starts", starts)
    budget = Budget(1.5)  # three tenths: 0.45 s
    begun = module.ranked_starts(SOLID, VolumeOptions(), budget, glide=True, progress=None)
    assert next(begun).map is bad


def test_patience_is_for_the_proven_and_for_the_measured(monkeypatch, plain):
    folded = SimpleNamespace(certified=False, ids={})
    bad, poor = twisted(plain, 3.0), dataclasses.replace(plain, certificate=folded)

    def patience(maps):
        monkeypatch.setattr(module, "boundary_starts", lambda *_, **__: iter(maps))
        budget = Budget(600.0)
        begun = module.ranked_starts(SOLID, VolumeOptions(), budget, glide=True, progress=None)
        return [start.patience for start in begun]

    assert patience([plain] * 7) == [0.4, 0.6, 0.6, 0.6, 1.0, 1.0, 1.0]
    assert patience([poor, plain]) == [0.2, 0.6]
    assert patience([bad, plain]) == [0.8, 0.6]
    assert patience([bad, poor]) == [0.4, 0.6]


@pytest.mark.parametrize(("left", "tried"), [(0.2, 4), (0.05, 1)])
def test_no_start_is_made_with_hardly_any_time_left(monkeypatch, plain, left, tried):
    begun = []
    inner = np.ones(SOLID.n_vertices, dtype=bool)
    inner[SOLID.boundary_vertices] = False

    class Nearly(Budget):
        left = property(lambda self: left * self.seconds if begun else self.seconds)

    def fails(problem, *_, **__):
        begun.append(problem)
        turned = dataclasses.replace(problem, x=problem.x * ~inner[:, None])
        return Outcome(turned, (), False, "no", {"start": 0.0})

    monkeypatch.setattr(module, "boundary_starts", lambda *_, **__: iter([plain] * 3))
    monkeypatch.setattr(certified, "solve", fails)
    monkeypatch.setattr(Budget, "of", lambda *_: Nearly(100.0))
    assert not sm.volume_map(SOLID, keep_best=True).certificate.certified
    assert len(begun) == tried


def test_what_ends_inside_out_as_a_whole_is_not_certified(monkeypatch, plain):
    def turned(problem, *_, **__):
        volume = _core.mesh.tet_volumes(problem.x, problem.solid.T).sum()
        folded = dataclasses.replace(problem, x=problem.x * (1.0, 1.0, -np.sign(volume)))
        return Outcome(folded, (), False, "no", {"start": 0.0})

    monkeypatch.setattr(module, "boundary_starts", lambda *_, **__: iter([plain]))
    monkeypatch.setattr(certified, "solve", turned)
    found = sm.volume_map(SOLID, keep_best=True)
    assert not found.certificate.certified and np.isfinite(found.image).all()
    with pytest.raises(CertificationError):
        sm.volume_map(SOLID)


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


def charts(least: float = 1.0, outward: float = 0.0):
    """For `_BoundaryMaps._chart`; faces are folded where the ratio of radii is below that."""

    def made(_, ratio, shape=0.0):
        kept = SimpleNamespace(ratios=np.array([1.0, least]))
        proven = SimpleNamespace(certified=2.0 < ratio < 3.0)
        return SimpleNamespace(
            ratio=ratio,
            shape=shape,
            distortion=kept,
            certificate=proven,
            folded=int(ratio < outward),
        )

    return made


def test_shapes_weigh_less_where_they_would_lose_a_limb(monkeypatch):
    maps = boundary_starts_module._BoundaryMaps(SOLID.surface, VolumeOptions(), None)
    monkeypatch.setattr(boundary_starts_module, "turned", lambda found, _: found)
    monkeypatch.setattr(type(maps), "_not_outward", lambda _, found: found.folded)
    monkeypatch.setattr(type(maps), "_chart", charts(1e-3))
    assert maps.gentle([(2.0, 100.0)]).shape == 100.0
    monkeypatch.setattr(type(maps), "_chart", charts(1e-20))
    assert maps.gentle([(2.0, 100.0)]).shape == 10.0


PAIRS = {
    False: [(1.5, 100.0), (2.4, 100.0), (1.5, 10.0), (2.4, 10.0), (3.75, 100.0), (3.75, 10.0)],
    True: [(1.5, 100.0), (2.4, 100.0), (3.75, 100.0), (1.5, 10.0), (2.4, 10.0), (3.75, 10.0)],
}


@pytest.mark.parametrize("unfolds", [True, False])
@pytest.mark.parametrize("outward", [1.0, 2.0, 3.0, 9.0])
def test_the_first_torus_on_which_kept_shapes_have_no_fold(monkeypatch, outward, unfolds):
    turned = []
    maps = boundary_starts_module._BoundaryMaps
    monkeypatch.setattr(boundary_starts_module, "turned", lambda one, _: turned.append(one) or one)
    monkeypatch.setattr(maps, "fatter_ratio", 1.5)
    made = maps(SOLID.surface, VolumeOptions(), None)
    made.stays_folded = not unfolds  # then the lighter weight of shape is dear: it comes last
    monkeypatch.setattr(maps, "_chart", charts(outward=outward))
    monkeypatch.setattr(maps, "_not_outward", lambda _, found: found.folded)
    pairs = PAIRS[not unfolds]
    good = [k for k, (ratio, _) in enumerate(pairs) if ratio >= outward]
    found = made.gentle_on_fatter()
    if good:
        assert (found.ratio, found.shape) == pytest.approx(pairs[good[0]])
        again = made.gentle_on_fatter()
        assert (again.ratio, again.shape) == pytest.approx(pairs[good[1]])
    else:
        assert found.ratio == pytest.approx(2.4)  # proven, though folded
        assert made.gentle_on_fatter() is None
    # what looks outward everywhere has nothing to turn
    tried = pairs[: good[1]] if good else pairs
    folded = [pair for pair in tried if pair[0] < outward]
    assert np.array([(one.ratio, one.shape) for one in turned]).ravel() == pytest.approx(
        np.array(folded).ravel()
    )


def test_what_got_stuck_on_one_torus_is_followed_by_another_torus(monkeypatch, plain):
    shares, tori = {}, {}
    maps = [dataclasses.replace(plain) for _ in range(4)]
    shares.update(zip(map(id, maps), (0.5, 0.2, 0.21, 0.3), strict=True))
    tori.update(zip(map(id, maps), (1.5, 1.2, 1.2, 1.9), strict=True))
    monkeypatch.setattr(module.Start, "inverted", property(lambda self: shares[id(self.map)]))
    monkeypatch.setattr(
        sm.AreaMap, "torus", property(lambda self: SimpleNamespace(ratio=tori[id(self)]))
    )
    monkeypatch.setattr(module.VolumeProblem, "of", lambda *_, **__: None)
    monkeypatch.setattr(module, "started", lambda problem, **_: problem)
    order, _ = ranked(monkeypatch, maps)
    assert [id(found) for found in order] == [id(maps[k]) for k in (1, 3, 0, 2)]


def test_equal_areas_are_made_once_for_each_weight_of_shape(monkeypatch):
    made = boundary_starts_module._BoundaryMaps(SOLID.surface, VolumeOptions(), None)
    weights = []

    def balanced(level, shape, *others):
        weights.append(shape)
        return balance_areas(level, shape, *others)

    monkeypatch.setattr(route, "balance_areas", balanced)
    charts = [made._chart(ratio, shape) for shape in (100.0, 1e3) for ratio in (2.0, 3.0)]
    assert weights == [100.0, 1e3]
    assert [chart.torus.ratio for chart in charts] == pytest.approx([2.0, 3.0] * 2)


@pytest.mark.parametrize(
    ("folded", "skipped", "first"),
    [(0.0, False, "gentle"), (0.02, True, "equal"), (0.1, True, "gentle")],
)
def test_equal_areas_come_before_kept_shapes_only_where_turning_just_failed(
    monkeypatch, folded, skipped, first
):
    maps = boundary_starts_module._BoundaryMaps(SOLID.surface, VolumeOptions(), None)
    monkeypatch.setattr(maps, "_not_outward", lambda _: int(folded * SOLID.surface.n_faces))
    monkeypatch.setattr(boundary_starts_module, "turned", lambda found, _: found)
    makers = maps.gliding()
    assert (next(makers)() is None) == skipped
    order = [next(makers) for _ in range(4)]
    where = 3 if first == "gentle" else 0
    assert [make == maps.fatter for make in order] == [k == where for k in range(4)]
    assert order.count(maps.gentle_on_fatter) == 3


@pytest.mark.parametrize("size", [(7, 1, 7), (9, 1, 9), (8, 2, 9)])
def test_a_mug_whose_walls_have_few_vertices_inside(size):
    """From kept shapes; on the fatter torus they fold, and equal areas end with SD 0.11 to 0.13."""
    result = sm.volume_map(mug(*size), options=VolumeOptions(time_limit=0.01))
    assert result.certificate.certified and result.converged
    assert result.distortion.element_std < 0.105


def test_a_torus_on_which_so_few_faces_enclose_nothing_is_passed_over():
    """A ring of eight cells with a long arm: one of its starts, and that on a thinner torus."""
    cells = np.zeros((12, 12, 1), bool)
    cells[1:4, 1:4] = True
    cells[3:, 1] = cells[11, 1:] = cells[5:, 11] = cells[5, 4:] = True
    cells[2, 2] = False
    result = sm.volume_map(sm.TetMesh(*cut_cells(cells), orient=True))
    assert result.certificate.certified


def breaking(monkeypatch, broken: set[int]) -> list[int]:
    """Solves that break down by their number; those that were begun."""
    solve, begun = certified.solve, []

    def may_break(problem, options, **keywords):
        begun.append(len(begun))
        if begun[-1] in broken:
            raise SolverError("the energy is infinite", ())
        done = solve(problem, options, **keywords)
        folded = len(broken) and begun[-1] < max(broken)
        return dataclasses.replace(done, problem=folded_of(done.problem)) if folded else done

    monkeypatch.setattr(certified, "solve", may_break)
    return begun


def folded_of(problem):
    """One tet turned over."""
    x = problem.x.copy()
    inner = np.flatnonzero(problem.solid.boundary_index < 0)[0]
    x[inner] += 10.0
    return dataclasses.replace(problem, x=x)


def test_a_start_that_breaks_down_is_one_less(monkeypatch):
    begun = breaking(monkeypatch, {0})
    assert sm.volume_map(SOLID).certificate.certified and begun == [0, 1]


def test_the_search_goes_on_where_a_later_start_breaks_down(monkeypatch):
    begun = breaking(monkeypatch, {1})
    found = sm.volume_map(SOLID)
    assert begun == [0, 1, 2] and found.certificate.certified


def test_if_all_starts_break_down_the_first_reason_is_told(monkeypatch):
    breaking(monkeypatch, set(range(20)))
    with pytest.raises(SolverError, match="energy is infinite"):
        sm.volume_map(SOLID, keep_best=True)
