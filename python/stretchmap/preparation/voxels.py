"""The surface of a segmented volume: voxels cleaned, smoothed, polygonized."""

from __future__ import annotations

import importlib.util
import logging
import math
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from ..base.arrays import as_reals
from ..base.files import open_to_read, parsing
from ..base.options import as_path, memory
from ..errors import (
    ArrayError,
    ConnectivityError,
    FileFormatError,
    GenusError,
    MeshError,
    MissingDependencyError,
)
from ..io.npz import read_archive, read_array
from ..mesh.diagnosis import diagnose_surface
from ..mesh.meshes import TriMesh
from .soup import LARGEST_DEBRIS, components

__all__ = ["as_affine", "holds_mask", "mask_surface", "read_mask"]

_log = logging.getLogger("stretchmap")

_MUCH_DEBRIS = 0.1  # of the voxels kept, may be dropped in islands without a word
_BLUR = 0.7  # voxels; takes the stairs off
# Of the volume, may be lost or gained by that: all of it would move the flat faces of bodies with
# edges, which are rounded, by a tenth of a voxel.
_VOLUME = 0.03
_CLOSE = 0.005  # to that; the levels of two masks that are nearly one differ little
_HALVINGS = 8  # of the interval of levels
_MARGIN = 1.25  # the topology is the same at that many times the shift of the level
_SHIFTS = 4  # tried, each half the one before
_BYTES_PER_HALVED = 8 * 12  # a voxel's eight parts, smoothed in single precision
_FLAT = 1e-6  # volume of a voxel over the product of its sides


def as_affine(affine: ArrayLike, name: str = "affine") -> NDArray[np.float64]:
    """Convert what takes indices of voxels to world coordinates.

    Parameters
    ----------
    affine : (4, 4) array_like of real numbers
    name : str
        What the caller names it, for messages.

    Returns
    -------
    (4, 4) ndarray of float64

    Raises
    ------
    ArrayError, NonFiniteError
        Not such a matrix, its last row is not 0, 0, 0, 1, or it lays voxels flat.
    """
    matrix = as_reals(affine, name, (4, 4))
    if (matrix[3] != (0.0, 0.0, 0.0, 1.0)).any():
        raise ArrayError(f"the last row of {name} must be 0, 0, 0, 1, not {matrix[3].tolist()}")
    sides = np.linalg.norm(matrix[:3, :3], axis=0)
    if not (sides > 0.0).all() or abs(np.linalg.det(matrix[:3, :3] / sides)) < _FLAT:
        raise ArrayError(
            f"{name} is singular, voxels have no volume: {matrix[:3, :3].tolist()}; correct it "
            "where it comes from"
        )
    return matrix


def mask_surface(
    mask: NDArray[Any], affine: NDArray[np.float64], genus: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.int32], dict[str, int]]:
    """Surface of the largest island of a mask, its cavities filled.

    Parameters
    ----------
    mask : (a, b, c) array of bool, or of integers of which those that are not zero belong to it
    affine : (4, 4) array
        The center of voxel (i, j, k) lies at ``affine @ (i, j, k, 1)``; regular.
    genus : int
        Number of handles that are wanted. Where the mask has as many and smoothing closes some,
        as it does holes one voxel wide, voxels are halved first.

    Returns
    -------
    V, F : ndarrays
        Marching cubes on the smoothed mask, faces oriented outwards. What the surface encloses
        is the volume of the voxels kept to within three per cent, where its topology allows it.
    counts : dict
        Voxels kept, those of islands dropped and of cavities filled, faces, and whether voxels
        were halved.

    Raises
    ------
    ArrayError
        Not such a mask, or an empty one.
    ConnectivityError
        Another island that is not inside the largest is too large to be debris.
    OptionError
        Voxels would have to be halved, which takes more memory than there is.
    GenusError
        The mask has the handles that are wanted, and smoothing closes some of them all the same.
    MissingDependencyError
        If scikit-image is not installed.
    """
    mask = _one_volume(np.asarray(mask))
    if mask.dtype.kind not in "biu":
        raise ArrayError(
            f"a mask holds bool or integers, not {mask.dtype}; make one by a threshold, "
            "volume > level"
        )
    if not mask.any():
        raise ArrayError("the mask is empty")
    if importlib.util.find_spec("skimage") is None:
        raise MissingDependencyError("a mask needs scikit-image: pip install 'stretchmap[prepare]'")

    box = ndimage.find_objects((mask != 0).astype(np.uint8))[0]
    inside = np.pad(mask[box] != 0, 3)
    filled, counts = _largest_island(inside)
    V, F = _polygonized(filled)
    halved = diagnose_surface(V, F).genus.sum() < genus <= _tunnels(filled)
    if halved:
        memory("the mask with its voxels halved", _BYTES_PER_HALVED * filled.size)
        V, F = _polygonized(filled.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2))
        V = 0.5 * V - 0.25
        if (found := int(diagnose_surface(V, F).genus.sum())) < genus:
            raise GenusError(
                f"the mask has genus {_tunnels(filled)}, its smoothed surface {found}, {genus} is "
                "wanted: voxels of a hole share edges or corners only, no faces; widen it there, "
                "or segment a finer image"
            )
    counts["faces"] = len(F)
    if halved:
        counts["voxels_halved"] = 1
    V = V + np.array([axis.start for axis in box]) - 3
    if np.linalg.det(affine[:3, :3]) < 0.0:
        F = np.ascontiguousarray(F[:, ::-1])
    return V @ affine[:3, :3].T + affine[:3, 3], F, counts


