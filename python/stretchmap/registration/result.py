"""What a registration returns."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ..certificate.findings import Certificate
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh
from ..mesh.refinement import Refinement
from .flat_torus import Gauge
from .landmarks import Landmarks
from .quality import surface_distance

__all__ = ["LandmarkMap", "Registration"]

LandmarkMap = Literal["smooth", "affine"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Registration(MapResult):
    """A map from one solid torus onto another.

    Attributes
    ----------
    mesh : TetMesh
        The source, refined if refinement was needed, on the boundary, too; the first vertices are
        those of the input.
    target : TetMesh
    image : ndarray, shape (n, 3)
        Image of each vertex; boundary vertices lie on the target's surface, landmarks on their
        counterparts.
    landmarks : Landmarks
    landmark_error : float
        Largest distance of a landmark's image from its counterpart, as a share of the diagonal of
        the target's bounding box.
    gauge : Gauge
        How the flat tori were laid on each other.
    landmark_map : str
        ``"smooth"`` or ``"affine"``.
    refinement : Refinement or None
        Of the source, its boundary edges split first.
    boundary : str
        ``"glide"`` or ``"frozen"``: whether boundary vertices moved on the target's surface to keep
        volumes below it.
    boundary_splits : int
        Edges of the source's boundary that were split where it was too coarse: its image would
        cross itself, or the affine map turn a face over.
    history : tuple of IterationRecord
        Stages ``"match"``, ``"untangle"``, ``"frozen"``, ``"glide"``.
    distortion : Distortion
    certificate : Certificate
    converged : bool
    stop_reason : str
    seconds : dict
    torus : None

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.register(sm.samples.solid_torus(600), sm.samples.bumpy_torus(1000))
    >>> there = result.forward(result.mesh.V[:3])
    >>> there.shape, result.torus is None
    ((3, 3), True)
    """

    _title: ClassVar[str] = "registration"

    mesh: TetMesh
    target: TetMesh = field()
    torus: None = None
    landmarks: Landmarks
    landmark_error: float
    gauge: Gauge
    landmark_map: LandmarkMap
    refinement: Refinement | None = field(repr=False)
    boundary: str
    boundary_splits: int
    certificate: Certificate

    @cached_property
    def surface_distance(self) -> float:
        """Hausdorff distance of the image's boundary from the target's, as `surface_distance`."""
        return surface_distance(self)

    def extra_scalars(self) -> dict[str, Any]:
        """Landmarks, gauge, landmark map and what was added to the input mesh."""
        added = self.refinement
        snapped = self.landmarks.snapped
        return {
            "certified": self.certificate.certified,
            "certificate": self.certificate.to_dict(),
            "boundary": self.boundary,
            "landmark_map": self.landmark_map,
            "landmarks": len(self.landmarks),
            "landmark_error": self.landmark_error,
            "surface_distance": self.surface_distance,
            "snapped": float(snapped.max()) if snapped.size else 0.0,
            "gauge": dataclasses.asdict(self.gauge),
            "boundary_splits": self.boundary_splits,
            "added_vertices": 0 if added is None else added.n_split - self.boundary_splits,
            "added_tets": 0 if added is None else added.n_added_tets,
        }

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """The target (``target_V``, ``target_T``), the landmarks (k, 2), and, if the mesh was
        refined, the input tet of each tet, ``parent_tet``."""
        added = {} if self.refinement is None else {"parent_tet": self.refinement.parent_tet}
        pairs = np.stack([self.landmarks.source, self.landmarks.target], axis=1)
        return {"target_V": self.target.V, "target_T": self.target.T, "landmarks": pairs, **added}
