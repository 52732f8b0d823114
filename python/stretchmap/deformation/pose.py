"""Where one surface lies on another as a rigid body of the same volume."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .. import _core
from ..base.rotation import kabsch
from ..mesh.meshes import TriMesh
from .similarity import Similarity

__all__ = ["looks_mirrored", "rigid_poses", "same_pose"]

_FEW, _MANY = 80, 250  # faces of either surface that are compared, at first and then
_FIRST, _KEPT, _LAST = 5, 8, 30  # steps of every start, starts that go on, and steps of those
_NEARLY, _MOST = 2.0, 6  # distance over the least of what is kept, and how many that are
_SAME = 1.0 + 2.0 * np.cos(np.radians(20.0))  # trace of the rotation between two that are one
_AT_REST = 1e-6
_MIRRORED = 0.8  # distance of the mirror image over that of the surface: 0.94 at least of vertebrae

Array = NDArray[np.float64]


class _Samples:
    """Centers of some faces of a surface, scaled to volume one about its center of mass."""

    def __init__(self, surface: TriMesh, count: int) -> None:
        corners = surface.V[surface.F]
        signed = np.einsum("mx,mx->m", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        self.center = np.einsum("m,mx->x", signed, corners.sum(axis=1)) / (4.0 * signed.sum())
        self.length = float((signed.sum() / 6.0) ** (1.0 / 3.0))
        points = (surface.V - self.center) / self.length
        self.tree = _core.maps.SurfaceTree(np.ascontiguousarray(points), surface.F)
        kept = np.arange(0, surface.n_faces, max(1, surface.n_faces // count))
        self.points = np.ascontiguousarray(points[surface.F[kept]].mean(axis=1))
        self.weights = surface.face_areas[kept] / surface.face_areas[kept].sum()
        moments = np.einsum("m,mi,mj->ij", self.weights, self.points, self.points)
        self.axes = np.linalg.eigh(moments)[1].T
        self.axes[0] *= np.sign(np.linalg.det(self.axes))

    def feet(self, points: Array) -> Array:
        """Closest points of the surface."""
        return np.asarray(self.tree.closest(np.ascontiguousarray(points))[0])


def same_pose(one: Similarity, other: Similarity) -> bool:
    """Whether two poses turn a body nearly the same way."""
    return bool(np.einsum("ij,ij->", one.rotation, other.rotation) > _SAME)


def rigid_poses(moving: TriMesh, goal: TriMesh) -> list[Similarity]:
    """Rotations, shifts and a factor (of the volumes) that bring a surface close to another.

    Principal axes are laid on principal axes, turned by each of the 60 rotations of an icosahedron,
    which are nowhere farther than 45 degrees from any other, and improved by iterative closest
    points, from either surface to the other (Besl and McKay 1992). No reflections.

    Parameters
    ----------
    moving, goal : TriMesh
        Closed, of positive volume.

    Returns
    -------
    list of Similarity
        The closest first; others that differ from it and are nearly as close, which for a body
        with processes on all sides may be the right ones.
    """
    fine, first, second = _ranked(moving, goal)
    distinct: list[tuple[float, Array, Array]] = []
    for pose in fine:
        near = [np.einsum("ij,ij->", pose[1], other[1]) > _SAME for other in distinct]
        if pose[0] <= _NEARLY * fine[0][0] and not any(near):
            distinct.append(pose)
    factor = second.length / first.length
    return [
        Similarity(
            turn, factor, second.center + second.length * shift - factor * first.center @ turn
        )
        for _, turn, shift in distinct[:_MOST]
    ]


def looks_mirrored(moving: TriMesh, goal: TriMesh) -> bool:
    """Whether a surface, as a rigid body, comes clearly closer to the mirror image of another."""
    mirrored = TriMesh(goal.V * [-1.0, 1.0, 1.0], goal.F[:, ::-1])
    plain, reflected = (_ranked(moving, other)[0][0][0] for other in (goal, mirrored))
    return reflected < _MIRRORED * plain


@lru_cache(maxsize=1)  # who asks for poses asks for mirror images of the same surfaces next
def _ranked(
    moving: TriMesh, goal: TriMesh
) -> tuple[tuple[tuple[float, Array, Array], ...], _Samples, _Samples]:
    """Distance, rotation and shift of the best starts, closest first, and what was compared."""
    first, second = _Samples(moving, _FEW), _Samples(goal, _FEW)
    base = first.axes.T @ second.axes
    starts = base @ Rotation.create_group("I").as_matrix()
    coarse = [_improved(first, second, start, np.zeros(3), _FIRST) for start in starts]
    coarse.sort(key=lambda pose: pose[0])
    first, second = _Samples(moving, _MANY), _Samples(goal, _MANY)
    fine = [_improved(first, second, pose[1], pose[2], _LAST) for pose in coarse[:_KEPT]]
    return tuple(sorted(fine, key=lambda pose: pose[0])), first, second


def _improved(
    first: _Samples, second: _Samples, rotation: Array, shift: Array, steps: int
) -> tuple[float, Array, Array]:
    """Root mean square distance, rotation and shift after some steps."""
    weights = 0.5 * np.concatenate([first.weights, second.weights])
    value = np.inf
    for _ in range(steps):
        there = first.points @ rotation + shift
        feet = second.feet(there)
        back = first.feet((second.points - shift) @ rotation.T)
        p = np.concatenate([first.points, back])
        q = np.concatenate([feet, second.points])
        gaps = p @ rotation + shift - q
        before, value = value, float(np.einsum("n,nx,nx->", weights, gaps, gaps))
        middle, aim = np.einsum("n,nx->x", weights, p), np.einsum("n,nx->x", weights, q)
        rotation, _ = kabsch(np.einsum("n,ni,nj->ij", weights, p - middle, q - aim))
        shift = aim - middle @ rotation
        if before - value <= _AT_REST * value:
            break
    return float(np.sqrt(value)), rotation, shift
