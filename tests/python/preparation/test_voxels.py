"""Masks of images become surfaces where the images say they are, however these are stored."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.spatial

pytest.importorskip("skimage", reason="masks need scikit-image")

import stretchmap as sm
from stretchmap import samples
from stretchmap.cli import main
from stretchmap.errors import (
    ArrayError,
    ConnectivityError,
    FileFormatError,
    GenusError,
    MeshError,
    OptionError,
    SelfIntersectionError,
)
from stretchmap.preparation.rebuild import rebuilt
from stretchmap.preparation.soup import part_sheets
from stretchmap.preparation.voxels import mask_surface, read_mask

OBLIQUE = np.array(
    [[0.5, 0.1, 0.0, -40.0], [-0.1, 0.7, 0.3, 15.0], [0.2, 0.0, 2.0, 7.0], [0.0, 0.0, 0.0, 1.0]]
)


def lopsided_mask() -> np.ndarray:
    """A ring that is none of its mirror images."""
    mask = np.zeros((16, 14, 8), np.uint8)
    mask[2:14, 2:12, 2:6] = 1
    mask[5:10, 5:9] = 0
    mask[2:5, 2:4, 6] = 1
    return mask


def stored(mask: np.ndarray, affine: np.ndarray, axes: tuple, flips: tuple) -> tuple:
    """The same image with its axes in another order and direction."""
    change = np.eye(4)[:, [*axes, 3]]
    for axis in flips:
        flip = np.eye(4)
        flip[axis, axis], flip[axis, 3] = -1.0, mask.shape[axes[axis]] - 1.0
        change = change @ flip
    return np.flip(mask.transpose(axes), flips), affine @ change


@pytest.mark.parametrize(
    ("axes", "flips"), [((0, 1, 2), (0,)), ((0, 1, 2), (0, 1, 2)), ((2, 0, 1), ()), ((1, 0, 2), ())]
)
def test_a_mask_is_where_its_affine_puts_it_however_it_is_stored(axes, flips):
    mask = lopsided_mask()
    V, F, _ = mask_surface(mask, OBLIQUE)
    inside = np.argwhere(mask) @ OBLIQUE[:3, :3].T + OBLIQUE[:3, 3]
    np.testing.assert_allclose(V.mean(axis=0), inside.mean(axis=0), atol=0.3)
    surface = sm.TriMesh(V, F, orient=True)
    V, F, _ = mask_surface(*stored(mask, OBLIQUE, axes, flips))
    again = sm.TriMesh(V, F, orient=True)
    assert again.volume == pytest.approx(surface.volume, rel=1e-3)
    distances, _ = scipy.spatial.KDTree(V).query(surface.V)
    assert distances.max() < 1e-4  # single precision
    again.require_genus_one()


@pytest.mark.parametrize(
    ("affine", "match"),
    [
        (np.diag([1.0, 1.0, 0.0, 1.0]), "singular"),
        (np.array([[1, 1, 0, 0], [1, 1 + 1e-9, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "singular"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "last row"),
        (np.eye(3), "shape"),
        (np.diag([1.0, np.nan, 1.0, 1.0]), "NaN"),
    ],
)
def test_what_places_no_voxels_is_refused(affine, match):
    with pytest.raises(MeshError, match=match):
        sm.prepare(lopsided_mask(), affine=affine)


def test_a_spacing_beside_an_affine_is_refused():
    with pytest.raises(OptionError, match="one of the two"):
        sm.prepare(lopsided_mask(), affine=OBLIQUE, spacing=(1.0, 1.0, 2.0))
    with pytest.raises(OptionError, match="a surface has none"):
        sm.prepare(samples.torus_surface(20, 10), affine=OBLIQUE)


def test_a_solid_is_where_the_affine_puts_its_mask():
    mask = lopsided_mask()
    mirrored = OBLIQUE @ np.diag([-1.0, 1.0, 1.0, 1.0])
    solid = sm.prepare(mask, faces=600, affine=mirrored).solid
    inside = np.argwhere(mask) @ mirrored[:3, :3].T + mirrored[:3, 3]
    np.testing.assert_allclose(solid.V.mean(axis=0), inside.mean(axis=0), atol=0.5)
    assert (solid.tet_volumes > 0.0).all()


def test_nifti_is_read_with_its_affine(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    mask, path = lopsided_mask(), tmp_path / "mask.nii.gz"
    zooms = np.diag([0.5, 0.7, 2.0, 1.0])
    for affine in (zooms, np.diag([-1.0, 1.0, 1.0, 1.0]), OBLIQUE):
        nibabel.save(nibabel.Nifti1Image(mask, affine), path)
        found, placed = read_mask(path)
        np.testing.assert_array_equal(found, mask)
        np.testing.assert_allclose(placed, affine, rtol=1e-6)
    image = nibabel.Nifti1Image(mask, None)
    image.header.set_zooms((0.5, 0.7, 2.0))
    nibabel.save(image, path)
    np.testing.assert_allclose(read_mask(path)[1], zooms, rtol=1e-6)
    image = nibabel.Nifti1Image(mask, np.eye(4))
    image.set_sform(np.diag([1.0, 1.0, 0.0, 1.0]), 1)
    nibabel.save(image, path)
    with pytest.raises(FileFormatError, match=r"mask\.nii\.gz.*singular"):
        read_mask(path)


def test_one_volume_of_an_image_is_taken_and_more_are_refused(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    path = tmp_path / "mask.nii"
    for data, match in (
        (lopsided_mask()[..., None], ""),
        (np.stack([lopsided_mask()] * 2, axis=-1), r"image\[\.\.\., 0\]"),
        (lopsided_mask()[..., 0], "three axes"),
    ):
        nibabel.save(nibabel.Nifti1Image(data, np.eye(4)), path)
        if match:
            with pytest.raises(FileFormatError, match=match):
                read_mask(path)
        else:
            assert read_mask(path)[0].shape == data.shape[:3]


def test_the_command_refuses_a_spacing_that_contradicts_the_file(tmp_path, capsys):
    np.savez(tmp_path / "mask.npz", mask=lopsided_mask(), spacing=[0.5, 0.5, 1.0])
    arguments = ["prepare", str(tmp_path / "mask.npz"), "-o", str(tmp_path / "solid.npz"), "-q"]
    arguments += ["--faces", "600", "--spacing", "0.5", "0.5"]
    assert main([*arguments, "2"]) == 2
    assert "0.5 0.5 1 apart" in capsys.readouterr().err
    assert main([*arguments, "1"]) == 0


def test_a_mask_of_several_volumes_is_refused():
    several = np.stack([lopsided_mask()] * 2, axis=-1)
    with pytest.raises(ArrayError, match=r"choose one of its volumes"):
        sm.prepare(several)
    V, _, _ = mask_surface(several[..., :1], np.eye(4))
    assert len(V)


def drilled(bit: int) -> np.ndarray:
    mask = np.zeros((14, 12, 7), bool)
    mask[2:12, 2:10, 2:5] = True
    mask[6 : 6 + bit, 5 : 5 + bit] = False
    return mask


def test_a_hole_one_voxel_wide_is_kept_where_it_is_wanted():
    """Smoothing closes it, as it does where none is wanted."""
    V, F, counts = mask_surface(drilled(1), OBLIQUE, 1)
    assert counts["voxels_halved"]
    surface = sm.TriMesh(V, F, orient=True)
    surface.require_genus_one()
    voxel = abs(np.linalg.det(OBLIQUE[:3, :3]))
    assert surface.volume == pytest.approx(drilled(1).sum() * voxel, rel=0.05)
    inside = np.argwhere(drilled(1)) @ OBLIQUE[:3, :3].T + OBLIQUE[:3, 3]
    assert np.allclose(
        np.sort(V, axis=0)[[0, -1]].mean(axis=0),
        np.sort(inside, axis=0)[[0, -1]].mean(axis=0),
        atol=0.1,
    )
    V, F, _ = mask_surface(drilled(1), OBLIQUE)
    assert sm.TriMesh(V, F, orient=True).genus == 0
    assert sm.prepare(drilled(1), faces=1500).solid.surface.genus == 1


def test_a_hole_that_smoothing_closes_all_the_same_is_named():
    mask = drilled(0)
    mask[6, 5, 2:4] = mask[7, 6, 3:] = False
    with pytest.raises(GenusError, match="share edges or corners only, no faces; widen it there"):
        mask_surface(mask, OBLIQUE, 1)


def test_two_large_islands_are_refused_and_small_ones_dropped():
    body = drilled(2)
    with pytest.raises(ConnectivityError, match="two large islands, the second with 100%"):
        mask_surface(np.concatenate([body, body]), np.eye(4))
    small = np.concatenate([body, np.zeros_like(body)])
    small[20:24, 4:8, 2:5] = True
    assert mask_surface(small, np.eye(4))[2]["island_voxels_dropped"] == 4 * 4 * 3


@pytest.mark.parametrize(("length", "share"), [(4, 21), (1, None)])
def test_many_small_islands_are_dropped_with_a_word(length, share, caplog):
    mask = np.concatenate([drilled(2), np.zeros_like(drilled(2))])
    mask[-length:, ::4, 1:7:3] = mask[-length:, 2::4, 1:7:3] = True  # twelve bars
    assert mask_surface(mask, np.eye(4))[2]["island_voxels_dropped"] == 12 * length
    said = f"the others, 12, are dropped with {share} % as many voxels" in caplog.text
    assert said == bool(caplog.records) == bool(share)


def test_an_island_in_a_cavity_is_no_second_piece():
    mask = np.pad(np.ones((16, 16, 16), bool), 1)
    mask[2:-2, 2:-2, 2:-2] = np.pad(np.ones((8, 8, 8), bool), 3)
    counts = mask_surface(mask, np.eye(4))[2]
    assert (counts["island_voxels_dropped"], counts["cavity_voxels_filled"]) == (0, 14**3)


def test_two_large_pieces_of_what_is_rebuilt_are_refused():
    torus = samples.torus_surface(20, 10)
    V = np.vstack([torus.V, torus.V + 10.0])
    F = np.vstack([torus.F, torus.F + torus.n_vertices])
    with pytest.raises(SelfIntersectionError, match="two large pieces"):
        rebuilt(sm.TriMesh(V, F), 0.5)


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_faces_of_a_mask_are_made_outwards(mirrored):
    """Turned afterwards, they would be reported as if the mask had been inside out."""
    V, F, _ = mask_surface(lopsided_mask(), OBLIQUE @ np.diag([mirrored, 1.0, 1.0, 1.0]))
    assert part_sheets(V, F)[2]["turned"] == 0


def ring(tube: float) -> np.ndarray:
    x, y, z = np.indices((31, 31, 11)) - np.array([15, 15, 5])[:, None, None, None]
    return np.hypot(np.hypot(x, y) - 10.0, z) < tube


@pytest.mark.parametrize("tube", [1.6, 2.0, 2.5, 3.5])
def test_smoothing_keeps_the_volume_of_thin_masks(tube):
    """It had taken a quarter of a tube with a radius of 1.6 voxels, and a twentieth at 3.5."""
    mask = ring(tube)
    V, F, counts = mask_surface(mask, OBLIQUE)
    surface = sm.TriMesh(V, F)
    surface.require_genus_one()
    volume = mask.sum() * abs(np.linalg.det(OBLIQUE[:3, :3]))
    assert surface.volume == pytest.approx(volume, rel=0.035)
    assert counts["voxels_kept"] == mask.sum()


def test_volume_gained_by_smoothing_is_taken_back():
    """Bores are concave: smoothing narrows them."""
    mask = np.zeros((34, 34, 12), bool)
    mask[2:32, 2:32, 2:10] = True
    for i, j in np.ndindex(7, 7):
        mask[4 + 4 * i : 6 + 4 * i, 4 + 4 * j : 6 + 4 * j] = False
    V, F, _ = mask_surface(mask, np.eye(4), 49)
    surface = sm.TriMesh(V, F)
    assert surface.genus == 49
    assert surface.volume == pytest.approx(mask.sum(), rel=0.035)


def test_no_volume_is_kept_at_the_cost_of_a_handle():
    """The gap of an open ring is one voxel wide; it would close where more is enclosed."""
    mask = ring(2.0)
    mask[15:, 15] = False
    V, F, _ = mask_surface(mask, np.eye(4))
    surface = sm.TriMesh(V, F)
    assert surface.genus == 0
    assert 0.85 < surface.volume / mask.sum() < 0.96


def test_volume_lost_is_told_of_the_voxels(caplog):
    """A lump on a bar one voxel wide: smoothing parts it, and it is dropped as debris."""
    mask = np.zeros((26, 12, 7), bool)
    mask[:14] = drilled(2)
    mask[12:17, 4, 3] = True
    mask[17:21, 3:7, 2:4] = True
    done = sm.prepare(mask, faces=800)
    told = done.steps[-1].counts["percent_of_volume_lost"]
    assert told == pytest.approx(100.0 * (1.0 - done.solid.volume / mask.sum()), abs=0.01)
    assert told > 10.0 and "of the volume is lost" in caplog.text
