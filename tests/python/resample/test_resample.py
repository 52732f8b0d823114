"""Hexahedral grids and fields carried over, against closed forms."""

from __future__ import annotations

import time

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import samples
from stretchmap.errors import OptionError
from stretchmap.registration.map import register
from stretchmap.resample import levels
from stretchmap.resample.hexes import hex_mesh
from stretchmap.resample.quality import missed_volume

RNG = np.random.default_rng(2)


NUMBERS = {"sections": 60, "block": 2, "rings": 2}


@pytest.fixture(scope="module")
def standard():
    solid = samples.solid_torus(40_000, R=3.0, r=1.0)
    return a_map(solid, solid.V, sm.Torus(3.0, 1.0))


@pytest.fixture(scope="module")
def bumpy_map():
    return sm.volume_map(samples.bumpy_torus(6000))


@pytest.fixture(scope="module")
def vertebra_map():
    return sm.volume_map(samples.vertebra_like(8000))


@pytest.fixture(scope="module")
def registered():
    pair = samples.vertebra_pair(n_landmarks=30, n_tets=(6000, 8000))
    return register(pair.source, pair.target, (pair.source_landmarks, pair.target_landmarks))


def test_the_grid_of_the_standard_torus_is_the_standard_grid(standard):
    mesh = hex_mesh(standard, sections=48, block=4, rings=4, optimize=False)
    assert np.allclose(mesh.V, mesh.grid, atol=1e-9)
    assert mesh.n_invalid == 0 and mesh.n_pulled_back_invalid == 0
    assert len(mesh.H) == 48 * (4 * 4 + 4 * 4 * 4)
    assert mesh.volume == pytest.approx(standard.mesh.volume, rel=0.04)
    # Every inner quad is shared by two hexahedra, the rest is a torus.
    faces = mesh.H[:, [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6],
                       [3, 0, 4, 7]]].reshape(-1, 4)  # fmt: skip
    _, count = np.unique(np.sort(faces, axis=1), axis=0, return_counts=True)
    assert set(count) == {1, 2} and (count == 1).sum() == 48 * 16
    edges = np.sort(mesh.H[:, [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4],
                               [0, 4], [1, 5], [2, 6], [3, 7]]].reshape(-1, 2), axis=1)  # fmt: skip
    n_edges = len(np.unique(edges, axis=0))
    assert len(mesh.V) - n_edges + len(count) - len(mesh.H) == 0


@pytest.fixture(scope="module")
def vertebra_grid(vertebra_map):
    return hex_mesh(vertebra_map, **NUMBERS)


def test_an_optimized_grid_is_valid_of_good_shape_and_fills_the_solid(bumpy_map):
    raw = hex_mesh(bumpy_map, n_hexahedra=700, optimize=False)
    assert raw.moved == raw.boundary_moved == 0.0
    mesh = hex_mesh(bumpy_map, n_hexahedra=700)
    assert 560 < len(mesh.H) < 840
    assert mesh.n_invalid == 0 and mesh.valid.all()
    assert mesh.jacobians.max() <= 1.0 + 1e-12
    assert mesh.scaled_jacobians.min() > 0.35
    assert mesh.scaled_jacobians.mean() > raw.scaled_jacobians.mean()
    assert mesh.scaled_jacobians.mean() > 0.8
    assert abs(mesh.volume / bumpy_map.mesh.volume - 1.0) < 0.003
    assert max(mesh.grid_to_surface, mesh.surface_to_grid) < 0.015
    u, v, s = mesh.coordinates.T
    assert np.allclose(bumpy_map.torus.xi(u, v, s), mesh.grid, atol=1e-12)


def test_a_tangled_grid_is_made_valid(vertebra_map, vertebra_grid):
    """Sections through a sharply bent image leave hexahedra turned over."""
    raw = hex_mesh(vertebra_map, **NUMBERS, optimize=False)
    mesh = vertebra_grid
    assert raw.n_invalid == raw.n_pulled_back_invalid == mesh.n_pulled_back_invalid > 0
    assert mesh.n_invalid == 0
    assert mesh.scaled_jacobians.mean() > max(0.7, 1.2 * raw.scaled_jacobians.mean())
    moved = np.linalg.norm(mesh.V - raw.V, axis=1)
    moved /= np.linalg.norm(np.ptp(vertebra_map.mesh.V, axis=0))
    assert mesh.moved == pytest.approx(moved.max(), rel=1e-12) and mesh.moved < 0.3
    assert abs(mesh.volume / vertebra_map.mesh.volume - 1.0) < 0.05


@pytest.mark.parametrize(("seed", "length"), [(5, 100.0), (6, 30.0)])
def test_grids_of_very_long_solids_are_valid_and_do_not_swell(vertebra_map, seed, length):
    """Edges next to parallel do not untangle as they are; or shapes win over the fit."""
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    axes = turn * np.linalg.det(turn) * [length, 1.0, 1.0]
    long = sm.TetMesh(vertebra_map.mesh.V @ axes, vertebra_map.mesh.T)
    mesh = hex_mesh(
        a_map(long, vertebra_map.image, vertebra_map.torus), sections=24, block=2, rings=1
    )
    assert mesh.n_pulled_back_invalid > 0 and mesh.n_invalid == 0
    assert abs(mesh.volume / long.volume - 1.0) < 0.02


