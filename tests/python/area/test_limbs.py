"""Long thin limbs: a flat map shrinks them by a factor with every turn of their girth."""

from __future__ import annotations

import dataclasses
import itertools
from types import SimpleNamespace

import numpy as np
import pytest

import stretchmap as sm
from shapes import with_branch, with_limb
from stretchmap import _core
from stretchmap.area import finish, flat, limbs
from stretchmap.area.flat import unfolded_turns
from stretchmap.area.limbs import spread_limbs
from stretchmap.errors import CertificationError, SolverError


def limb(rings: int) -> sm.TriMesh:
    return with_limb(sm.samples.torus_surface(36, 18), rings, 0.12)


@pytest.mark.parametrize(("rings", "time_limit"), [(30, 0.02), (130, 0.004)])
def test_a_limb_is_mapped_without_a_fold(rings, time_limit):
    """The longest, which is spread in the flat chart, with as many more faces as a quarter of the
    time allows."""
    result = sm.area_map(limb(rings), time_limit=time_limit)
    assert result.certificate.certified and result.distortion.flips == 0


@pytest.mark.parametrize("ahead", [0, 1, 20, 60])
def test_a_folded_start_is_replaced_by_one_without_folds(ahead):
    """Whether numbers end with the tip or begin with so many of its vertices."""
    V, F = limb(40).V, limb(40).F
    surface = sm.TriMesh(np.roll(V, ahead, axis=0), (F + ahead) % len(V))
    conformal = sm.conformal_map(surface)
    noise = 0.05 * np.random.default_rng(1).normal(size=conformal.turns.shape)
    chart = _core.area.SurfaceChart(surface.topology, conformal.forms)
    folded = dataclasses.replace(conformal, turns=conformal.turns + noise)
    assert _core.area.turn_areas(chart, folded.turns).min() < 0.0
    assert (_core.area.turn_areas(chart, unfolded_turns(surface, folded)) > 0.0).all()


def halved(surface: sm.TriMesh) -> sm.TriMesh:
    """Four faces for one, so that twelve edges run round a limb."""
    V = np.vstack([surface.V, surface.V[surface.edges].mean(axis=1)])
    (a, b, c), (x, y, z) = surface.F.T, surface.topology.edge.reshape(-1, 3).T + len(surface.V)
    faces = [(a, x, z), (b, y, x), (c, z, y), (x, y, z)]
    return sm.TriMesh(V, np.vstack([np.column_stack(corners) for corners in faces]))


def limb_on_limb() -> sm.TriMesh:
    """A limb, and another one from a third of its way."""
    surface = limb(100)
    at = len(surface.V) - 200
    turned = sm.TriMesh(np.roll(surface.V, -at, axis=0), (surface.F - at) % len(surface.V))
    return with_limb(turned, 60, 0.12)


@pytest.mark.parametrize("surface", [limb(200), limb_on_limb()], ids=["one", "two"])
def test_limbs_of_many_girths_are_spread(surface):
    """Tutte's map loses thousands of their faces in rounding, the spread one none."""
    surface = halved(surface)
    conformal = sm.conformal_map(surface)
    chart = _core.area.SurfaceChart(surface.topology, conformal.forms)
    weights, forms = np.ones(len(surface.edges)), conformal.forms.astype(float)
    turns = _core.forms.harmonic_forms(len(surface.V), surface.edges, weights, forms)[1]
    least = 1e-30
    assert (_core.area.turn_areas(chart, turns) < least).sum() > 2000
    spread, before = turns, None
    while spread is not before:
        before = spread
        spread = spread_limbs(surface, chart, spread, forms, conformal.aspect, least)
    areas = _core.area.turn_areas(chart, spread)
    assert (areas > least).all() and abs(areas.sum() - 1.0) < 1e-9
    stays = (spread == turns).all(axis=1)
    assert 0 < stays.sum() < len(stays) - 1000
    assert np.array_equal(unfolded_turns(surface, conformal), spread)


def test_folds_are_mended_by_neighbors_and_all_else_stays():
    surface = sm.samples.torus_surface(36, 18)
    faces = np.flatnonzero((surface.V[surface.F][:, :, 0] > 2.2).all(axis=1))
    disk = limbs._Limb.of(surface, faces, np.zeros((2, len(surface.edges))))
    x, y, height = surface.V[disk.vertices].T
    z = np.arctan2(y, x) + 1j * np.arctan2(height, np.hypot(x, y) - 2.0)
    assert (disk.areas(z) > 0.0).all()
    rim = disk.rim()[2]
    moved = int(np.abs(z - 0.01).argmin())
    folded = z.copy()
    folded[moved] += 1.5 * np.abs(z[disk.F[(disk.F == moved).any(axis=1)]] - z[moved]).max()
    assert (disk.areas(folded) < 0.0).any()
    mended = limbs._unfolded(disk, folded, rim)
    assert (disk.areas(mended) > 0.0).all()
    assert np.array_equal(mended[rim], z[rim])
    assert np.array_equal(limbs._unfolded(disk, z, rim), z)


