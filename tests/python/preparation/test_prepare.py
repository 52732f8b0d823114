"""Raw surfaces and voxel masks become solid tori, and what was done is said."""

from __future__ import annotations

import importlib.util
import json
import sys
import warnings

import numpy as np
import pytest

pytest.importorskip("gpytoolbox", reason="remeshing needs gpytoolbox")
pytest.importorskip("skimage", reason="masks need scikit-image")
pytest.importorskip("tetgen", reason="filling needs tetgen")

import ct_like
import stretchmap as sm
from stretchmap import samples
from stretchmap.cli import main
from stretchmap.errors import (
    ArrayError,
    ConnectivityError,
    DegenerateError,
    FileFormatError,
    GenusError,
    KindError,
    MissingDependencyError,
    OptionError,
    SelfIntersectionError,
)
from stretchmap.preparation import wild
from stretchmap.preparation.even import even
from stretchmap.preparation.handles import cut_handles
from stretchmap.preparation.holes import close_holes, crossings, remove_crossings
from stretchmap.preparation.rebuild import winding_mask
from stretchmap.preparation.soup import keep_largest, part_sheets, weld, weld_borders
from stretchmap.preparation.voxels import mask_surface, read_mask

RAW = ct_like.Damage(holes=4, islands=5, inside_out=True, exploded=True)


def raw(seed: int, genus: int, damage: ct_like.Damage, shape: str = "tube"):
    return ct_like.damaged(*ct_like.surface(ct_like.mask(seed, shape, genus, 48)), damage, seed)


def steps(done: sm.Preparation) -> dict[str, dict[str, float]]:
    return {step.name: dict(step.counts) for step in done.steps}


@pytest.mark.parametrize(("shape", "seed"), [("tube", 11), ("vertebra", 12)])
def test_a_raw_surface_becomes_a_solid_that_maps(shape, seed):
    V, F = raw(seed, 3, RAW, shape)
    done = sm.prepare(sm.TriMesh(V, F), faces=2_000)
    done.solid.require_solid_torus()
    assert len(done.cuts) >= 1
    counts = steps(done)
    assert counts["debris"]["dropped"] >= 5
    assert counts["holes"]["holes"] >= 1
    assert counts["weld"]["welded"] > 1000
    assert 1_500 < done.surface.n_faces < 2_500
    assert sm.volume_map(done.solid).certificate.certified


def test_the_shape_is_kept():
    torus = samples.torus_surface(80, 40)
    done = sm.prepare(torus, faces=3_000)
    assert done.cuts == ()
    assert done.solid.volume == pytest.approx(torus.volume, rel=0.02)
    assert not any(step.changed for step in done.steps[:-2] if step.name != "handles")


def test_a_handle_is_cut_at_the_loop_reported():
    """The double torus has two handles of one size: one goes, where the cut says it was."""
    surface = samples.double_torus(6)
    whole, cuts = cut_handles(surface, 1, 0.7)
    assert (surface.genus, whole.genus, len(cuts)) == (2, 1, 1)
    assert not len(crossings(whole))
    away = np.linalg.norm(surface.V - cuts[0].center, axis=1).min()
    assert away < cuts[0].length
    gone = np.linalg.norm(whole.V - cuts[0].center, axis=1).min()
    assert np.isfinite(gone) and cuts[0].share == pytest.approx(cuts[0].length / surface.area**0.5)


def test_a_bridge_and_a_tunnel_are_told_apart():
    """A bar bent round to the body is cut, a hole drilled through the body is filled."""
    box = np.zeros((40, 30, 24), bool)
    box[4:36, 4:20, 4:20] = True
    box[14:26, 8:16, :] = False  # the hole that stays
    drilled = box.copy()
    drilled[7:9, 11:13, :] = False
    bridged = box.copy()
    for bar in (np.s_[5:7, 20:25, 10:13], np.s_[11:13, 20:25, 10:13], np.s_[5:13, 23:25, 10:13]):
        bridged[bar] = True
    for mask, kind in ((drilled, "tunnel"), (bridged, "handle")):
        done = sm.prepare(mask, faces=2_000)
        assert [cut.kind for cut in done.cuts] == [kind]


def test_what_is_cut_off_is_told_where_it_is_cut(caplog):
    surface = samples.double_torus(4)
    done = sm.prepare(surface, faces=600, max_cut=0.9)
    counts = {step.name: step.counts for step in done.steps}
    cut, lost = (
        counts["handles"]["percent_of_volume_removed"],
        counts["fill"]["percent_of_volume_lost"],
    )
    left = 100.0 * done.solid.volume / surface.volume
    assert 10.0 < cut < 20.0 and lost < 10.0 and left == pytest.approx(100.0 - cut - lost, abs=2.0)
    assert "cutting handles has removed" in caplog.text and "thinner" not in caplog.text


