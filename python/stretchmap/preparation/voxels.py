"""The surface of a segmented volume: voxels cleaned, smoothed, polygonized."""

from __future__ import annotations

import importlib.util
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
from .soup import LARGEST_DEBRIS

__all__ = ["as_affine", "holds_mask", "mask_surface", "read_mask"]

_BLUR = 0.7  # voxels; takes the stairs off, moves a flat surface nowhere
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
        Marching cubes on the smoothed mask, faces oriented outwards.
    counts : dict
        Voxels of islands dropped and of cavities filled, faces, and whether voxels were halved.

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
    counts = {
        "island_voxels_dropped": int(outside.sum()),
        "cavity_voxels_filled": int(filled.sum() - sizes.max()),
    }
    return filled, counts


def _polygonized(
    filled: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Marching cubes on the smoothed voxels, in units of these."""
    from skimage.measure import marching_cubes

    field = ndimage.gaussian_filter(filled.astype(np.float32), _BLUR)
    if not field.max() > 0.5:
        raise ArrayError("the mask is nowhere thicker than a voxel; resample it finer")
    V, F, _, _ = marching_cubes(field, 0.5, gradient_direction="ascent")  # faces outwards
    return V.astype(np.float64), np.ascontiguousarray(F, np.int32)


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
