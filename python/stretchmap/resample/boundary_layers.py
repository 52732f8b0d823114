"""Hexahedra of prescribed thickness at the boundary of a grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import as_reals
from ..errors import MeshError, OptionError, SolverError
from .layout import Layout, rim_of_block, swept_layout
from .quality import boundary_quads

__all__ = ["thicknesses_of", "with_layers"]

_MOST = 1000
_MOST_SHARE = 0.9  # of the outermost hexahedra that the layers may take


def thicknesses_of(layers: Sequence[float] | None) -> NDArray[np.float64]:
    """Thicknesses from the boundary inwards, (m,).

    Raises
    ------
    OptionError
        They are no positive numbers, or too many.
    """
    try:
        found = as_reals([] if layers is None else layers, "layers", (None,))
    except MeshError as error:
        raise OptionError(f"layers must be the thickness of each: {error}") from None
    if len(found) > _MOST or not (found > 0.0).all():
        raise OptionError(f"layers must be at most {_MOST} positive thicknesses")
    return found


def with_layers(
    numbers: tuple[int, int, int],
    V: NDArray[np.float64],
    others: Sequence[NDArray[np.float64]],
    thicknesses: NDArray[np.float64],
) -> tuple[Layout, NDArray[np.float64], list[NDArray[np.float64]]]:
    """Split the outermost hexahedra of a grid parallel to the boundary.

    Thickness is measured along the normal of the boundary at each of its points.

    Parameters
    ----------
    numbers : tuple of int
        Sections, block and rings of the grid.
    V : ndarray, shape (n, 3)
    others : sequence of ndarray, each of shape (n, 3)
        Further points of the same grid, split in the same proportions.
    thicknesses : ndarray, shape (m,)
        From the boundary inwards.

    Returns
    -------
    Layout
    ndarray, list of ndarray
        ``V`` and ``others`` with the points added.

    Raises
    ------
    SolverError
        The layers take more than nine tenths of the outermost hexahedra; ``ids`` are the points of
        the boundary where they do.
    """
    sections, block, rings = numbers
    layout = swept_layout(*numbers)
    normals = _normals(V, boundary_quads(layout.H))
    outer, inner = _outermost(numbers, len(V))
    depth = np.einsum("nx,nx->n", V[outer] - V[inner], normals[outer])
    ends = np.cumsum(thicknesses)
    too_thin = outer[~(ends[-1] < _MOST_SHARE * depth)]
    if len(too_thin):
        raise SolverError(
            f"the layers do not fit at {len(too_thin)} points: they are {ends[-1]:.3g} thick, the "
            f"outermost hexahedra {depth.min():.3g} at the thinnest; ask for thinner layers, fewer "
            "rings or fewer hexahedra",
            too_thin,
        )
    shares = (ends[::-1, None] / depth)[None]  # the innermost of the new points first
    new = swept_layout(sections, block, rings + len(thicknesses))

    def split(points: NDArray[np.float64]) -> NDArray[np.float64]:
        first, last = (points[ids].reshape(sections, 1, -1, 3) for ids in (outer, inner))
        share = shares.reshape(len(thicknesses), sections, -1, 1).swapaxes(0, 1)
        added = first + share * (last - first)
        kept = points.reshape(sections, -1, 3)
        count = kept.shape[1] - first.shape[2]
        parts = [kept[:, :count], added.reshape(sections, -1, 3), kept[:, count:]]
        return np.ascontiguousarray(np.concatenate(parts, axis=1).reshape(-1, 3))

    return new, split(V), [split(points) for points in others]


def _outermost(
    numbers: tuple[int, int, int], n_points: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Points of the boundary, section by section, and the point each has inside."""
    sections, block, rings = numbers
    per_section, around = n_points // sections, 4 * block
    start = per_section * np.arange(sections)[:, None]
    outer = np.arange(per_section - around, per_section)
    inner = outer - around if rings > 1 else rim_of_block(block)
    return (start + outer).ravel(), (start + inner).ravel()


def _normals(V: NDArray[np.float64], quads: NDArray[np.int32]) -> NDArray[np.float64]:
    """(n, 3) unit normals at the points of the quads, weighted by area; NaN elsewhere."""
    areas = np.cross(V[quads[:, 2]] - V[quads[:, 0]], V[quads[:, 3]] - V[quads[:, 1]])
    total = np.stack(
        [np.bincount(quads.ravel(), np.repeat(column, 4), minlength=len(V)) for column in areas.T],
        axis=1,
    )
    with np.errstate(invalid="ignore"):
        return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))
