"""Which grid the optimization goes on with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import _core
from stretchmap.errors import SolverError
from stretchmap.resample import levels
from stretchmap.resample import start as module
from stretchmap.resample.optimize import GridOptimizer
from stretchmap.resample.quality import boundary_distances, boundary_quads, missed_volume
from stretchmap.resample.sizes import grid_candidates
from stretchmap.resample.start import best_starts, pulled_back


def a_ring():
    solid = sm.samples.solid_torus(1500, R=3.0, r=1.0)
    return a_map(solid, solid.V, sm.Torus(3.0, 1.0)), solid


def test_of_several_the_one_closest_to_the_surface_is_gone_on_with():
    result, solid = a_ring()

    def away(start):
        found = boundary_distances(start.V, boundary_quads(start.layout.H), solid.surface)
        return max(found)

    candidates = [(6, 1, 1), (16, 3, 1), (8, 2, 1)]
    best = best_starts(result, solid, candidates)[0]
    assert best.numbers == (16, 3, 1)
    assert np.array_equal(best.pulled, pulled_back(result, best.numbers).V)
    assert away(best) < min(
        away(best_starts(result, solid, [numbers])[0]) for numbers in candidates[::2]
    )


def test_a_candidate_that_breaks_down_is_passed_over(monkeypatch):
    result, solid = a_ring()
    real = module.GridOptimizer.run

    def run(self, schedule, progress=None):
        if len(self.H) == 6 * 5:
            raise SolverError("broke down")
        return real(self, schedule, progress)

    monkeypatch.setattr(module.GridOptimizer, "run", run)
    assert best_starts(result, solid, [(6, 1, 1), (8, 2, 1)])[0].numbers == (8, 2, 1)
    with pytest.raises(SolverError, match="no grid could be begun with: broke down"):
        best_starts(result, solid, [(6, 1, 1), (6, 1, 1)])


def optimized_once(monkeypatch):
    """Every grid: what is compared are choices among the same few."""
    real, known = levels.optimized, {}

    def optimized(V, *rest):
        key = V.tobytes()
        if key not in known:
            known[key] = real(V, *rest)
        return known[key]

    monkeypatch.setattr(levels, "optimized", optimized)


def test_of_the_two_closest_the_one_that_ends_closer_is_returned(monkeypatch):
    """Of two within the tolerance, the better shaped; one that fails leaves the other."""
    result, solid = a_ring()
    starts = best_starts(result, solid, [(6, 1, 1), (16, 3, 1), (8, 2, 1)])
    assert len(starts) == 2
    optimized_once(monkeypatch)
    alone = [levels._best_optimized([start], solid, None) for start in starts]

    def quality(start):
        H = start.layout.H
        away = max(boundary_distances(start.V, boundary_quads(H), solid.surface))
        return away, _core.resample.scaled_jacobians(start.V, H).min()

    closer, farther = sorted(alone, key=lambda start: quality(start)[0])
    better = max(alone, key=lambda start: quality(start)[1])
    for close, alike, expected in ((0.0, 1.0, closer), (0.0, 1e9, better), (1.0, 1.0, better)):
        monkeypatch.setattr(levels, "_CLOSE", (close,))
        monkeypatch.setattr(levels, "_ALIKE", alike)
        for order in (starts, starts[::-1]):
            assert levels._best_optimized(order, solid, None).numbers == expected.numbers

    real = levels.optimized

    def fails(V, H, *rest):
        if len(H) == len(closer.layout.H):
            raise SolverError("not valid", [3])
        return real(V, H, *rest)

    monkeypatch.setattr(levels, "optimized", fails)
    assert levels._best_optimized(starts, solid, None).numbers == farther.numbers
    with pytest.raises(SolverError, match="not valid"):
        levels._best_optimized([closer], solid, None)


def test_a_grid_far_off_is_brought_closer_if_that_helps(monkeypatch):
    """And one whose further rounds break down, fold it or lead away is returned as it was.

    So is one that is close already, or that they do not get there.
    """
    result, solid = a_ring()
    starts = best_starts(result, solid, [(24, 3, 1)])
    H = starts[0].layout.H
    quads = boundary_quads(H)

    def away(start):
        return max(boundary_distances(start.V, quads, solid.surface))

    found = {}
    optimized_once(monkeypatch)
    monkeypatch.setattr(levels, "_ALIKE", 1.0)
    for close in (1.0, 0.004, 0.003, 0.001):
        monkeypatch.setattr(levels, "_CLOSE", (close,))
        found[close] = levels._best_optimized(starts, solid, None)
    assert away(found[0.004]) < 0.9 * away(found[1.0])
    for out_of_reach in (0.003, 0.001):
        assert np.array_equal(found[out_of_reach].V, found[1.0].V)
    monkeypatch.setattr(levels, "_CLOSE", (0.004,))

    class Breaks(GridOptimizer):
        def run(self, *rest):
            raise SolverError("a pivot is not positive")

    class Folds(GridOptimizer):
        def run(self, *rest):
            self.V = self.V[:, ::-1].copy()
            return True

    class Leads(GridOptimizer):
        def run(self, *rest):
            self.V = 0.999 * self.V
            return True

    monkeypatch.setattr(levels, "optimized", lambda V, *rest: found[1.0].V)
    for failing in (Breaks, Folds, Leads):
        monkeypatch.setattr(levels, "GridOptimizer", failing)
        assert np.array_equal(levels._best_optimized(starts, solid, None).V, found[1.0].V)


def stretched(solid, length):
    """Along a direction that is none of the axes."""
    turn = np.linalg.qr(np.random.default_rng(6).standard_normal((3, 3)))[0]
    axes = turn * np.linalg.det(turn) * [length, 1.0, 1.0]
    return sm.TetMesh(solid.V @ axes, solid.T)


def test_hexahedra_are_even_before_they_fit():
    """A map leaves bumps to few; fitted at once those stay large."""
    solid = sm.samples.bumpy_torus(3000)
    result = sm.volume_map(solid, balance=0.0)
    start = pulled_back(result, (30, 3, 1))
    largest = []
    for schedule in (module.TRIAL, replace(module.TRIAL, even=())):
        optimizer = GridOptimizer(start.V, start.layout.H, solid.surface)
        assert optimizer.run(schedule)
        volumes = _core.resample.hex_volumes(optimizer.V, start.layout.H)
        largest.append(volumes.max() / volumes.mean())
    assert largest[0] < 0.8 * largest[1]


def test_what_lost_the_surface_is_not_gone_on_with():
    """In a needle shapes and sizes win over the fit, and the grid swells."""
    solid = sm.samples.vertebra_like(8000)
    found = sm.volume_map(solid)
    long = stretched(solid, 50.0)
    result = a_map(long, found.image, found.torus)
    start = best_starts(result, long, [(24, 2, 1)])[0]
    assert np.array_equal(start.V, start.pulled)
    optimizer = GridOptimizer(start.V, start.layout.H, long.surface)
    optimizer.run(module.TRIAL)
    assert missed_volume(optimizer.V, start.layout.H, long.surface) > 0.05


def test_candidates_have_about_as_many_hexahedra_as_asked_for():
    for ratio in (1.1, 3.0, 8.0):
        for wanted in (12.0, 300.0, 5000.0, 16000.0):
            for sections, block, rings in grid_candidates(ratio, wanted):
                count = sections * block * (block + 4 * rings)
                assert min(block, rings) >= 1 and sections >= 4
                assert sections == 4 or abs(count / wanted - 1.0) < 0.15


def test_a_core_outside_the_image_is_laid_to_what_keeps_it_there():
    """Three sections: a flat face between two of them lies deeper than the core."""
    rim = np.arange(4) * np.pi / 2.0
    u, v = np.meshgrid(np.arange(3) * 2.0 * np.pi / 3.0, rim, indexing="ij")
    torus = sm.Torus(3.0, 1.0)
    V = torus.xi(u.ravel(), v.ravel(), np.ones(12))
    tets = []
    for section in range(3):
        here, there = 4 * section, 4 * ((section + 1) % 3)
        for a, b, c in ((0, 1, 2), (0, 2, 3)):
            prism = [here + a, here + b, here + c, there + a, there + b, there + c]
            tets += [[prism[i] for i in tet] for tet in ((0, 1, 2, 5), (0, 1, 4, 5), (0, 3, 4, 5))]
    solid = sm.TetMesh(V, tets, orient=True)
    with pytest.raises(SolverError, match=r"is too coarse at .* below the torus") as e:
        sm.hex_mesh(a_map(solid, V, torus), n_hexahedra=100)
    assert len(e.value.ids)
    fine, given = a_ring()
    with pytest.raises(SolverError, match="off the torus; a grid needs the torus that the map"):
        sm.hex_mesh(a_map(given, fine.image, sm.Torus(4.5, 1.0)), n_hexahedra=100)
