"""Partitions against the closed forms of the standard solid torus and exact invariants."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from shapes import a_map
from stretchmap import _core, samples
from stretchmap.base import options
from stretchmap.errors import ArrayError, CertificationError, OptionError, SolverError
from stretchmap.partitions.parts import partition

RNG = np.random.default_rng(3)


@pytest.fixture(scope="module")
def standard():
    solid = samples.solid_torus(20_000, R=3.0, r=1.0)
    return a_map(solid, solid.V, sm.Torus(3.0, 1.0))


@pytest.fixture(scope="module")
def bumpy_map():
    return sm.volume_map(samples.bumpy_torus(6000))


def check(result, parts):
    """Exact invariants of every partition."""
    solid = parts.solid
    total = result.mesh.volume
    assert solid.tet_volumes.min() > 0.0
    assert np.array_equal(solid.V[: result.mesh.n_vertices], result.mesh.V)
    assert parts.volumes.sum() == pytest.approx(total, rel=1e-13)
    children = np.bincount(parts.parent_tet, solid.tet_volumes)
    assert np.allclose(children, result.mesh.tet_volumes, rtol=1e-9, atol=1e-12 * total)
    assert solid.surface.volume == pytest.approx(total, rel=1e-12)
    assert not solid.diagnose().defects
    assert not len(_core.certificate.not_positive_tets(parts.image, solid.T))
    for i in range(parts.n_parts):
        part = parts.part(i)
        closed = part.surface
        assert len(closed.diagnose().border_edges) == 0
        assert closed.volume == pytest.approx(parts.volumes[i], rel=1e-12)


@pytest.mark.parametrize("by", ["s", "u", "v"])
def test_fifths_are_exact(bumpy_map, by):
    parts = partition(bumpy_map, 5, by)
    check(bumpy_map, parts)
    assert np.abs(parts.errors).max() < 1e-12
    raw = partition(bumpy_map, 5, by, correct=False)
    check(bumpy_map, raw)
    assert np.allclose(raw.errors, parts.uncorrected_errors, atol=1e-12)
    assert 0.0 < np.abs(raw.errors).max() < 0.05
    expected = np.cumsum(raw.volumes)[:-1] / (np.arange(1, 5) / 5 * bumpy_map.mesh.volume) - 1
    assert np.allclose(parts.cumulative_errors, expected, atol=1e-12)


@pytest.mark.parametrize("by", ["s", "u", "v"])
def test_unequal_shares_and_another_start(bumpy_map, by):
    shares = [0.55, 0.05, 0.3, 0.1]
    parts = partition(bumpy_map, shares, by, start=0.0 if by == "s" else 1.0)
    check(bumpy_map, parts)
    assert np.allclose(parts.volumes / bumpy_map.mesh.volume, shares, rtol=1e-12)


@pytest.mark.parametrize("by", ["u", "v"])
@pytest.mark.parametrize("start", [0.0, np.pi / 4])
def test_halves_and_levels_through_vertices(standard, by, start):
    """The structured mesh has vertices exactly on these sheets."""
    parts = partition(standard, 2, by, start=start)
    check(standard, parts)
    assert np.abs(parts.errors).max() < 1e-12


def test_sectors_of_the_standard_torus_are_where_they_should_be(standard):
    parts = partition(standard, 4, "u")
    assert np.allclose(parts.levels[0], np.arange(4) * np.pi / 2, atol=1e-6)
    centers = parts.image[parts.solid.T].mean(axis=1)
    u = np.arctan2(centers[:, 1], centers[:, 0]) % (2 * np.pi)
    assert np.array_equal(parts.labels, np.floor(u / (np.pi / 2)).astype(int))


def test_shells_of_the_standard_torus():
    """2 pi^2 R s^2 lies within s: the share is s^2 / r^2 up to the polyhedron's error."""
    torus, offsets = sm.Torus(3.0, 1.0), []
    for count in (6000, 48_000):
        solid = samples.solid_torus(count, R=3.0, r=1.0)
        parts = partition(a_map(solid, solid.V, torus), [0.25, 0.75], "s")
        offsets.append(abs(parts.levels[0][0] - 0.25))
        shell = parts.interface(0, 1)
        assert shell.genus == 1
        assert shell.volume == pytest.approx(parts.volumes[0], rel=1e-12)
    s = torus.coordinates(shell.V)[2]
    assert offsets[1] < 0.4 * offsets[0] < 0.02
    assert s.mean() == pytest.approx(0.5, abs=0.01) and s.std() < 0.02