@pytest.mark.parametrize(("sections", "block", "rings"), [(16, 1, 1), (20, 3, 2)])
def test_grids_of_other_sizes_are_valid_too(vertebra_map, sections, block, rings):
    mesh = hex_mesh(vertebra_map, sections=sections, block=block, rings=rings)
    assert mesh.n_invalid == 0 and len(mesh.H) == sections * block * (block + 4 * rings)


def test_stages_are_reported(bumpy_map):
    seen = []
    hex_mesh(
        bumpy_map, sections=20, block=1, rings=1,
        progress=lambda stage, done, total, **values: seen.append((stage, values)),
    )  # fmt: skip
    stages = [stage for stage, _ in seen]
    assert list(dict.fromkeys(stages)) == ["untangle", "sizes", "optimize", "validity"]
    assert seen[-1][1] == {"invalid": 0}


def test_large_grids_start_from_half_the_numbers(bumpy_map, monkeypatch):
    monkeypatch.setattr(levels, "_COARSE", 600)
    mesh = hex_mesh(bumpy_map, sections=40, block=4, rings=2)
    assert len(mesh.H) == 40 * 48 and mesh.n_invalid == 0
    assert mesh.scaled_jacobians.min() > 0.3
    assert abs(mesh.volume / bumpy_map.mesh.volume - 1.0) < 0.003


def test_of_a_large_grid_half_the_numbers_choose(bumpy_map, monkeypatch):
    """And the choice alone is optimized; of few, and where some are odd, all are compared."""
    monkeypatch.setattr(levels, "_COMPARED", 250)
    compared, done = [], []
    choose, improve = levels.best_starts, levels.optimized

    def best_starts(result, solid, candidates, progress):
        compared.append(np.array(candidates).tolist())
        return choose(result, solid, candidates, progress)

    def optimized(V, H, *rest):
        done.append(len(H))
        return improve(V, H, *rest)

    monkeypatch.setattr(levels, "best_starts", best_starts)
    monkeypatch.setattr(levels, "optimized", optimized)
    solid = bumpy_map.mesh
    even = np.array([[16, 2, 2], [24, 2, 2]])
    start = levels.coarse_grid(bumpy_map, solid, even, 2, None)
    assert compared.pop() == [[8, 1, 1], [12, 1, 1]] and list(start.numbers) in even.tolist()
    sections, block, rings = start.numbers
    assert done == [len(start.layout.H)] == [sections * block * (block + 4 * rings)]
    assert missed_volume(start.V, start.layout.H, solid.surface) < 0.005
    monkeypatch.setattr(levels, "optimized", lambda V, *rest: V)
    for candidates, times in ((even, 1), (even + 1, 2)):
        levels.coarse_grid(bumpy_map, solid, candidates, times, None)
        assert compared.pop() == candidates.tolist()


def test_sizes_that_are_halved_once_more_to_compare_choices():
    assert [levels.levels_for(k) for k in (16_000, 16_001, 128_001, 1e6)] == [0, 1, 2, 2]
    assert [levels.halvings_for(k) for k in (16_000, 100_000, 380_000, 1e6)] == [0, 1, 2, 3]


def test_the_size_wanted_is_met(bumpy_map):
    size = (bumpy_map.mesh.volume / 700) ** (1.0 / 3.0)
    by_size = hex_mesh(bumpy_map, target_size=size, optimize=False)
    by_number = hex_mesh(bumpy_map, n_hexahedra=700, optimize=False)
    assert np.array_equal(by_size.H, by_number.H)
    assert 0.8 < len(by_size.H) / 700 < 1.25
    with pytest.raises(OptionError, match="not both"):
        hex_mesh(bumpy_map, target_size=size, n_hexahedra=700)
    fewest = hex_mesh(bumpy_map, target_size=1e200, optimize=False)
    assert len(fewest.H) < 40


@pytest.mark.parametrize(
    "numbers",
    [
        {"sections": 2**31},
        {"sections": 2**31 - 1},
        {"sections": 10**5, "block": 10**4, "rings": 10**4},
        {"n_hexahedra": 10**12},
        {"target_size": 1e-9},
        {"target_size": 1e-200},
    ],
)
def test_grids_larger_than_memory_are_refused_at_once(standard, numbers):
    start = time.process_time()
    with pytest.raises(OptionError, match=r"GiB|at most"):
        sm.hex_mesh(standard, **numbers)
    assert time.process_time() - start < 2.0


def test_bad_input_is_named(standard, registered):
    for options in (
        {"sections": 2},
        {"block": 0},
        {"rings": 0},
        {"sections": 12, "block": 2, "rings": 1, "n_hexahedra": 99_999},
        {"sections": 12, "block": 2, "rings": 1, "target_size": 0.1},
    ):
        with pytest.raises(OptionError):
            hex_mesh(standard, **options)
    with pytest.raises(OptionError):
        hex_mesh(registered)