def test_handles_longer_than_the_limit_are_part_of_the_shape():
    with pytest.raises(GenusError, match="max_cut"):
        cut_handles(samples.double_torus(6), 1, 0.05)
    with pytest.raises(GenusError, match="a hole is missing"):
        sm.prepare(samples.sphere(20), faces=500)


def test_other_genera_can_be_asked_for():
    done = sm.prepare(samples.double_torus(6), faces=3_000, genus=2)
    assert (done.genus, done.surface.genus, done.cuts) == (2, 2, ())


def test_two_large_pieces_are_refused():
    torus = samples.torus_surface(20, 10)
    V = np.vstack([torus.V, torus.V + 10.0])
    F = np.vstack([torus.F, torus.F + torus.n_vertices])
    with pytest.raises(ConnectivityError, match="two large pieces") as caught:
        sm.prepare(sm.TriMesh(V, F), faces=500)
    assert len(caught.value.ids) == torus.n_faces


def test_a_large_cavity_is_no_second_piece():
    torus = samples.torus_surface(40, 20)
    axis = torus.V * [1, 1, 0]
    axis *= 1.0 / np.linalg.norm(axis, axis=1, keepdims=True)
    radius = np.hypot(torus.V[:, 0], torus.V[:, 1])
    core = axis * (0.5 * (radius.max() + radius.min()))
    inner = core + 0.8 * (torus.V - core)
    V, F = np.vstack([torus.V, inner]), np.vstack([torus.F, torus.F[:, ::-1] + torus.n_vertices])
    _, kept, counts = keep_largest(V, np.ascontiguousarray(F))
    assert (len(kept), counts["dropped"]) == (torus.n_faces, 1)


def test_weld_joins_what_is_close_and_drops_what_collapses():
    torus = samples.torus_surface(20, 10)
    V = torus.V[torus.F].reshape(-1, 3) + 1e-9 * np.random.default_rng(0).random((600 * 2, 3))
    F = np.arange(len(V), dtype=np.int32).reshape(-1, 3)
    V, F, counts = weld(V, np.vstack([F, F[:1], [[0, 0, 1]]]), 1e-6)
    assert (len(V), len(F)) == (torus.n_vertices, torus.n_faces)
    assert (counts["collapsed"], counts["copies"]) == (1, 1)