def test_sectors_around_the_tube_follow_the_closed_form(standard):
    """Volume up to v: 2 pi (R r^2 v / 2 + r^3 sin(v) / 3)."""
    parts = partition(standard, 3, "v")
    v = parts.levels[0][1:]
    share = (1.5 * v + np.sin(v) / 3.0) / (3.0 * np.pi)
    assert np.allclose(share, [1 / 3, 2 / 3], atol=2e-3)


@pytest.mark.parametrize(
    ("fractions", "by"),
    [
        ((3, [0.5, 0.5], 2), ("u", "s", "v")),
        ((2, 3), ("s", "v")),
        ((4, [0.2, 0.5, 0.3]), ("v", "u")),
    ],
)
def test_every_cell_of_a_grid_has_its_volume(bumpy_map, fractions, by):
    parts = partition(bumpy_map, fractions, by)
    check(bumpy_map, parts)
    assert np.abs(parts.errors).max() < 1e-12 < np.abs(parts.uncorrected_errors).max()
    assert np.abs(parts.uncorrected_errors).max() < 0.2
    counts = [len(f) if isinstance(f, list) else f for f in fractions]
    for i, (axis, levels) in enumerate(zip(by, parts.levels, strict=True)):
        assert levels.shape == (*counts[:i], counts[i] - (axis == "s"))


def test_a_part_too_small_for_its_volume_to_be_exact_is_refused(bumpy_map):
    with pytest.raises(SolverError, match="part 0") as refused:
        partition(bumpy_map, [1e-13, 1.0 - 1e-13], "u")
    assert 0 in refused.value.ids
    raw = partition(bumpy_map, [1e-13, 1.0 - 1e-13], "u", correct=False)
    assert raw.solid.tet_volumes.min() >= 0.0


def test_uncorrected_cells_are_those_of_the_image(bumpy_map):
    raw = partition(bumpy_map, (3, 2), ("u", "s"), correct=False)
    assert np.array_equal(raw.errors, raw.uncorrected_errors)
    corrected = partition(bumpy_map, (3, 2), ("u", "s"))
    assert np.allclose(raw.uncorrected_errors, corrected.uncorrected_errors, rtol=0.0, atol=1e-13)


@pytest.fixture(scope="module")
def coarse_map():
    """Of a symmetric solid, whose sheets pass closely by whole rows of vertices."""
    return sm.volume_map(samples.solid_torus(1500))


@pytest.fixture(scope="module")
def rough_map():
    return sm.volume_map(samples.bumpy_torus(1000))


def flatness(solid):
    """(k,) six times the volume by the cube of the longest edge."""
    corners = solid.V[solid.T]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1).max(axis=(1, 2))
    return 6.0 * solid.tet_volumes / longest**3


@pytest.mark.parametrize(
    ("fractions", "by", "least", "share"),
    [
        (4, "v", 1e-3, 0.0),
        (40, "u", 3e-4, 0.0),
        ((4, 4, 3), ("u", "v", "s"), 1e-10, 0.01),
        ((3, 3), ("v", "u"), 1e-10, 0.05),
        ([1e-6, 1.0 - 1e-6], "v", 1e-11, 1.0),
        ([1e-6, 1.0 - 1e-6], "u", 1e-11, 1.0),
    ],
)
def test_cuts_go_through_vertices_that_are_near(coarse_map, fractions, by, least, share):
    """No tet without volume, and few that are thinner than the parts make them."""
    parts = partition(coarse_map, fractions, by)
    check(coarse_map, parts)
    found = flatness(parts.solid)
    assert found.min() > least and (found < 1e-4).mean() <= share


def test_parts_can_be_filled_and_measured(coarse_map, rough_map):
    part = partition(coarse_map, (4, 4, 3), by=("u", "v", "s")).part(0)
    assert sm.fill(part, part.surface.V).certificate.certified
    thin = partition(rough_map, [1e-6, 1.0 - 1e-6], "v")
    assert sm.distortion(thin.solid, thin.image).flips == 0


def test_a_solid_far_from_the_origin_is_cut_alike(coarse_map):
    solid = coarse_map.mesh
    far = sm.TetMesh(solid.V + np.array([5e5, 5e6, 100.0]), solid.T)
    for by in ("s", "v"):
        here = partition(coarse_map, 3, by)
        there = partition(a_map(far, coarse_map.image, coarse_map.torus), 3, by)
        assert there.solid.n_tets == here.solid.n_tets
        assert np.allclose(there.levels[0], here.levels[0], atol=1e-7)
        assert np.abs(there.errors).max() < 1e-9 and there.solid.tet_volumes.min() > 0.0