def test_faces_with_hardly_any_room_are_no_reason_to_refuse(monkeypatch):
    surface = limb(40)
    conformal = sm.conformal_map(surface)
    chart = _core.area.SurfaceChart(surface.topology, conformal.forms)
    noise = 0.05 * np.random.default_rng(1).normal(size=conformal.turns.shape)
    folded = dataclasses.replace(conformal, turns=conformal.turns + noise)
    least = _core.area.turn_areas(chart, unfolded_turns(surface, folded)).min()
    monkeypatch.setattr(flat, "_LEAST_AREA", 1.01 * least)
    monkeypatch.setattr(flat, "_weighted_turns", lambda *given: None)
    assert (_core.area.turn_areas(chart, unfolded_turns(surface, folded)) > 0.0).all()


def test_a_limb_beyond_the_reach_of_numbers_is_refused_with_the_remedy():
    with pytest.raises(SolverError, match="cut the limb short") as refused:
        sm.area_map(limb(250))
    assert len(refused.value.ids) > 0


def test_a_stretch_solve_that_breaks_down_ends_there(monkeypatch):
    class Breaks:
        def __init__(self, *arguments):
            self.sem, self.taken = _core.area.SurfaceSem(*arguments), 0

        def step(self):
            self.taken += 1
            if self.taken == 2:
                raise SolverError("the matrix is not positive definite", ())
            return self.sem.step()

        def measures(self):
            return self.sem.measures()

        @property
        def turns(self):
            return self.sem.turns

    class Core:
        area = type("area", (), {**vars(_core.area), "SurfaceSem": Breaks})
        forms = _core.forms

    monkeypatch.setattr("stretchmap.area.sem._core", Core)
    result = sm.area_map(sm.samples.bumpy_torus(1000).surface)
    assert [h.iteration for h in result.history if h.stage == "sem"] == [0, 1]
    assert result.certificate.certified


@pytest.mark.parametrize(("n_tets", "rings"), [(1000, 24)])
def test_areas_give_way_where_they_would_fold_faces(monkeypatch, n_tets, rings):
    """Three edges round a branch: between two of them, spread over the torus, all is cut off."""
    surface = with_branch(sm.samples.bumpy_torus(n_tets), rings, 0.5).surface
    found = sm.area_map(surface, refine=False)
    assert found.certificate.certified and not found.converged
    assert "faces folded where areas alone counted" in found.stop_reason
    assert found.distortion.element_std < 0.5
    finer = sm.area_map(surface)
    assert finer.certificate.certified
    assert finer.distortion.element_std < 0.9 * found.distortion.element_std
    monkeypatch.setattr("stretchmap.area.finest.SHAPES", ())
    with pytest.raises(CertificationError, match="folded"):
        sm.area_map(surface, refine=False)


def _steps_taken(monkeypatch, lengths, share) -> int:
    """Of 100, with steps of these lengths over and over, each leaving that share of the folds."""
    flips = (int(1e6 * share**k) for k in itertools.count())
    monkeypatch.setattr(finish, "_record", lambda *_: SimpleNamespace(flips=next(flips)))
    given = itertools.cycle(lengths)
    newton = SimpleNamespace(
        least_facing=lambda: -0.1,
        step=lambda _: SimpleNamespace(step=next(given)),
        measures=lambda: None,
    )
    return len(finish.unfold_faces(newton, 100, None))


@pytest.mark.parametrize(("lengths", "taken"), [((1e-4,), 10), ((1e-4,) * 9 + (0.5,), 100)])
def test_unfolding_that_is_jammed_ends(monkeypatch, lengths, taken):
    """Ten steps in a row that hardly move show that no other will; a longer one shows it moves."""
    assert _steps_taken(monkeypatch, lengths, 0.9) == taken


@pytest.mark.parametrize(("share", "taken"), [(0.9, 100), (0.99, 11), (1.0, 11), (1.1, 11)])
def test_unfolding_that_leaves_as_many_folded_ends(monkeypatch, share, taken):
    assert _steps_taken(monkeypatch, (0.5,), share) == taken


@pytest.mark.parametrize(("n_faces", "taken"), [(1000, 6), (80_000, 6), (100_000, 11)])
def test_the_last_few_folded_faces_of_many_get_more_steps(monkeypatch, n_faces, taken):
    """Forty-five of a thousand are not the last few, of a hundred thousand they are."""
    monkeypatch.setattr(finish, "_record", lambda *_: SimpleNamespace(flips=45))
    newton = SimpleNamespace(
        angles=np.empty((n_faces // 2, 2)),
        least_facing=lambda: -0.1,
        step=lambda _: SimpleNamespace(step=0.5, before=1.0, after=0.99),
        measures=lambda: None,
    )
    assert len(finish.unfold_faces(newton, 100, None, finish.Pace())) == taken
