"""The generator of random solids and the run over them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import stretchmap as sm

ROOM = Path(__file__).resolve().parents[3] / "bench" / "robustness"
for package in ("manifold3d", "pyacvd", "pytetwild", "skimage", "tetgen"):
    pytest.importorskip(package)


@pytest.fixture(autouse=True)
def room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOM))


@lru_cache(maxsize=32)
def drawn(name: str, seed: int) -> sm.TetMesh:
    """A small one."""
    from families import families

    return families()[name].draw(seed, {"thorny": 0.1, "bare": 0.2}.get(name, 0.3))


def test_there_are_the_families_asked_for(room):
    from families import families

    assert len(families()) >= 8
    assert all(family.name == name for name, family in families().items())


@pytest.mark.parametrize(
    "name",
    ["raw_tubes", "thorny", "cut_grids", "stacks", "bottles", "ribbons", "parts", "pipes", "bare"],
)
def test_a_seed_is_a_solid_torus_and_always_the_same(name):
    first, again, other = drawn(name, 2), drawn.__wrapped__(name, 2), drawn(name, 3)
    first.require_solid_torus()
    assert np.array_equal(first.V, again.V) and np.array_equal(first.T, again.T)
    assert first.V.shape != other.V.shape or not np.array_equal(first.V, other.V)


def test_conformal_rings_have_even_triangles():
    from families.rings import ring

    surface = ring(np.random.default_rng(0), 1.02, 4_000, 0.0)
    corners = surface.V[surface.F]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert surface.genus == 1
    assert (edges.max(axis=1) / edges.min(axis=1)).max() < 3.0
    # Yet their sizes differ by far: the hole is fifty times smaller than the ring.
    assert surface.face_areas.max() > 1_000.0 * surface.face_areas.min()


def test_ribbons_close_after_half_turns():
    from families.ribbons import ribbon

    surfaces = [ribbon(np.random.default_rng(seed), 3_000) for seed in range(12)]
    # Closed up the wrong way, edges there would span the ribbon.
    assert all(surface.genus == 1 and surface.volume > 0.0 for surface in surfaces)
    for surface in surfaces:
        corners = surface.V[surface.F]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
        assert longest < 0.5


def test_walls_of_pipes_have_hardly_a_vertex_inside():
    from families.pipes import pipe
    from surfaces import fill

    solids = [fill(pipe(np.random.default_rng(seed), 6_000)) for seed in range(6)]
    assert all(3_000 < solid.n_tets < 20_000 for solid in solids)
    inside = [solid.n_vertices - solid.surface.n_vertices for solid in solids]
    assert np.median(inside) == 0


def test_bare_solids_have_hardly_a_vertex_inside():
    for seed in range(4):
        solid = drawn("bare", seed)
        assert (solid.boundary_index < 0).sum() <= 10 < solid.n_vertices


def test_more_parts_than_one_hole_are_refused():
    from surfaces import Rejected, RoundCone, polygonize

    ball = RoundCone(np.zeros(3), np.zeros(3), 1.0, 1.0)
    with pytest.raises(Rejected):
        polygonize([ball], 0.2)