def exploded(noise: float) -> tuple[np.ndarray, np.ndarray]:
    """A torus, edges from 0.36 to 1.1 long, every triangle with corners of its own."""
    torus = samples.torus_surface(24, 16)
    V = torus.V[torus.F].reshape(-1, 3)
    V = V + noise * np.random.default_rng(0).normal(size=V.shape)
    return V, np.arange(len(V), dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("noise", [1e-6, 1e-4, 3e-3])
def test_corners_that_noise_moved_apart_are_welded(noise):
    V, F, counts = weld_borders(*exploded(noise), 1e-7)
    torus = samples.torus_surface(24, 16)
    assert (len(V), len(F)) == (torus.n_vertices, torus.n_faces)
    assert noise < counts["tolerance"] < 20.0 * noise
    assert (counts["welded"], counts["collapsed"]) == (3 * len(F) - len(V), 0)
    sm.TriMesh(V, F).require_closed()


def test_corners_too_far_apart_are_refused():
    with pytest.raises(ConnectivityError, match="2304 of 2304 edges belong to one face only"):
        sm.prepare(sm.TriMesh(*exploded(0.1)), faces=500)


def test_borders_are_welded_no_farther_than_needed():
    """A crack is closed, a hole stays one, sheets next to each other stay apart."""
    torus = samples.torus_surface(24, 16)
    V = np.vstack([torus.V, torus.V[:40] + 1e-4])
    F = torus.F.copy()
    low = (F < 40).all(axis=1)
    F[low] += torus.n_vertices
    W, G, counts = weld_borders(V, F, 1e-7)
    assert (len(W), len(G)) == (torus.n_vertices, torus.n_faces) and counts["tolerance"] < 1e-3
    _, G, counts = weld_borders(torus.V, torus.F[3:], 1e-7)
    assert len(G) == torus.n_faces - 3 and "tolerance" not in counts
    inner = torus.V * (1.0 - 1e-5)
    W, _, counts = weld_borders(
        np.vstack([torus.V, inner]), np.vstack([torus.F, torus.F + len(inner)]), 1e-7
    )
    assert len(W) == 2 * len(inner) and not any(counts.values())


def test_sheets_that_touch_are_parted():
    """Two tori with one vertex, then with one edge, in common."""
    torus = samples.torus_surface(20, 10)
    for shared in (torus.F[0, :1], torus.F[0, :2]):
        F = torus.F + torus.n_vertices
        for i in shared:
            F[F == i + torus.n_vertices] = i
        F = np.vstack([torus.F, F]).astype(np.int32)
        V = np.vstack([torus.V, torus.V + 5.0])
        W, G, counts = part_sheets(V, F)
        assert counts["parted"] == len(shared)
        assert sm.TriMesh(W, G).n_components == 2
        assert not [d for d in sm.TriMesh(W, G).diagnose().defects if "manifold" in d.name]


def test_faces_turned_at_random_are_oriented():
    torus = samples.torus_surface(20, 10)
    turned = np.random.default_rng(1).random(torus.n_faces) < 0.4
    F = np.where(turned[:, None], torus.F[:, ::-1], torus.F)
    V, F, _ = part_sheets(torus.V, np.ascontiguousarray(F, np.int32))
    sm.TriMesh(V, F).require_genus_one()


@pytest.mark.parametrize("rings", [1, 3, 12])
def test_holes_of_all_sizes_are_closed(rings):
    """Of one face, of many, and a border longer than is filled in one piece."""
    torus = samples.torus_surface(400, 40) if rings == 12 else samples.torus_surface(40, 20)
    middle = torus.V[torus.F].mean(axis=1)
    order = np.argsort(np.linalg.norm(middle - middle[0], axis=1))
    gone = order[: 1 + 6 * rings**2] if rings < 12 else np.flatnonzero(middle[:, 2] > 0.8)
    V, F, _ = part_sheets(torus.V, np.delete(torus.F, gone, axis=0))
    V, F, counts = close_holes(V, F)
    closed = sm.TriMesh(V, F)
    assert closed.diagnose().border_edges.size == 0
    assert closed.n_components == 1 and counts["faces"] >= counts["longest"] - 2
    assert closed.volume > 0


def test_crossings_are_cut_out():
    """A dent pushed through to the other side of the tube."""
    torus = samples.torus_surface(60, 30)
    V = torus.V.copy()
    top = np.argmax(V[:, 0] + V[:, 2])
    near = np.linalg.norm(V - V[top], axis=1) < 0.3 * np.ptp(V[:, 2])
    V[near, 2] -= 1.3 * np.ptp(V[:, 2])
    bent = sm.TriMesh(V, torus.F)
    assert len(crossings(bent))
    sound, counts = remove_crossings(bent)
    assert not len(crossings(sound)) and counts["crossing"] > 0
    sound.require_closed()


def test_crossings_that_cannot_be_cut_out_are_refused():
    torus = samples.torus_surface(12, 8)
    V = np.random.default_rng(0).random(torus.V.shape)
    with pytest.raises(SelfIntersectionError, match="crosses itself") as caught:
        remove_crossings(sm.TriMesh(V, torus.F))
    assert caught.value.ids


def test_a_mask_is_cleaned_and_placed():
    mask = np.zeros((30, 30, 12), bool)
    mask[5:25, 5:25, 3:9] = True
    mask[11:19, 11:19, :] = False
    mask[6:9, 6:9, 5:7] = False  # a cavity
    mask[0, 0, 0] = True  # an island
    V, F, counts = mask_surface(mask, np.diag([0.5, 1.0, 2.0, 1.0]))
    assert counts["island_voxels_dropped"] == 1 and counts["cavity_voxels_filled"] == 18
    surface = sm.TriMesh(V, F, orient=True)
    surface.require_genus_one()
    np.testing.assert_allclose(V.min(axis=0), [2.25, 4.5, 5.0], atol=0.1)
    np.testing.assert_allclose(V.max(axis=0), [12.25, 24.5, 17.0], atol=0.1)
    assert surface.volume == pytest.approx(2 * (20 * 20 - 64) * 6 * 0.5, rel=0.06)  # rounded edges


@pytest.mark.parametrize(
    ("mask", "error"),
    [
        (np.zeros((4, 4, 4), bool), ArrayError),
        (np.zeros((4, 4), bool), ArrayError),
        (np.ones((4, 4, 4)), ArrayError),
    ],
)
def test_what_is_no_mask_is_refused(mask, error):
    with pytest.raises(error, match="mask"):
        sm.prepare(mask)


@pytest.mark.parametrize(
    "bad",
    [{"faces": 10}, {"faces": 1e4}, {"genus": -1}, {"max_cut": float("nan")}],
)
def test_options_out_of_range(bad):
    with pytest.raises(OptionError, match=next(iter(bad))):
        sm.prepare(samples.torus_surface(20, 10), **bad)
    with pytest.raises(OptionError, match="spacing"):
        sm.prepare(np.ones((4, 4, 4), bool), spacing=(1.0, 0.0, 1.0))
    with pytest.raises(KindError):
        sm.prepare("raw.stl")


@pytest.mark.parametrize("installed", [True, False])
def test_ftetwild_fills_where_it_is_wanted_or_alone(installed, monkeypatch):
    pytest.importorskip("pytetwild")
    torus = samples.torus_surface(40, 20)
    if installed:
        done = sm.prepare(torus, faces=1_000, filler="ftetwild")
    else:
        find = importlib.util.find_spec
        monkeypatch.setattr(
            importlib.util, "find_spec", lambda n: None if n == "tetgen" else find(n)
        )
        done = sm.prepare(torus, faces=1_000)
        with pytest.raises(MissingDependencyError, match="pytetwild"):
            sm.prepare(torus, faces=1_000, filler="tetgen")
    assert steps(done)["fill"]["tets_by_ftetwild"] == done.solid.n_tets
    done.solid.require_solid_torus()
    assert done.solid.volume == pytest.approx(torus.volume, rel=0.04)  # 1,000 faces: 0.02
    assert sm.volume_map(done.solid).certificate.certified


def test_ftetwild_leaves_no_files_where_it_is_called(tmp_path, monkeypatch):
    pytest.importorskip("pytetwild")
    monkeypatch.chdir(tmp_path)
    sm.prepare(samples.torus_surface(40, 20), faces=800, filler="ftetwild")
    assert not list(tmp_path.iterdir())


def test_what_ftetwild_needs_is_named(monkeypatch):
    pytest.importorskip("pytetwild")
    monkeypatch.setattr(wild, "_SCRIPT", "import pyvista_that_is_not_there")
    with pytest.raises(MissingDependencyError, match=r"pyvista_that_is_not_there.*\[prepare\]"):
        sm.prepare(samples.torus_surface(40, 20), faces=800, filler="ftetwild")


@pytest.mark.parametrize("seed", [3, 4])
def test_a_surface_that_crosses_itself_all_over_is_rebuilt(seed):
    """A torus whose points are off by more than its edges: cutting out what crosses is no help."""
    torus = samples.torus_surface(120, 60)
    noise = np.random.default_rng(seed).normal(size=torus.V.shape)
    rough = sm.TriMesh(torus.V + 0.1 * noise, torus.F)
    with pytest.raises(SelfIntersectionError):
        remove_crossings(rough)
    done = sm.prepare(rough, faces=2_000)
    assert steps(done)["crossings"]["faces_rebuilt"] > 0
    done.solid.require_solid_torus()
    assert not len(crossings(done.surface))
    assert done.solid.volume == pytest.approx(torus.volume, rel=0.1)


def test_the_winding_number_of_voxels():
    upright = samples.torus_surface(60, 30)
    V, F, n = upright.V @ _turned(), upright.F, upright.n_vertices
    mask, corner = winding_mask(V, F, 0.1)
    assert mask.sum() * 0.1**3 == pytest.approx(upright.volume, rel=0.01)
    x, y, z = ((np.argwhere(mask) * 0.1 + corner) @ _turned().T).T
    assert np.hypot(np.hypot(x, y) - 3.0, z).max() < 1.01
    both, _ = winding_mask(np.vstack([V, V + 0.3]), np.vstack([F, F + n]), 0.1)
    assert mask.sum() < both.sum() < 2 * mask.sum()
    assert not winding_mask(V, np.ascontiguousarray(F[:, ::-1]), 0.1)[0].any()


def _turned() -> np.ndarray:
    return np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


@pytest.mark.parametrize("error", [SelfIntersectionError, ConnectivityError])
def test_what_cannot_be_remeshed_is_filled_all_the_same(monkeypatch, error):
    """Also where cutting out what crosses leaves two pieces: thin rods between lumps."""
    pytest.importorskip("pytetwild")
    torus = samples.torus_surface(40, 20)
    folded = torus.V.copy()
    folded[::7] += 0.5 * np.random.default_rng(0).normal(size=folded[::7].shape)
    crossing = sm.TriMesh(folded, torus.F)
    assert len(crossings(crossing))

    def fails(surface, faces, iterations=10):
        return crossing

    monkeypatch.setattr("stretchmap.preparation.pipeline.even", fails)
    monkeypatch.setattr(
        "stretchmap.preparation.pipeline.remove_crossings",
        lambda surface: (
            (_ for _ in ()).throw(error("no", []))
            if surface is crossing
            else remove_crossings(surface)
        ),
    )
    done = sm.prepare(torus, faces=1_000)
    assert steps(done)["remesh"] == {"given_up": 1}
    done.solid.require_solid_torus()
    with pytest.raises(SelfIntersectionError, match="ask for more"):
        sm.prepare(torus, faces=1_000, filler="tetgen")


def test_progress_names_every_step():
    seen = []
    sm.prepare(
        samples.double_torus(6),
        faces=800,
        max_cut=0.7,
        progress=lambda stage, done, total, **values: seen.append(stage),
    )
    assert list(dict.fromkeys(seen)) == [
        "weld", "orient", "debris", "holes", "crossings", "handles", "remesh", "fill",
    ]  # fmt: skip


def test_a_large_surface_is_coarsened_before_loops_are_looked_for():
    torus = samples.torus_surface(300, 150)
    done = sm.prepare(torus, faces=1_000)
    assert steps(done)["coarsen"]["faces_before"] == 90_000
    done.solid.require_solid_torus()


def test_the_command(tmp_path, capsys):
    V, F = raw(21, 2, RAW)
    sm.write(tmp_path / "raw.stl", sm.TriMesh(V, F))
    report = tmp_path / "report.json"
    arguments = ["prepare", str(tmp_path / "raw.stl"), "-o", str(tmp_path / "solid.npz")]
    assert main([*arguments, "--faces", "1500", "--json", str(report)]) == 0
    assert "boundary faces, genus 1" in capsys.readouterr().out
    sm.read(tmp_path / "solid.npz").require_solid_torus()
    told = json.loads(report.read_text())
    assert {step["name"] for step in told["steps"]} >= {"weld", "handles", "fill"}
    assert all(cut["length"] > 0 and len(cut["center"]) == 3 for cut in told["cuts"])
    assert main([*arguments, "--genus", "7"]) == 2


def test_the_command_takes_masks(tmp_path):
    mask = ct_like.mask(3, "tube", 1, 40)
    np.save(tmp_path / "mask.npy", mask)
    np.savez(tmp_path / "mask.npz", mask=mask, spacing=[0.5, 0.5, 1.0])
    for name, size in (("mask.npy", 1.0), ("mask.npz", 0.5)):
        out = tmp_path / "solid.npz"
        assert main(["prepare", str(tmp_path / name), "-o", str(out), "--faces", "800", "-q"]) == 0
        solid = sm.read(out)
        solid.require_solid_torus()
        assert np.ptp(solid.V[:, 0]) == pytest.approx(
            size * np.ptp(np.argwhere(mask)[:, 0]), rel=0.1
        )


def test_damaged_masks(tmp_path):
    (tmp_path / "a.npy").write_bytes(b"no array")
    np.savez(tmp_path / "b.npz", x=np.zeros(3))
    for name in ("a.npy", "b.npz"):
        with pytest.raises(FileFormatError, match=name):
            read_mask(tmp_path / name)


def test_what_has_no_size_is_refused():
    pytest.importorskip("skimage")
    thin = np.zeros((9, 9, 3), bool)
    thin[1:8, 1:8, 1] = True
    thin[2:7, 2:7, 1] = False
    with pytest.raises(ArrayError, match="thicker than a voxel"):
        sm.prepare(thin)
    with pytest.raises(DegenerateError, match="no face of any size"):
        sm.prepare(sm.TriMesh(np.zeros((3, 3)), [[0, 1, 2]]))


def test_what_the_remesher_imports_of_old_names_is_its_own_affair(tmp_path, monkeypatch):
    source = "import warnings\nwarnings.warn('old', {})\nremesh_botsch = lambda V, F, *_: (V, F)\n"
    surface = samples.torus_surface(12, 6)
    for name, category in (("old", "DeprecationWarning"), ("new", "RuntimeWarning")):
        monkeypatch.delitem(sys.modules, "gpytoolbox")
        monkeypatch.syspath_prepend(tmp_path / name)
        (tmp_path / name).mkdir()
        (tmp_path / name / "gpytoolbox.py").write_text(source.format(category))
        importlib.invalidate_caches()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            if name == "old":
                assert even(surface, 144).n_faces >= 144
            else:
                with pytest.raises(RuntimeWarning):
                    even(surface, 144)
