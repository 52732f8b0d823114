"""The mean shape as the next template: free of flipped tets, and how far it moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..certificate.checks import certify
from ..certificate.findings import Certificate
from ..deformation.similarity import similarity_onto
from ..mesh.meshes import TetMesh
from ..volume.fill import fill
from ..volume.options import FillOptions

__all__ = ["certified_mean", "movement"]

Array = NDArray[np.float64]


def certified_mean(solid: TetMesh, points: Array, weight: float) -> tuple[TetMesh, Certificate]:
    """The template moved to the mean; inside as `fill` has it, where averaging turned a tet over.

    Raises
    ------
    CertificationError, SelfIntersectionError
        That does not help.
    """
    certificate = certify(solid, points)
    if not certificate.certified:
        options = FillOptions(volume_weight=weight, refine=False)
        found = fill(solid, points[solid.boundary_vertices], options=options)
        points, certificate = found.image, found.certificate
    return TetMesh(points, solid.T), certificate


def movement(solid: TetMesh, after: Array) -> float:
    """Root mean square way of the surface along its normals, in the same pose, over the size.

    Along the surface the vertices of a template may go on moving, slowly and all shapes alike:
    that changes neither its shape nor what corresponds.
    """
    skin, surface = solid.boundary_vertices, solid.surface
    ways = similarity_onto(solid.V, after)(solid.V)[skin] - after[skin]
    corners = after[skin][surface.F]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(areas, axis=1)
    along = np.einsum("mx,mx->m", ways[surface.F].mean(axis=1), areas) / lengths
    size = float(np.linalg.norm(np.ptp(after, axis=0)))
    return float(np.sqrt((lengths * along**2).sum() / lengths.sum())) / size
