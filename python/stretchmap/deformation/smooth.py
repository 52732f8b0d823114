"""A solid laid on another by a pose and the smoothest deformation; which pose, by what it takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress, report
from ..mesh.meshes import TetMesh, TriMesh
from .fitting import Fit, Template, fit_surface
from .pose import rigid_poses, same_pose
from .similarity import Similarity, similarity_onto

__all__ = ["settled", "smooth_deformation"]

_SMOOTHINGS = 20  # rounds in which vertices round faces that cross go to the middle of their rings
_MOST_PAIRS = 10_000
_NEARLY = 2.0  # energy of a stiff fit over the least, of poses that are looked at further

Array = NDArray[np.float64]


def smooth_deformation(
    template: Template,
    solid: TetMesh,
    start: Array | None = None,
    landmarks: Array | None = None,
    most: int | None = None,
    progress: Progress | None = None,
) -> tuple[Similarity, Fit]:
    """Lay a template's surface onto that of a solid.

    Parameters
    ----------
    template : Template
    solid : TetMesh
    start : ndarray, shape (nb, 3), optional
        Where the template's boundary vertices go about. Without it the template is laid on the
        solid by landmarks, if there are three or more, or by the surfaces as rigid bodies.
    landmarks : ndarray, shape (l, 3), optional
        Where the landmarks of the template lie on the solid.
    most : int, optional
        Of several poses at most so many are followed to the end, those that take least at first.
    progress : Progress, optional
        Called with stage ``"deform"`` before each fit.

    Returns
    -------
    pose : Similarity
        Onto the solid.
    fit : Fit
        In the pose of the template; of several poses the one of least energy.
    """
    starts = _starts(template, solid, start, landmarks)

    def fits(coarse: bool) -> list[Fit]:
        found = []
        for i, begin in enumerate(starts):
            report(progress, "deform", i, len(starts))
            found.append(_fitted(template, solid, *begin, landmarks, coarse))
        return found

    if len(starts) > 1:
        energies = [fit.energy for fit in fits(coarse=True)]
        order = sorted(range(len(starts)), key=lambda i: energies[i])[:most]
        starts = [starts[i] for i in order if energies[i] <= _NEARLY * energies[order[0]]]
    fine = fits(coarse=False)
    best = min(range(len(fine)), key=lambda i: fine[i].energy)
    return starts[best][0], fine[best]


def settled(
    template: Template, goal: TriMesh, points: Array, held: NDArray[np.integer] | None = None
) -> Array:
    """Points of the goal, moved along it where faces of the template cross.

    Closest points of neighbors may change their order where the goal is sharper than the spline.

    Parameters
    ----------
    template : Template
    goal : TriMesh
    points : ndarray, shape (nb, 3)
        Of the goal, for each of the template's boundary vertices.
    held : ndarray of int, optional
        Boundary vertices that stay.
    """
    F = template.solid.surface.F
    tree = _core.maps.SurfaceTree(goal.V, goal.F)
    there, free = np.array(points), np.ones(len(points), bool)
    if held is not None:
        free[held] = False
    for _ in range(_SMOOTHINGS):
        crossing = _core.certificate.crossing_faces(there, F, _MOST_PAIRS)
        if not len(crossing):
            break
        moving = np.unique(F[np.unique(crossing)])
        moving = moving[free[moving]]
        there[moving] = tree.closest((template.ring_mean @ there)[moving])[0]
    return there


def _starts(
    template: Template, solid: TetMesh, start: Array | None, landmarks: Array | None
) -> list[tuple[Similarity, Array | None]]:
    """Poses of the template on the solid, with where its boundary vertices go about, if known.

    A start without landmarks is doubted: it may come from a template so unlike the solid that
    another pose needed less bending, which from an average does not.
    """
    surface = template.solid.surface
    if start is not None:
        pose = similarity_onto(surface.V, start)
        if landmarks is not None:
            return [(pose, start)]
        others = rigid_poses(surface, solid.surface)
        return [(pose, start), *((p, None) for p in others if not same_pose(p, pose))]
    if landmarks is not None and template.anchors is not None and len(landmarks) >= 3:
        return [(similarity_onto(template.anchors.at(surface.V, surface.F), landmarks), None)]
    return [(pose, None) for pose in rigid_poses(surface, solid.surface)]


def _fitted(
    template: Template,
    solid: TetMesh,
    pose: Similarity,
    start: Array | None,
    landmarks: Array | None,
    coarse: bool,
) -> Fit:
    """The fit in the pose of the template."""
    goal = TriMesh(pose.back(solid.surface.V), solid.surface.F)
    begin = template.solid.surface.V if start is None else pose.back(start)
    held = None if landmarks is None else pose.back(landmarks)
    return fit_surface(template, goal, begin, held, coarse=coarse)
