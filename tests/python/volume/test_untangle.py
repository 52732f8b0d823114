"""How fast epsilon follows the worst determinant down, and what a patch is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.base.budget import Budget
from stretchmap.volume import untangle
from stretchmap.volume.model import FIXED, History, SolidModel
from stretchmap.volume.options import VolumeOptions
from stretchmap.volume.problem import VolumeProblem
from stretchmap.volume.start import started
from stretchmap.volume.untangle import _continue


class Dragging:
    """A minimizer whose steps leave as many tets inverted and no energy to gain."""

    def __init__(self, left: int, alpha: float = 1.0, worst: float = -0.01) -> None:
        self.left, self.alpha, self.worst = left, alpha, worst
        self.epsilons: list[float] = []
        self.soft: list[float] = []

    def value(self, _x, _weights):
        return SimpleNamespace(
            energy=1.0, flips=self.left, folds=0, min_det=self.worst, min_facing=1.0
        )

    def step(self, x, weights, _linear):
        self.epsilons.append(weights.epsilon)
        self.soft.append(weights.soft)
        here = self.value(x, weights)
        return x, SimpleNamespace(before=here, after=here, alpha=self.alpha)


def paces(left: int, alpha: float = 1.0, face: float = 0.0) -> np.ndarray:
    """Of the regularized worst determinant, by which it is to fall in each of ten steps."""
    newton = Dragging(left, alpha)
    _continue(
        newton, np.zeros((1, 3)), face=face, floor=0.005, steps=10,
        enough=lambda *_: False, linear=None, budget=Budget(60.0),
    )  # fmt: skip
    chi = 0.5 * (-0.01 + np.sqrt(np.square(newton.epsilons) + 1e-4))
    return chi[1:] / chi[:-1]


def test_what_drags_on_with_few_tets_left_is_hurried():
    found = paces(3)
    assert found[:1] == pytest.approx(0.9) and found[2:] == pytest.approx(0.7)


@pytest.mark.parametrize(
    "given", [{"left": 500}, {"left": 3, "alpha": 0.5}, {"left": 3, "face": 1.0}]
)
def test_all_else_goes_the_published_pace(given):
    assert paces(**given) == pytest.approx(0.9)


def followed(
    worst: float, *, left: int = 500, alpha: float = 1.0, face: float = 0.0, **given
) -> np.ndarray:
    """Epsilons until patience ends."""
    newton = Dragging(left, alpha, worst=worst)
    _continue(
        newton, np.zeros((1, 3)), face=face, floor=0.02, steps=900,
        enough=lambda _, since, *__: since >= 40, linear=None, budget=Budget(60.0), **given,
    )  # fmt: skip
    return np.array(newton.epsilons)


def test_what_is_inverted_to_many_times_its_volume_is_brought_back_first():
    far, near = followed(-400.0, widest=20.0), followed(-400.0, hasty=True)
    soft = followed(-400.0, soft=0.2, widest=5.0)
    assert far[0] == 20.0 and soft[0] == 5.0 and near[0] == 1.0 and len(near) == 40
    assert followed(-400.0, widest=np.inf)[0] == 80.0
    # More than before are inverted meanwhile: nothing is given up until epsilon is narrow, unless
    # so few had been that they are better left to patches.
    for epsilons in (far, soft, followed(-400.0, soft=0.2, widest=5.0, left=31)):
        assert (epsilons > 0.1).sum() + 40 == len(epsilons) > 50
    assert len(followed(-400.0, soft=0.2, widest=5.0, left=30)) == 40
    # Full steps are hurried down to that, soft ones further, but not where faces glide.
    for epsilons, last in ((far, 0.9), (soft, 0.7)):
        pace = epsilons[1:] / epsilons[:-1]
        assert pace[:5] == pytest.approx(np.sqrt(0.7), abs=0.01)
        assert pace[-5:] == pytest.approx(np.sqrt(last), abs=0.01)
    wide: dict[str, float] = {"widest": 20.0}
    slows = [{**wide, "alpha": 0.5}, {**wide, "face": 1.0}, {"hasty": True}, {}]
    slows += [{"soft": 0.2, "alpha": 0.5}, {"soft": 0.2, "face": 1.0}]
    for given in slows:
        slow = followed(-400.0, **given)
        assert slow[1:] / slow[:-1] == pytest.approx(np.sqrt(0.9), abs=0.01)


@pytest.mark.parametrize(("cured", "hasty", "steps"), [(3, True, 6), (3, False, 11), (6, True, 11)])
def test_in_haste_single_elements_less_are_no_progress(cured, hasty, steps):
    """Of a hundred a few at a time: patches are quicker, unless as many follow in a few steps."""

    class Slow(Dragging):
        def step(self, x, weights, linear):
            if len(self.epsilons) % 3 == 2:
                self.left -= cured
            return super().step(x, weights, linear)

    newton = Slow(100, worst=-0.01)
    _continue(
        newton, np.zeros((1, 3)), face=0.0, floor=0.005, steps=11, hasty=hasty,
        enough=lambda _left, since, _epsilon: since >= 6, linear=None, budget=Budget(60.0),
    )  # fmt: skip
    assert len(newton.epsilons) == steps


@pytest.mark.parametrize("amplitude", [1.0, 10.0, 1e2, 1e4])
def test_a_patch_turned_inside_out_and_blown_up_is_untangled(amplitude):
    solid = sm.samples.bumpy_torus(6000)
    problem = VolumeProblem.of(solid, solid.V[solid.boundary_vertices])
    problem = started(problem, solver="auto")
    model, x = problem.model(VolumeOptions()), problem.x.copy()
    inner = np.setdiff1d(np.arange(len(x)), model.boundary)
    near = np.linalg.norm(x[inner] - x[inner[0]], axis=1)
    some = inner[np.argsort(near)[:40]]
    middle = x[some].mean(axis=0)
    x[some] = middle - amplitude * (x[some] - middle)
    stuck = untangle.stuck_tets(model, x, glide=False)
    assert len(stuck) > 100
    found = untangle.untangle_patches(model, x, stuck, rings=2, glide=False, budget=Budget(60.0))
    assert not len(untangle.stuck_tets(model, found, glide=False))


class Breeding(Dragging):
    """One whose every step turns a tet over."""

    def step(self, x, weights, linear):
        self.left, self.worst = 1, -0.01
        return super().step(x, weights, linear)


@pytest.mark.parametrize("kind", [Dragging, Breeding])
def test_what_is_untangled_is_not_turned_over_for_a_better_worst_tet(kind):
    newton = kind(0, worst=1e-4)
    found = _continue(
        newton, np.zeros((1, 3)), face=1.0, floor=0.02, steps=100,
        enough=lambda *_: False, linear=None, budget=Budget(60.0),
    )  # fmt: skip
    assert (found.left, found.worst) == (0, 1e-4)
    assert newton.epsilons[0] == 0.02 and len(newton.epsilons) <= 7


class Improving(Dragging):
    """One whose every step makes the worst tet a tenth better."""

    def step(self, x, weights, linear):
        self.worst *= 1.1
        return super().step(x, weights, linear)


def test_a_better_worst_tet_is_worth_a_few_steps():
    newton = Improving(0, worst=1e-4)
    found = _continue(
        newton, np.zeros((1, 3)), face=1.0, floor=0.02, steps=100,
        enough=lambda *_: False, linear=None, budget=Budget(60.0),
    )  # fmt: skip
    assert len(newton.epsilons) == 6 and found.worst == pytest.approx(1e-4 * 1.1**6)


@pytest.mark.parametrize(("given", "steps"), [({}, 8), ({"alpha": 0.5}, 20), ({"cured": 8}, 16)])
def test_what_single_tets_hold_up_is_left_to_the_patches(given, steps):
    cured, alpha = given.get("cured"), given.get("alpha", 0.1)

    class Jammed(Dragging):
        def step(self, x, weights, linear):
            self.left = 499 if len(self.epsilons) + 1 == cured else self.left
            return super().step(x, weights, linear)

    # Short steps, but fewer inverted tets at one of them, are not in vain.
    for hasty in (False, True):
        newton = Jammed(500, alpha)
        _continue(
            newton, np.zeros((1, 3)), face=0.0, floor=0.02, steps=20, hasty=hasty,
            enough=lambda *_: False, linear=None, budget=Budget(60.0),
        )  # fmt: skip
        assert len(newton.epsilons) == (steps if hasty else 20)


def tangled(seed: int) -> tuple[SolidModel, np.ndarray]:
    """Inner vertices all off their places, and some far away."""
    solid = sm.samples.bumpy_torus(3000)
    problem = VolumeProblem.of(solid, solid.V[solid.boundary_vertices])
    problem = started(problem, solver="auto")
    model, x = problem.model(VolumeOptions(untangle_iter=12)), problem.x.copy()
    inner, rng = np.setdiff1d(np.arange(len(x)), model.boundary), np.random.default_rng(seed)
    x[inner] += 0.05 * rng.normal(size=(len(inner), 3))
    far = rng.choice(inner, 4, replace=False)
    x[far] += rng.normal(size=(4, 3))
    return model, x


def test_what_is_inverted_far_does_not_hold_up_all_else():
    left = {True: 0, False: 0}
    for seed in range(4):
        model, x = tangled(seed)
        for soft in left:
            history = History(model, Budget(60.0))
            found = untangle.untangle_whole(model, x, history, glide=False, hasty=True, soft=soft)
            left[soft] += found.left
    assert left[True] < 0.5 * left[False]


@pytest.mark.parametrize(
    ("alpha", "n_tets", "allowed", "hard", "softened"),
    [
        (0.125, 10_000, True, 4, 5), (0.13, 10_000, True, 5, 0), (0.125, 10_000, False, 5, 0),
        (1.0, 9_999, True, 0, 5), (1.0, 9_999, False, 5, 0),
    ],
)  # fmt: skip
def test_steps_are_soft_only_where_many_are_inverted_or_the_first_are_short(
    alpha, n_tets, allowed, hard, softened
):
    """Soft ones leave single tets farther inverted than they had been: on walls what then is cured
    by nothing, though steps are long without."""
    newton = Dragging(500, alpha, worst=-400.0)
    newton.set_targets = lambda _: None
    model = SimpleNamespace(
        options=VolumeOptions(untangle_iter=5), T=np.zeros((n_tets, 4), int),
        newton=lambda *_, **__: newton, roomy_weights=None, roomy_volumes=None,
    )  # fmt: skip
    history = SimpleNamespace(budget=Budget(60.0), add=lambda *_, **__: None)
    untangle.untangle_whole(model, np.zeros((1, 3)), history, glide=False, soft=allowed)
    assert newton.soft == [0.0] * hard + [0.2] * softened
    assert newton.epsilons[0] == (1.0 if hard else 5.0)
    assert newton.epsilons[hard:][:1] == [5.0] * (softened > 0)


@pytest.mark.parametrize("cured", [True, False])
def test_what_short_steps_cured_is_not_begun_again(cured):
    """And where soft ones cure less, as with no time left, what was before them counts."""

    class Curing(Dragging):
        def value(self, x, weights):
            self.left = (0 if cured else 400) if (x == 4.0).all() and not weights.soft else 500
            return super().value(x, weights)

        def step(self, x, weights, linear):
            return super().step(x + 1.0, weights, linear)

    newton = Curing(500, 0.1, worst=0.5 if cured else -400.0)
    newton.set_targets = lambda _: None
    model = SimpleNamespace(
        options=VolumeOptions(untangle_iter=5), T=np.zeros((90_000, 4), int),
        newton=lambda *_, **__: newton, roomy_weights=None, roomy_volumes=None,
    )  # fmt: skip
    history = SimpleNamespace(budget=Budget(60.0), add=lambda *_, **__: None)
    done = untangle.untangle_whole(model, np.zeros((1, 3)), history, glide=False, soft=True)
    assert done.left == (0 if cured else 400) and (done.x == 4.0).all()
    assert len(newton.soft) == (4 if cured else 9)


def test_patches_reach_past_no_vertex_that_does_not_move():
    solid = sm.samples.bumpy_torus(3000)
    model = VolumeProblem.of(solid, solid.V[solid.boundary_vertices]).model(VolumeOptions())
    T, free = model.T, np.ones(len(model.V), bool)
    free[model.boundary] = False
    first = int(np.flatnonzero(free[T].sum(axis=1) == 1)[0])
    near = set(T[first])
    for rings in range(3):
        (patch,) = untangle.patches_round(model, np.array([first]), rings, glide=False)
        moving = {v for v in near if free[v]}
        assert set(patch.vertices[patch.motion != FIXED]) == moving
        assert set(patch.tets) == {t for t in range(len(T)) if moving & set(T[t])}
        near |= {v for t in patch.tets for v in T[t]}