def _largest_island(
    inside: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """The largest of the islands, of voxels that share faces, with its cavities filled."""
    labels, _ = ndimage.label(inside)
    sizes = np.bincount(labels.ravel())[1:]
    filled = ndimage.binary_fill_holes(labels == sizes.argmax() + 1)
    outside = np.bincount(labels[~filled], minlength=2)[1:]
    if outside.max() > LARGEST_DEBRIS * sizes.max():
        raise ConnectivityError(
            f"the mask has two large islands, the second with {outside.max() / sizes.max():.0%} of "
            "the voxels of the first, and no voxel of one shares a face with one of the other; "
            "join them, or split the mask and prepare one of them"
        )
    kept, dropped = int(filled.sum()), int(outside.sum())
    if dropped > _MUCH_DEBRIS * kept:
        _log.warning(
            "prepare: of the mask the largest island is kept; the others, %d, are dropped with "
            "%.0f %% as many voxels together: join those that belong to it",
            np.count_nonzero(outside), 100.0 * dropped / kept,
        )  # fmt: skip
    counts = {
        "voxels_kept": kept,
        "island_voxels_dropped": dropped,
        "cavity_voxels_filled": kept - int(sizes.max()),
    }
    return filled, counts


def _polygonized(
    filled: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Marching cubes on the smoothed voxels, in units of these.

    Smoothing takes volume where a body is convex, a quarter of tubes three voxels wide. So the
    level is not the one halfway between inside and outside but the next one whose surface encloses
    nearly as much as the voxels; nearer to halfway where pieces or handles would be others there.
    """
    field = ndimage.gaussian_filter(filled.astype(np.float32), _BLUR)
    if not field.max() > 0.5:
        raise ArrayError("the mask is nowhere thicker than a voxel; resample it finer")
    halfway = V, F = _at_level(field, 0.5)
    shift = _level_of_volume(field, V, F, float(filled.sum())) - 0.5
    for _ in range(_SHIFTS if shift else 0):
        V, F = _at_level(field, 0.5 + shift)
        farther = _at_level(field, 0.5 + _MARGIN * shift)
        if _topology(V, F) == _topology(*farther) == _topology(*halfway):
            return V, F
        shift *= 0.5
    return halfway


def _level_of_volume(
    field: NDArray[np.float32], V: NDArray[np.float64], F: NDArray[np.int32], volume: float
) -> float:
    """Level next to 0.5, whose surface is given, that encloses nearly a volume; by bisection."""
    level, missing = 0.5, volume - TriMesh(V, F).volume
    if abs(missing) <= _VOLUME * volume:
        return level
    allowed = math.copysign(_VOLUME * volume, missing)
    end = 0.0 if missing > 0.0 else float(field.max())
    low, high = sorted((0.5, 0.5 + (end - 0.5) / _MARGIN))
    for _ in range(_HALVINGS):
        level = 0.5 * (low + high)
        excess = volume - allowed - TriMesh(*_at_level(field, level)).volume
        if abs(excess) <= _CLOSE * volume:
            break
        low, high = (low, level) if excess > 0.0 else (level, high)
    return level


def _at_level(
    field: NDArray[np.float32], level: float
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    from skimage.measure import marching_cubes

    V, F, _, _ = marching_cubes(field, level, gradient_direction="ascent")  # faces outwards
    return V.astype(np.float64), np.ascontiguousarray(F, np.int32)


def _topology(V: NDArray[np.float64], F: NDArray[np.int32]) -> tuple[int, int]:
    """Number of pieces and Euler characteristic of a closed surface."""
    return int(components(F).max()) + 1, len(V) - len(F) // 2


def _tunnels(filled: NDArray[np.bool_]) -> int:
    """Number of tunnels through one island without cavities, of voxels that share faces."""
    from skimage.measure import euler_number

    return 1 - int(euler_number(filled, connectivity=1))


def _one_volume(array: NDArray[Any]) -> NDArray[Any]:
    """The array without trailing axes of length one, as images have for time and channels."""
    while array.ndim > 3 and array.shape[-1] == 1:
        array = array[..., 0]
    if array.ndim != 3:
        more = "; choose one of its volumes, image[..., 0]" if array.ndim > 3 else ""
        raise ArrayError(f"a mask has three axes, this has the shape {array.shape}{more}")
    return array


def holds_mask(path: str | os.PathLike[str]) -> bool:
    """Whether a file holds voxels and no mesh: by its suffix, an ``.npz`` by its entries.

    Raises
    ------
    OSError
        If the file cannot be opened.
    """
    name = Path(path).name.lower()
    if not name.endswith(".npz"):
        return name.endswith((".npy", ".nii", ".nii.gz"))
    try:
        with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
            return "V.npy" not in archive.namelist()
    except zipfile.BadZipFile:
        return False  # what is wrong with it the reader of meshes says


def read_mask(
    path: str | os.PathLike[str],
) -> tuple[NDArray[Any], NDArray[np.float64] | None]:
    """Read a voxel mask.

    Parameters
    ----------
    path : path-like
        ``.npy``; ``.npz`` with one 3-dimensional array and optionally ``spacing``; NIfTI through
        nibabel.

    Returns
    -------
    mask : (a, b, c) ndarray
    affine : (4, 4) ndarray, or None
        From indices to world coordinates, in the unit of the file; that of a spacing is diagonal.
        None where the file says nothing of either.

    Raises
    ------
    FileFormatError
        The file is damaged or holds no such array.
    MissingDependencyError
        If it is NIfTI and nibabel is not installed.
    OSError
        If it cannot be opened.
    """
    path = as_path(path)
    with open_to_read(path) as file, parsing(path):
        if path.suffix.lower() in (".nii", ".gz"):
            return _read_nifti(path)
        if path.suffix.lower() == ".npy":
            return read_array(file), None
        arrays = read_archive(file)
    masks = [name for name, array in arrays.items() if array.ndim == 3]
    if len(masks) != 1:
        raise FileFormatError(f"{path} must hold one 3-dimensional array, it holds {len(masks)}")
    spacing = arrays.get("spacing")
    if spacing is None:
        return arrays[masks[0]], None
    known = spacing.shape == (3,) and spacing.dtype.kind in "fiu"
    if not known or not (np.isfinite(spacing) & (spacing > 0.0)).all():
        raise FileFormatError(f"{path}: spacing must be three positive numbers")
    return arrays[masks[0]], np.diag([*spacing.astype(float), 1.0])


def _read_nifti(path: Path) -> tuple[NDArray[Any], NDArray[np.float64]]:
    try:
        import nibabel
    except ImportError as error:
        raise MissingDependencyError(
            "NIfTI files need nibabel: pip install 'stretchmap[nifti]'"
        ) from error
    image: Any = nibabel.load(path)
    header = image.header
    try:
        data = _one_volume(np.asarray(image.dataobj))
        # Without a form the standard has voxels at their distances; nibabel would mirror them.
        placed = header.get_sform(coded=True)[1] or header.get_qform(coded=True)[1]
        affine = as_affine(image.affine if placed else np.diag([*header.get_zooms()[:3], 1.0]))
    except MeshError as error:
        raise FileFormatError(str(error)) from None
    if data.dtype.kind == "f" and np.array_equal(data, np.rint(data)):
        data = data.astype(np.int64)  # integers with a scale of one are stored so
    return data, affine
