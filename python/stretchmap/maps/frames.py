"""Solid-torus coordinates for finite elements: gradients, frames, angles without a jump.

On a tet the map is affine with Jacobian J, so that the gradients of a coordinate c of (7.1) in the
source are ``J^T grad c`` with ``grad c`` taken at the image: ``e_u / (R + s cos v)``, ``e_v / s``
and ``e_s``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from ..base.torus import TWO_PI, Torus
from ..mesh.meshes import TetMesh

__all__ = ["CoordinateField", "coordinate_field", "without_jump"]


@dataclass(frozen=True, eq=False)
class CoordinateField:
    """Solid-torus coordinates at points of a solid, with gradients and frames.

    Rows of points outside the solid are NaN; so are the gradients of v and s and the frames on the
    core, s = 0, where they do not exist.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        In the source.
    coordinates : ndarray, shape (n, 3)
        u, v in [0, 2 pi) and s.
    gradients : ndarray, shape (n, 3, 3)
        Rows: gradients of u, v and s in the source. They do not jump where the angles start anew.
    frames : ndarray, shape (n, 3, 3)
        Rows: orthonormal and right-handed, along the axis (the tangent of the line on which only u
        varies), round the tube, and radial (the normal of the shell s = const).

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> field = sm.volume_map(sm.samples.solid_torus(600)).coordinate_field()
    >>> along, around, radial = np.moveaxis(field.frames, 1, 0)
    >>> bool(np.allclose(np.cross(along, around), radial))
    True
    >>> sorted(field.periodic())
    ['cos_u', 'cos_v', 'sin_u', 'sin_v']
    """

    points: NDArray[np.float64]
    coordinates: NDArray[np.float64]
    gradients: NDArray[np.float64]
    frames: NDArray[np.float64]

    def periodic(self) -> dict[str, NDArray[np.float64]]:
        """Cosines and sines of u and v, which have no seam where the angles start anew.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            ``cos_u``, ``sin_u``, ``cos_v``, ``sin_v``.
        """
        return periodic(self.coordinates[:, 0], self.coordinates[:, 1])


def periodic(u: NDArray[np.float64], v: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Cosines and sines by name."""
    return {"cos_u": np.cos(u), "sin_u": np.sin(u), "cos_v": np.cos(v), "sin_v": np.sin(v)}


def coordinate_field(
    mesh: TetMesh,
    image: NDArray[np.float64],
    torus: Torus,
    tets: NDArray[np.int32] | None = None,
    weights: NDArray[np.float64] | None = None,
) -> CoordinateField:
    """Coordinates at the centers of all tets, or at points given by tet and weights.

    Parameters
    ----------
    mesh : TetMesh
    image : ndarray, shape (n, 3)
        Of its vertices.
    torus : Torus
    tets : ndarray of int32, shape (m,), optional
        Tet of each point, -1 outside.
    weights : ndarray, shape (m, 4), optional
        Barycentric coordinates there.
    """
    if tets is None or weights is None:
        T = mesh.T
        points, there = mesh.V[T].mean(axis=1), image[T].mean(axis=1)
    else:
        T = mesh.T[tets]
        points, there = (np.einsum("mk,mkx->mx", weights, X[T]) for X in (mesh.V, image))
    u, v, s = torus.coordinates(there)
    # Rows of `edges` are x_a - x_0, so that J^T = edges^-1 images.
    edges, images = (X[T[:, 1:]] - X[T[:, :1]] for X in (mesh.V, image))
    cofactors = np.stack([np.cross(edges[:, k - 2], edges[:, k - 1]) for k in range(3)], axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        transposed = cofactors @ images / np.linalg.det(edges)[:, None, None]
        slopes = _basis(u, v) / np.stack([torus.R + s * np.cos(v), s, np.ones_like(s)], 1)[:, None]
        slopes[~(s > 0.0), :, 1:] = np.nan
        gradients = np.swapaxes(transposed @ slopes, 1, 2)
        frames = _frames(gradients)
    frames[np.isnan(s)] = gradients[np.isnan(s)] = np.nan
    return CoordinateField(
        points=read_only(points),
        coordinates=read_only(np.stack([u, v, s], axis=1)),
        gradients=read_only(np.ascontiguousarray(gradients)),
        frames=read_only(frames),
    )


def _basis(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 3) with columns e_u, e_v, e_s."""
    zero = np.zeros_like(u)
    outward = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=1)
    around = np.stack([-np.sin(v) * np.cos(u), -np.sin(v) * np.sin(u), np.cos(v)], axis=1)
    return np.stack([np.stack([-np.sin(u), np.cos(u), zero], axis=1), around, outward], axis=2)


def _frames(gradients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Along, round, radial."""
    # v and s are constant along the first, which is normal to their gradients.
    grad_v, grad_s = gradients[:, 1], gradients[:, 2]
    along = np.cross(grad_v, grad_s)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    radial = grad_s / np.linalg.norm(grad_s, axis=1, keepdims=True)
    return np.stack([along, np.cross(radial, along), radial], axis=1)


def without_jump(
    angles: NDArray[np.float64], elements: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Angles at the corners of elements, each element in one piece.

    Parameters
    ----------
    angles : ndarray, shape (n,)
        Radians at the points.
    elements : ndarray of int, shape (k, c)

    Returns
    -------
    values : ndarray, shape (k, c)
        The first corner's in [0, 2 pi), the others' on the branch nearest to it.
    single : ndarray of bool, shape (k,)
        False where no branch fits: corners half a turn or more apart, as of v round the core.

    Examples
    --------
    >>> import numpy as np
    >>> angles = np.array([0.1, 6.2, 2.2, 4.4])
    >>> values, single = without_jump(angles, np.array([[0, 1, 0], [0, 2, 3]]))
    >>> values.round(3).tolist(), single.tolist()
    ([[0.1, -0.083, 0.1], [0.1, 2.2, -1.883]], [True, False])
    """
    corners = np.asarray(angles, float)[elements]
    first = corners[:, :1] % TWO_PI
    values = first + np.arctan2(np.sin(corners - first), np.cos(corners - first))
    return values, np.ptp(values, axis=1) < np.pi
