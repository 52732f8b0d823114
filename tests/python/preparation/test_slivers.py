"""Surfaces of long, thin triangles, as CAD gives them, keep their shape."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gpytoolbox", reason="remeshing needs gpytoolbox")

import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import SolverError
from stretchmap.preparation.even import even
from stretchmap.preparation.holes import crossings
from stretchmap.preparation.split import split_long_edges


def pipe(n: int, length: float, outer: float, inner: float) -> sm.TriMesh:
    """Two triangles as long as the pipe for each of n sides, outside and inside."""
    angle = 2.0 * np.pi * np.arange(n) / n
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ends = ((outer, 0.0), (outer, length), (inner, length), (inner, 0.0))
    V = np.vstack([np.column_stack([r * circle, np.full(n, z)]) for r, z in ends])
    i = np.arange(n)
    j = (i + 1) % n
    F = []
    for k in range(4):
        p, q = k * n, (k + 1) % 4 * n
        F += [np.stack([p + i, p + j, q + j], 1), np.stack([p + i, q + j, q + i], 1)]
    return sm.TriMesh(V, np.vstack(F).astype(np.int32))


def some_pipe(seed: int) -> sm.TriMesh:
    rng = np.random.default_rng(seed)
    outer = rng.uniform(0.45, 0.7)
    return pipe(int(rng.integers(24, 80)), rng.uniform(4, 10), outer, rng.uniform(0.3, 0.5) * outer)


@pytest.mark.parametrize("seed", range(4))
def test_splitting_keeps_points_and_topology(seed):
    given = some_pipe(seed)
    halved = split_long_edges(given, 0.5)
    ends = halved.V[halved.edges]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max() <= 0.5
    assert halved.diagnose().ok and halved.genus == 1 and not len(crossings(halved))
    assert np.array_equal(halved.V[: given.n_vertices], given.V)
    assert halved.area == pytest.approx(given.area, rel=1e-10)
    assert halved.volume == pytest.approx(given.volume, rel=1e-10)


def test_nothing_is_split_without_need():
    torus = samples.torus_surface(20, 10)
    assert np.array_equal(split_long_edges(torus, 10.0).F, torus.F)


@pytest.mark.parametrize("seed", range(4))
def test_long_triangles_are_remeshed_in_shape(seed):
    given = some_pipe(seed)
    smooth = even(given, 4_000)
    assert not len(crossings(smooth))
    assert smooth.volume == pytest.approx(given.volume, rel=0.06)


@pytest.mark.parametrize("seed", [10, 11, 12])
def test_long_pipes_become_solids(seed):
    pytest.importorskip("tetgen")
    given = some_pipe(seed)
    done = sm.prepare(given, faces=3_000, filler="tetgen")
    done.solid.require_solid_torus()
    assert done.solid.volume == pytest.approx(given.volume, rel=0.06)


def test_more_faces_are_used_where_so_few_would_cross(monkeypatch):
    pytest.importorskip("tetgen")
    given = some_pipe(10)

    def fails(surface, faces):
        raise SolverError("no")

    monkeypatch.setattr("stretchmap.preparation.pipeline._remeshed", fails)
    done = sm.prepare(given, faces=2_000, filler="tetgen")
    counts = {step.name: dict(step.counts) for step in done.steps}["remesh"]
    assert counts["more_than_asked"] == 1 and 2_200 < counts["faces"] == done.surface.n_faces
    assert done.solid.volume == pytest.approx(given.volume, rel=0.06)


@pytest.mark.parametrize(("thickness", "much"), [(0.03, True), (0.5, False)])
def test_what_remeshing_costs_of_the_volume_is_told(caplog, thickness, much):
    disc = pipe(48, thickness, 1.0, 0.4)
    done = sm.prepare(disc, faces=1_000)
    lost = done.steps[-1].counts["percent_of_volume_lost"]
    assert lost == pytest.approx(100.0 * (1.0 - done.solid.volume / disc.volume), abs=0.01)
    assert (lost > 10.0) == much
    assert ("of the volume is lost" in caplog.text) == much
    assert "percent of volume lost" in done.summary()
