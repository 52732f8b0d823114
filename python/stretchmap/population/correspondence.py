"""The map from a template to one solid of a population."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import as_reals
from ..base.options import one_of, real
from ..certificate.findings import Certificate
from ..deformation.fitting import Template
from ..deformation.smooth import settled, smooth_deformation
from ..errors import MeshError, OptionError, SolverError
from ..maps.result import MapResult
from ..mesh.given import as_solid
from ..mesh.meshes import TetMesh, TriMesh
from ..registration.map import register
from ..registration.result import Registration
from ..volume.fill import FillMap, fill
from ..volume.options import FillOptions

__all__ = ["Correspondence", "correspond"]

Along = Literal["smooth", "area"]

_FILLS, _EASINGS = 4, 3  # tries to fill a boundary, and how often it is evened out before the next

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Correspondence(MapResult):
    """A map from a template onto one solid of a population.

    Attributes
    ----------
    mesh : TetMesh
        The template, refined if refinement was needed; its own vertices come first.
    target : TetMesh
        The solid.
    image : ndarray, shape (n, 3)
        Boundary vertices go to the boundary.
    certificate : Certificate
    along : str
        What decided along the surface, ``"smooth"`` or ``"area"``. ``"area"`` although ``"smooth"``
        was asked for means that the smooth one could not be certified; ``note`` says why.
    note : str
    smooth : ndarray, shape (n0, 3)
        Where the smooth deformation takes the template's own vertices, near the solid; their images
        themselves for ``"area"``.
    distance : float
        Root mean square distance of the smooth deformation from the surface before its points were
        put onto it, over the size; NaN for ``"area"``.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.population import correspond
    >>> bones = sm.samples.vertebra_population(2, n_tets=600)
    >>> found = correspond(bones.solids[0], bones.solids[1])
    >>> found.certificate.certified, found.along
    (True, 'smooth')
    """

    _title: ClassVar[str] = "correspondence"

    mesh: TetMesh
    target: TetMesh = field()
    certificate: Certificate
    along: str
    note: str
    smooth: Array = field(repr=False)
    distance: float

    def extra_scalars(self) -> dict[str, Any]:
        """Certificate, and how the correspondence came about."""
        return {
            "certified": self.certificate.certified,
            "certificate": self.certificate.to_dict(),
            "along": self.along,
            "note": self.note,
            "distance": self.distance if np.isfinite(self.distance) else None,
        }

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """The target (``target_V``, ``target_T``)."""
        return {"target_V": self.target.V, "target_T": self.target.T}


def correspond(
    template: TetMesh | Template,
    solid: TetMesh,
    *,
    start: Array | None = None,
    landmarks: Array | None = None,
    along: Along = "smooth",
    volume_weight: float = 1.0,
) -> Correspondence:
    """Map a template onto a solid, point to corresponding point.

    Parameters
    ----------
    template : TetMesh or Template
        With a `Template` what is computed of it once serves for many solids.
    solid : TetMesh
        Both are solid tori.
    start : ndarray, shape (nb, 3), optional
        Where the template's boundary vertices go about. Without it the template is laid on the
        solid by landmarks, if there are three or more, or by the surfaces as rigid bodies.
    landmarks : ndarray, shape (l, 3), optional
        Where the landmarks of the template (``Template.anchors``) lie on the solid.
    along : {"smooth", "area"}
        What decides along the surface. ``"smooth"``: the smoothest deformation that brings surface
        onto surface, and inside the map of least distortion. ``"area"``: `register`, which keeps
        areas on the surface and volumes inside.
    volume_weight : float
        Of ``"smooth"``: weight of equal volumes against equal shape inside, as in `FillOptions`.

    Returns
    -------
    Correspondence

    Raises
    ------
    MeshError
        A mesh is no solid torus.
    CertificationError, SolverError
        No map could be certified.
    LandmarkError
        Landmarks contradict each other.
    ArrayError, NonFiniteError, OptionError
        An array of another shape, or an option out of range.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.population import correspond
    >>> solid = sm.samples.vertebra_like(600)
    >>> correspond(solid, solid, along="area").distortion.flips
    0
    """
    clock = time.perf_counter()
    given = template if isinstance(template, Template) else Template(as_solid(template, "template"))
    solid = as_solid(solid)
    for mesh in (given.solid, solid):
        mesh.require_solid_torus()
    if start is not None:
        start = as_reals(start, "start", given.solid.surface.V.shape)
    if landmarks is not None:
        if given.anchors is None:
            raise OptionError(
                "landmarks: the template has none; pass Template(solid, Anchors.of(solid.surface, "
                "points)) of stretchmap.deformation"
            )
        landmarks = as_reals(landmarks, "landmarks", (len(given.anchors.faces), 3))
    one_of("along", along, ("smooth", "area"))
    volume_weight = real("volume_weight", volume_weight, above=0.0)
    found: Registration | FillMap | None = None
    note, distance, moved = "", float("nan"), None
    if along == "smooth":
        found, moved, distance, note = _smooth(given, solid, start, landmarks, volume_weight)
    if found is None:
        # What is asked for by area is asked to keep volumes; what stands in for a smooth map is to
        # stay close to one.
        found = _registered(given, solid, landmarks, "glide" if along == "area" else "frozen")
        moved = found.image[: given.solid.n_vertices]
    return Correspondence(
        mesh=found.mesh,
        target=solid,
        image=found.image,
        certificate=found.certificate,
        along="area" if note or along == "area" else "smooth",
        note=note,
        smooth=np.asarray(moved),
        distance=distance,
        history=found.history,
        converged=found.converged,
        stop_reason=found.stop_reason,
        seconds={"all": time.perf_counter() - clock},
    )


def _registered(
    template: Template,
    solid: TetMesh,
    landmarks: Array | None,
    boundary: Literal["glide", "frozen"],
) -> Registration:
    marks = None
    if landmarks is not None and template.anchors is not None:
        surface = template.solid.surface
        marks = (template.anchors.at(surface.V, surface.F), landmarks)
    return register(template.solid, solid, marks, boundary=boundary)


def _smooth(
    template: Template,
    solid: TetMesh,
    start: Array | None,
    landmarks: Array | None,
    volume_weight: float,
) -> tuple[FillMap | None, Array, float, str]:
    """The smooth map, or why there is none; the deformation, its distance from the surface."""
    pose, fitted = smooth_deformation(template, solid, start, landmarks)
    distance = fitted.distance / template.spline.length
    goal = TriMesh(pose.back(solid.surface.V), solid.surface.F)
    points, moved = settled(template, goal, fitted.projected), pose(fitted.points)
    options = FillOptions(volume_weight=volume_weight)
    try:
        for _ in range(_FILLS):
            found = fill(template.solid, pose(points), options=options, keep_best=True)
            if found.certificate.certified:
                return found, moved, distance, ""
            points = _eased(template, goal, points, found)
        reason = found.certificate.reason
    except (MeshError, SolverError) as error:
        reason = str(error)
    return None, moved, distance, f"smooth correspondence given up: {reason}"


def _eased(template: Template, goal: TriMesh, points: Array, found: FillMap) -> Array:
    """Points of the goal, evened out beside tets that stayed inverted."""
    solid = template.solid
    inverted = TetMesh(found.image, found.mesh.T).tet_volumes <= 0.0
    corners = found.mesh.T[inverted].ravel()
    rows = solid.boundary_index[corners[corners < solid.n_vertices]]
    beside = np.zeros(len(points))
    beside[rows[rows >= 0]] = 1.0
    moving = (template.ring_mean @ beside + beside) > 0.0
    eased = np.array(points)
    tree = _core.maps.SurfaceTree(goal.V, goal.F)
    for _ in range(_EASINGS):
        eased[moving] = tree.closest((template.ring_mean @ eased)[moving])[0]
    return eased
