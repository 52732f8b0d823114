"""Steps of the minimization of volume distortion, and when it is at rest."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import _core
from stretchmap.samples.solids import cut_cells
from stretchmap.volume import engine
from stretchmap.volume import minimize as minimizing
from stretchmap.volume import model as modeling
from stretchmap.volume.minimize import _Standstill, minimize
from stretchmap.volume.options import FillOptions


def steps(*lengths_and_promises, negative_curvature=False):
    """Steps that gain next to nothing."""
    report = SimpleNamespace(energy=1e4, flips=0, folds=0)
    for alpha, decrement in lengths_and_promises:
        yield SimpleNamespace(
            before=report,
            after=report,
            alpha=alpha,
            decrement=decrement,
            negative_curvature=negative_curvature,
        )


@pytest.mark.parametrize(
    ("promises", "records"),
    [
        ([(1.0, 1e-9)], 1),
        ([(1e-5, 1e3), (1.0, 1e-9), (1e-5, 1e3)] + [(1.0, 1e-9)] * 5, 8),
    ],
)
def test_a_small_promise_after_a_large_one_that_was_not_kept_is_no_rest(promises, records):
    """Of a gradient that one flat tet fills, a solver sees nothing else: it promises nothing."""
    assert steps_until_rest(steps(*promises)) == records


def test_many_steps_of_negative_curvature_that_gain_nothing_are_rest():
    assert steps_until_rest(steps(*[(1.0, 1e-9)] * 30, negative_curvature=True)) == 20
    large = steps(*[(1.0, 1e-9)] * 10, (1.0, 1e3), *[(1.0, 1e-9)] * 30, negative_curvature=True)
    assert steps_until_rest(large) == 31


def steps_until_rest(given):
    """Steps taken of those given until the minimization says that it converged."""
    newton = SimpleNamespace(set_targets=lambda _: None, step=lambda x, *_: (x, next(given)))
    options = FillOptions(shared=1)
    model = SimpleNamespace(
        options=options,
        newton=lambda x, glide: newton,
        targets=np.ones(1),
        torus=None,
        T=np.zeros((1, 4), np.int32),
    )
    kept = []
    history = SimpleNamespace(
        budget=SimpleNamespace(spent=False), add=lambda *_, **__: kept.append(1)
    )
    goal = options.volume_weight
    done = minimize(model, np.zeros((4, 3)), history, glide=False, start=goal, goal=goal)
    assert done.converged
    return len(kept)


def test_steps_cut_short_at_the_last_weight_are_followed_by_convex_hessians(monkeypatch):
    made, options = [], _core.volume.NewtonOptions
    monkeypatch.setattr(
        _core.volume, "NewtonOptions", lambda **given: made.append(given) or options(**given)
    )
    report = SimpleNamespace(energy=1.0, flips=0, folds=0, min_det=1.0, min_facing=1.0)
    gaining = [
        SimpleNamespace(
            before=report, after=SimpleNamespace(energy=0.9), alpha=alpha, decrement=0.2,
            negative_curvature=False, held_up=None,
        )
        for alpha in [1.0, 0.3, *[1.0] * 30]
    ]  # fmt: skip
    steps_until_rest(itertools.chain(gaining, steps(*[(1.0, 1e-9)] * 30)))
    kept = [given["keep_hessian"] for given in made]
    shares = [given["negative"] for given in made]
    assert shares[0] == shares[1] > 0.0 and shares[2] == 0.0
    again = shares.index(shares[0], 2)
    # So many with a Hessian of their own; those that share one have what it has.
    assert kept[2:again].count(False) == minimizing._CONVEX
    assert max(shares[2:again]) == 0.0


def asked_of(volumes, alphas):
    """What is asked of two tets, one seven times as large as the other, before each step."""
    given = iter(alphas)
    report = SimpleNamespace(energy=1.0, flips=0, folds=0, min_det=1.0, min_facing=1.0)
    asked, opened = [], []

    def step(x, *_):
        return x, SimpleNamespace(
            before=report, after=report, alpha=next(given), decrement=1.0, negative_curvature=False,
            held_up=held_up,
        )  # fmt: skip

    held_up = object()
    newton = SimpleNamespace(set_targets=asked.append, step=step)
    model = SimpleNamespace(
        options=FillOptions(glide_iter=len(alphas)),
        newton=lambda x, glide: newton,
        shares=np.array([0.125, 0.875]),
        torus=None,
        T=np.zeros((2, 4), np.int32),
        asked_alike=lambda x: 1.0,
    )
    history = SimpleNamespace(budget=SimpleNamespace(spent=False), add=lambda *_, **__: None)

    def relaxed(x, goals, _, elements):
        assert elements is held_up
        opened.append(goals)
        return x

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(minimizing, "Relaxation", lambda _: SimpleNamespace(relaxed=relaxed))
        minimize(model, np.zeros((4, 3)), history, glide=True, start=1.0, goal=9.0, asked=volumes)
    # What single elements are opened for is what all are asked for.
    last = asked[-1] if asked else np.ones(2)
    assert (alphas[-1] >= 0.5) or np.array_equal(opened[-1], last)
    return np.array(asked)


def test_what_a_boundary_squeezed_is_asked_to_grow_step_by_step():
    asked = asked_of(np.array([4.0, 4.0 / 7.0]), [1.0, 0.2, 0.7] + [1.0] * 9)
    uneven = asked[:, 0] / asked[:, 1]
    assert uneven[0] == pytest.approx(7.0)
    assert uneven[2] == uneven[1] < uneven[0]  # after a short step the same is asked for once more
    assert (np.diff(uneven) <= 0.0).all() and uneven[-1] == 1.0 and len(asked) < 10
    assert asked @ [0.125, 0.875] == pytest.approx(np.ones(len(asked)))


def test_even_volumes_are_asked_for_at_once_where_they_nearly_are():
    assert len(asked_of(np.array([1.05, 0.99]), [1.0, 0.2])) == 0
    assert len(asked_of(None, [1.0, 0.2])) == 0
    assert len(asked_of(np.array([4.0, 4.0 / 7.0]), [1.0, 0.2])) == 3
    assert (asked_of(np.array([4.0, 4.0 / 7.0]), [0.0, 1.0])[-1] == 1.0).all()  # no step at all


def plate(*shape: int) -> sm.TetMesh:
    """With a hole near one corner; where shapes are kept, what is far from it is tiny."""
    cells = np.ones(shape, bool)
    cells[1, 1] = False
    return sm.TetMesh(*cut_cells(cells), orient=True)


def error_of(plates: list[sm.TetMesh], tols: tuple[float, ...]) -> float:
    """SDs of all together; rough solves lead to other minima by chance."""
    maps = [sm.volume_map(p, options=sm.VolumeOptions(cg_tol=tol)) for p in plates for tol in tols]
    return sum(each.distortion.element_std for each in maps)


def test_growing_step_by_step_leads_to_better_volumes(monkeypatch):
    """Of plates with an inside, the SDs are three quarters; the steps are as many."""
    thick = [plate(n, m, 2) for n in range(6, 12) for m in (6, 8)]
    thin = [plate(n, m, 1) for m in (4, 6) for n in range(6, 15, 4)]
    monkeypatch.setattr(engine, "_FINER_ROUNDS", 0)
    error, error_thin = error_of(thick, (0.05,)), error_of(thin, (0.05, 0.02))
    monkeypatch.setattr(minimizing, "_EVEN", np.inf)
    assert error < 0.85 * error_of(thick, (0.05,))
    assert error_thin < 0.85 * error_of(thin, (0.05, 0.02))


@pytest.mark.parametrize("n_tets", [10_000, 40_000])
def test_volumes_that_are_right_take_no_more_steps(n_tets):
    solid = sm.samples.solid_torus(n_tets)
    found = sm.volume_map(solid)
    assert found.converged and found.stop_reason == "volumes are right"
    assert found.distortion.element_std < 1e-4
    options = sm.VolumeOptions(tol=2e-3)
    further = sm.volume_map(solid, options=options)
    assert further.stop_reason != "volumes are right"
    assert len(further.history) > len(found.history)
    assert further.distortion.element_std < 0.5 * found.distortion.element_std


def test_steps_that_gain_little_by_turns_are_slow_together():
    def slow(gains, alphas=()):
        standstill, energy, told = _Standstill(), 1.0, []
        for gain, alpha in itertools.zip_longest(gains, alphas, fillvalue=1.0):
            told.append(standstill.slow(alpha, energy, (1.0 - gain) * energy, 2e-3, math.inf))
            energy *= 1.0 - gain
        return told

    little = [0.006, 0.001] * 6
    assert slow(little) == [False] * 7 + [True] * 5  # eight of them, and 3.2 % together
    assert not any(slow([0.01] * 12)) and not any(slow(little[:7]))
    # Those that follow a short one count.
    assert slow(little, [1.0, 1.0, 0.1]) == [False] * 10 + [True] * 2


def test_fewer_steps_lead_to_nearly_the_same_volumes(monkeypatch):
    def steps_and_error(solid: sm.TetMesh) -> tuple[int, float]:
        found = sm.volume_map(solid)
        assert found.converged and found.certificate.certified
        return len(found.history), found.distortion.element_std

    smooth, flat = sm.samples.vertebra_like(24_000, seed=1), plate(6, 8, 2)
    steps, error = steps_and_error(smooth)
    on_plate = steps_and_error(flat)
    monkeypatch.setattr(minimizing, "_SLOWLY", 0.0)
    more_steps, less_error = steps_and_error(smooth)
    assert steps < 0.9 * more_steps and error < 1.08 * less_error
    # Single elements cut its steps short.
    assert on_plate == pytest.approx(steps_and_error(flat), rel=0.02)


def test_a_held_boundary_glides_after_a_whole_step():
    stages = [record.stage for record in sm.volume_map(sm.samples.bumpy_torus(6000)).history]
    assert stages.count("frozen") == 1
    options = sm.VolumeOptions(volume_weight=10.0)  # nothing glides at a larger one
    stages = [r.stage for r in sm.volume_map(sm.samples.bumpy_torus(6000), options=options).history]
    assert stages.count("frozen") > 1


def wrench(*length: int, fine: int) -> sm.TetMesh:
    """A ring at one end of a handle, a fork at the other."""
    handle, thick = length
    cells = np.zeros((6 + handle, 3, thick), bool)
    cells[:3] = cells[-3:] = cells[:, 1] = True
    cells[1, 1] = cells[-2:, 1] = False
    return sm.TetMesh(*cut_cells(np.kron(cells, np.ones((fine,) * 3, bool))), orient=True)


def test_what_the_boundary_cuts_off_is_hardly_asked_for(monkeypatch):
    """Where few faces reach far round the torus, volumes are kept better by an eighth."""
    solids = [wrench(10, 2, fine=2), wrench(6, 1, fine=3)]
    monkeypatch.setattr(engine, "_FINER_ROUNDS", 0)

    def error() -> float:
        exact = [sm.VolumeOptions(cg_tol=tol) for tol in (0.05, 0.001)]
        maps = [sm.volume_map(solid, options=o) for solid in solids for o in exact]
        return sum(each.distortion.element_error_mean for each in maps)

    hardly = error()
    monkeypatch.setattr(modeling, "_AS_A_WHOLE", 1.0)
    assert hardly < 0.93 * error()


def test_even_volumes_between_levels_are_not_more_than_there_was():
    """Were all asked for what is cut off, too, the SD would grow by a fifth."""
    coarse = sm.samples.bumpy_torus(600)
    found = sm.volume_map(coarse, options=sm.VolumeOptions(marginal_tol=1e-9))
    before = [record.element_std for record in found.history if record.stage == "glide"][-1]
    assert any(record.stage == "equalize" for record in found.history)
    assert found.distortion.element_std < 1.05 * before