def test_a_folded_map_is_refused(coarse_map):
    image = coarse_map.image.copy()
    image[5] += 2.0
    with pytest.raises(CertificationError, match="no positive volume") as refused:
        partition(a_map(coarse_map.mesh, image, coarse_map.torus), 2)
    assert len(refused.value.ids)


def test_thin_parts_lose_nothing_to_the_sums_of_others(rough_map):
    shells = [0.28, 0.57, 0.1495, 0.0005]
    parts = partition(rough_map, (shells, 3), ("s", "u"), start=-2.0)
    assert np.abs(parts.errors).max() < 1e-12


def test_the_last_of_hundreds_of_parts_has_no_more_than_its_own_rounding(rough_map):
    parts = partition(rough_map, 500, "u")
    assert np.abs(parts.errors).max() < 1e-13


def test_an_interface_is_between_two_parts(coarse_map):
    parts = partition(coarse_map, 3)
    with pytest.raises(OptionError, match="twice"):
        parts.interface(1, 1)
    assert len(parts.surface(1).diagnose().inside_out) == parts.interface(1, 0).n_faces


def test_pieces_grow_with_the_number_of_parts(rough_map, monkeypatch):
    """Each tet is cut by all its levels at once, into slabs of a few pieces."""
    for by in ("s", "v"):
        few, many = (sm.partition(rough_map, n, by).solid.n_tets for n in (10, 40))
        assert many < 4.3 * few
    monkeypatch.setattr(options, "installed_memory", lambda: 1e6)
    with pytest.raises(OptionError, match="so many parts of pieces"):
        sm.partition(rough_map, 20)


def test_cutting_one_tet_gives_the_share_of_the_formula():
    """Along several levels, some of them through vertices, and along sheets through others."""
    T = np.array([[0, 1, 2, 3]], np.int32)
    V = np.vstack([np.zeros(3), np.eye(3)])
    for trial in range(600):
        values = 5.0 * RNG.random(4)
        on = RNG.random(4) < 0.2 * (trial % 3)
        values[on] = np.round(values[on])
        places = np.where(values == np.round(values), 2 * values + 1, 2 * np.floor(values) + 2)
        places[RNG.permutation(4)[: trial // 200]] = _core.partitions.EVERYWHERE
        split = _core.partitions.split_tets(T, 4, places[None].astype(np.int32), 100)
        a, b = split.cut_edges.T
        w = ((split.cut_level - values[a]) / (values[b] - values[a]))[:, None]
        points = np.concatenate([V, (1 - w) * V[a] + w * V[b]])
        volumes = _core.mesh.tet_volumes(points, split.tets)
        assert volumes.min() > 0.0 and volumes.sum() == pytest.approx(1 / 6, rel=1e-12)
        assert len(volumes) <= 6 * len(np.unique(split.slab))
        for level in range(6 if trial < 200 else 0):
            below = volumes[split.slab <= level].sum()
            expected = _core.partitions.volume_below(T, np.array([1 / 6]), values - level)
            assert below == pytest.approx(expected, abs=1e-13)
            share = _core.partitions.shares_below((values - level)[None])
            assert share[0] == pytest.approx(6.0 * expected, abs=1e-13)


def test_saving(bumpy_map, tmp_path):
    parts = partition(bumpy_map, 3)
    parts.save(tmp_path / "parts.vtu")
    again = sm.read(tmp_path / "parts.vtu")
    assert np.array_equal(again.T, parts.solid.T)
    assert "part 2" in parts.summary() and parts.to_dict()["by"] == ["s"]


@pytest.mark.parametrize(
    "options",
    [
        {"fractions": 1},
        {"fractions": 10**9},
        {"fractions": (10**5, 10**5), "by": ("u", "s")},
        {"fractions": [0.5, 0.6]},
        {"fractions": [1.5, -0.5]},
        {"fractions": [[0.5], [0.5]]},
        {"by": "x"},
        {"by": ("u", "u"), "fractions": (2, 2)},
        {"by": ("u", "s"), "fractions": (2,)},
        {"start": np.inf},
        {"start": 1.0, "by": "s"},
    ],
)
def test_bad_options_are_named(bumpy_map, options):
    with pytest.raises(OptionError):
        partition(bumpy_map, **options)


def test_maps_without_torus_or_of_surfaces_are_refused(bumpy_map):
    with pytest.raises(OptionError):
        partition(a_map(bumpy_map.mesh, bumpy_map.image))
    with pytest.raises(ArrayError):
        partition(sm.area_map(bumpy_map.mesh.surface))
    with pytest.raises(OptionError):
        partition(bumpy_map, 2).part(2)
