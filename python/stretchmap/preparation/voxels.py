"""The surface of a segmented volume: voxels cleaned, smoothed, polygonized."""

from __future__ import annotations

import importlib.util
import os
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..base.files import open_to_read, parsing
from ..base.options import as_path
from ..errors import ArrayError, FileFormatError, MissingDependencyError
from ..io.npz import read_archive, read_array

__all__ = ["holds_mask", "mask_surface", "read_mask"]

_BLUR = 0.7  # voxels; takes the stairs off, moves a flat surface nowhere


def mask_surface(
    mask: NDArray[Any], spacing: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.int32], dict[str, int]]:
    """Surface of the largest island of a mask, its cavities filled.

    Parameters
    ----------
    mask : (a, b, c) array of bool, or of integers of which those that are not zero belong to it
    spacing : three positive floats
        Distance of voxel centers along each axis.

    Returns
    -------
    V, F : ndarrays
        Marching cubes on the smoothed mask; voxel (i, j, k) lies at ``(i, j, k) * spacing``.
    counts : dict
        Voxels of ``islands`` dropped, of ``cavities`` filled, ``faces``.

    Raises
    ------
    ArrayError
        Not such a mask, or an empty one.
    MissingDependencyError
        If scikit-image is not installed.
    """
    mask = np.asarray(mask)
    if mask.ndim != 3 or mask.dtype.kind not in "biu":
        raise ArrayError(
            f"a mask is a 3-dimensional array of bool or integers, not {mask.dtype} of shape "
            f"{mask.shape}; make one by a threshold, volume > level"
        )
    if not mask.any():
        raise ArrayError("the mask is empty")
    if importlib.util.find_spec("skimage") is None:
        raise MissingDependencyError("a mask needs scikit-image: pip install 'stretchmap[prepare]'")
    from skimage.measure import marching_cubes

    box = ndimage.find_objects((mask != 0).astype(np.uint8))[0]
    inside = np.pad(mask[box] != 0, 3)
    labels, _ = ndimage.label(inside)
    sizes = np.bincount(labels.ravel())[1:]
    body = labels == sizes.argmax() + 1
    filled = ndimage.binary_fill_holes(body)
    field = ndimage.gaussian_filter(filled.astype(np.float32), _BLUR)
    if not field.max() > 0.5:
        raise ArrayError("the mask is nowhere thicker than a voxel; resample it finer")
    V, F, _, _ = marching_cubes(field, 0.5)
    counts = {
        "island_voxels_dropped": int(sizes.sum() - sizes.max()),
        "cavity_voxels_filled": int(filled.sum() - sizes.max()),
        "faces": len(F),
    }
    V = (V + np.array([axis.start for axis in box]) - 3) * np.asarray(spacing, float)
    return V, np.ascontiguousarray(F, np.int32), counts


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
) -> tuple[NDArray[Any], tuple[float, float, float] | None]:
    """Read a voxel mask.

    Parameters
    ----------
    path : path-like
        ``.npy``; ``.npz`` with one 3-dimensional array and optionally ``spacing``; NIfTI through
        nibabel.

    Returns
    -------
    mask : (a, b, c) ndarray
    spacing : three floats, or None where the file names none

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
    if spacing.shape != (3,) or spacing.dtype.kind not in "fiu":
        raise FileFormatError(f"{path}: spacing must be three numbers")
    return arrays[masks[0]], tuple(spacing.astype(float).tolist())


def _read_nifti(path: str | os.PathLike[str]) -> tuple[NDArray[Any], Any]:
    try:
        import nibabel
    except ImportError as error:
        raise MissingDependencyError(
            "NIfTI files need nibabel: pip install 'stretchmap[nifti]'"
        ) from error
    image: Any = nibabel.load(path)
    data = np.asarray(image.dataobj)
    if data.dtype.kind == "f" and np.array_equal(data, np.rint(data)):
        data = data.astype(np.int64)  # integers with a scale of one are stored so
    return data, tuple(float(step) for step in image.header.get_zooms()[:3])
