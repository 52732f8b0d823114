"""A surface that crosses itself all over, rebuilt from the voxels it winds round."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConnectivityError, SelfIntersectionError
from ..mesh.meshes import TriMesh
from .soup import keep_largest, part_sheets
from .voxels import mask_surface

__all__ = ["rebuilt", "winding_mask"]

_MOST_VOXELS = 30_000_000
# Of the grid, in voxels: no vertex and no edge lies over the middle of a column then.
_SHIFT = np.array([0.41421356, 0.73205081, 0.23606798])


def rebuilt(surface: TriMesh, step: float) -> TriMesh:
    """The surface of what a closed surface winds round at least once.

    Parameters
    ----------
    surface : TriMesh
        Closed and oriented, however it crosses itself.
    step : float
        Size of the voxels; larger where there would be too many. What is thinner may be lost.

    Returns
    -------
    TriMesh
        Without self-intersections, smooth over two voxels; its genus may be another.

    Raises
    ------
    SelfIntersectionError
        The surface winds round nothing of that size, or round two large pieces.
    MissingDependencyError
        If scikit-image is not installed.
    """
    size = np.ptp(surface.V, axis=0) + 4.0 * step
    step = max(step, float(np.cbrt(size.prod() / _MOST_VOXELS)))
    mask, corner = winding_mask(surface.V, surface.F, step)
    if not mask.any():
        raise SelfIntersectionError("the surface crosses itself and winds round nothing", [])
    affine = np.diag([step, step, step, 1.0])
    affine[:3, 3] = corner
    try:
        V, F, _ = mask_surface(mask, affine)
    except ConnectivityError as error:
        raise SelfIntersectionError(
            "the surface crosses itself and winds round two large pieces; repair it, or split it "
            "and prepare one of them"
        ) from error
    V, F, _ = part_sheets(V, F)
    V, F, _ = keep_largest(V, F)
    return TriMesh(V, F, orient=True)


def winding_mask(
    V: NDArray[np.float64], F: NDArray[np.int32], step: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Voxels a closed surface winds round at least once, and where the first of them lies.

    The surface is crossed by the column over each pixel; what is entered minus what is left below a
    voxel is its winding number.
    """
    corner = V.min(axis=0) - (2.0 + _SHIFT) * step
    shape = np.ceil((V.max(axis=0) - corner) / step).astype(int) + 2
    points = (V - corner) / step
    row, pixel = _under(points[:, :2], F)
    a, b, c = (points[F[row, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    height = a[:, 2] - ((pixel - a[:, :2]) * normal[:, :2]).sum(axis=1) / normal[:, 2]
    level = np.clip(np.ceil(height).astype(int), 0, shape[2] - 1)
    winding = np.zeros(shape, np.int32)
    np.add.at(winding, (pixel[:, 0], pixel[:, 1], level), np.where(normal[:, 2] < 0.0, 1, -1))
    return np.cumsum(winding, axis=2) >= 1, corner


def _under(points: NDArray[Any], F: NDArray[np.int32]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Every pair of a face and a pixel whose middle lies under it, seen from above."""
    corners = points[F]
    low = np.ceil(corners.min(axis=1)).astype(int)
    count = np.floor(corners.max(axis=1)).astype(int) - low + 1
    total = count.prod(axis=1)
    row = np.repeat(np.arange(len(F)), total)
    place = np.arange(len(row)) - np.repeat(np.cumsum(total) - total, total)
    width = count[row, 1]
    pixel = low[row] + np.stack([place // width, place % width], axis=1)
    inside = np.ones((len(row), 2), bool)
    for k in range(3):
        # Of an edge both faces compute the same number, so that none or both count a pixel.
        i, j = F[row, k], F[row, (k + 1) % 3]
        p, q = points[np.minimum(i, j)], points[np.maximum(i, j)]
        side = (q[:, 0] - p[:, 0]) * (pixel[:, 1] - p[:, 1])
        side -= (q[:, 1] - p[:, 1]) * (pixel[:, 0] - p[:, 0])
        left = (side > 0.0) == (i < j)
        inside &= np.stack([left, ~left], axis=1)
    kept = inside.any(axis=1)
    return row[kept], pixel[kept]
