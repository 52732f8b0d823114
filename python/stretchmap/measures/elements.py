"""Measures of distortion: (6.1)-(6.5), per-element ratios, signed flips, angles, stretch energies.

Sizes of image elements are signed throughout; an absolute value would hide a fold. The paper's
"total distortion" carries the factor 1/4 both for volumes (6.4), where every tet has four corners,
and for areas (6.2), although a face has three; it is kept as printed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_points, as_reals, read_only
from ..base.options import instance
from ..base.tables import HasSummary, plain_dict, table
from ..base.torus import Torus
from ..errors import DegenerateError, OptionError, OrientationError
from ..mesh.given import as_mesh
from ..mesh.meshes import TetMesh, TriMesh
from .orientation import chart_areas, outward_areas

__all__ = ["Distortion", "distortion"]


@dataclass(frozen=True, eq=False)
class Distortion(HasSummary):
    """How far a piecewise-affine map is from preserving area or volume.

    Sizes are areas for a surface and volumes for a solid, normalised by their totals, so that a
    map which only scales has every ratio equal to 1.

    Attributes
    ----------
    flips : int or None
        Elements whose image does not have positive signed size; None for a surface without a
        reference for its orientation (see :func:`distortion`).
    total_distortion : float
        D_area (6.2) or D_volume (6.4), both with the factor 1/4.
    ring_mean, ring_std, ring_min, ring_max : float
        Of the per-vertex ratios (6.3) or (6.5); population standard deviation.
    element_error_mean : float
        Mean over the elements of ``|ratio - 1|``.
    element_std : float
        Standard deviation of the elements' ratios.
    element_error_std : float
        Standard deviation of ``|ratio - 1|``, the figure some papers print beside the mean.
    ratio_min, ratio_max : float
        Of the elements' signed ratios.
    angle_mean, angle_max : float
        Distortion of angles over the elements that are not flipped, 1 for a similarity. Faces:
        ratio of the singular values. Tets: ``tr(J^T J) / (3 det(J)^(2/3))``.
    stretch_energy : float
        ``sum |g(t)|^2 / |t|`` for areas, ``3/2 sum |f(t)|^2 / |t|`` for volumes.
    stretch_bound : float
        Its lower bound ``A^2 / |M|``, resp. ``3/2 V^2 / |M|``, reached exactly when all ratios
        agree.
    conformal_energy : float or None
        (6.1) of a surface, Dirichlet energy minus signed area; None for a solid.
    source_total, image_total : float
        Total size of source and image, the latter signed.
    ratios : ndarray, shape (m,)
        Signed ratio of each element.
    ring_ratios : ndarray, shape (n,)
        Ratio of each vertex; NaN at a vertex no element uses.
    angles : ndarray, shape (m,)
        Distortion of angles of each element; infinite where it is flipped.
    flipped : ndarray of int, shape (flips,)
        Ids of the flipped elements.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> found = sm.distortion(solid, solid.V * [1.0, 1.0, 2.0])
    >>> found.flips, round(found.element_std, 12), round(found.angle_mean, 3)
    (0, 0.0, 1.26)
    """

    flips: int | None
    total_distortion: float
    ring_mean: float
    ring_std: float
    ring_min: float
    ring_max: float
    element_error_mean: float
    element_std: float
    element_error_std: float
    ratio_min: float
    ratio_max: float
    angle_mean: float
    angle_max: float
    stretch_energy: float
    stretch_bound: float
    conformal_energy: float | None
    source_total: float
    image_total: float
    ratios: NDArray[np.float64] = field(repr=False)
    ring_ratios: NDArray[np.float64] = field(repr=False)
    angles: NDArray[np.float64] = field(repr=False)
    flipped: NDArray[np.intp] = field(repr=False)

    def __repr__(self) -> str:
        flips = "unknown" if self.flips is None else self.flips
        return (
            f"Distortion(flips {flips}, std {self.element_std:.4g}, ring std {self.ring_std:.4g})"
        )

    def report(self) -> dict[str, float | int | None]:
        """What the report of a map says of it."""
        names = (
            "flips", "ring_mean", "ring_std", "element_error_mean", "element_std",
            "element_error_std", "ratio_min", "ratio_max", "total_distortion", "angle_mean",
            "angle_max",
        )  # fmt: skip
        energies = {"energy": self.stretch_energy, "energy_bound": self.stretch_bound}
        return {name: getattr(self, name) for name in names} | energies

    def to_dict(self) -> dict[str, float | int | None]:
        """The scalars, JSON-compatible."""
        arrays = ("ratios", "ring_ratios", "angles", "flipped")
        return plain_dict({k: v for k, v in self.__dict__.items() if k not in arrays})

    def summary(self) -> str:
        """A table of the scalars."""
        return table(self.to_dict())


def distortion(
    mesh: TriMesh | TetMesh,
    image: ArrayLike,
    *,
    torus: Torus | None = None,
    angles: ArrayLike | None = None,
) -> Distortion:
    """Measure a map given by the images of the vertices.

    Parameters
    ----------
    mesh : TriMesh or TetMesh
        The source, with n vertices and m elements.
    image : array_like, shape (n, 3)
        Image of each vertex.
    torus : Torus, optional
        For a surface: faces count as flipped where the image of their outward side faces into this
        torus. Ignored for a solid.
    angles : array_like, shape (n, 2), optional
        For a surface, instead of ``torus``: chart coordinates (u, v) in radians; faces count as
        flipped where they are negative in the chart, each edge taken the short way round. Ignored
        for a solid.

    Returns
    -------
    Distortion

    Raises
    ------
    ArrayError
        If ``image`` or ``angles`` has the wrong shape or holds no real numbers.
    NonFiniteError
        If ``image`` or ``angles`` holds a NaN or an infinity; ``ids`` are the vertices.
    DegenerateError
        If a source element has no size, the mesh has no element, or the image no size in all;
        ``ids`` are the elements.
    OrientationError
        If a source tet is inverted; ``ids`` are the tets.
    OptionError
        If both ``torus`` and ``angles`` are given.

    Notes
    -----
    Without ``torus`` or ``angles`` the orientation of a surface's image is not known: its areas are
    taken as positive and ``flips`` is None.

    Examples
    --------
    Twice as high is twice the volume everywhere: no distortion of volume, some of angles.

    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> found = sm.distortion(solid, solid.V * [1.0, 1.0, 2.0])
    >>> round(found.image_total / found.source_total, 12), round(found.ring_std, 12)
    (2.0, 0.0)
    >>> found.angle_mean > 1.0
    True
    """
    mesh = as_mesh(mesh)
    points = as_points(as_reals(image, "image", (len(mesh.V), 3)), "image")
    if torus is not None:
        instance("torus", torus, Torus, "Torus(R, r)")
    if angles is not None:
        angles = as_reals(angles, "angles", (len(mesh.V), 2))
    if isinstance(mesh, TetMesh):
        oriented = True
        elements = mesh.T
        measures = _core.measures.tet_measures(mesh.V, elements, points)
        factor = 1.5
    else:
        sign = _orientation(mesh, points, torus, angles)
        oriented = sign is not None
        elements = mesh.F
        sign = np.ones(len(elements)) if sign is None else sign
        measures = _core.measures.face_measures(mesh.V, elements, points, sign)
        factor = 1.0
    source, target = measures.source, measures.image
    require_sizes(source)

    source_total, image_total = float(source.sum()), float(target.sum())
    if image_total == 0.0:
        raise DegenerateError("the image has no area or volume; ratios are not defined")
    source_share, image_share = source / source_total, target / image_total
    ratios = image_share / source_share
    source_ring = _core.measures.ring_sums(elements, source_share, len(mesh.V))
    image_ring = _core.measures.ring_sums(elements, image_share, len(mesh.V))
    used = source_ring > 0.0
    ring_ratios = np.full(len(mesh.V), math.nan)
    np.divide(image_ring, source_ring, out=ring_ratios, where=used)
    ring = ring_ratios[used]
    deviation = np.abs(ratios - 1.0)
    good = np.isfinite(measures.angle)
    flipped = np.flatnonzero(~(target > 0.0))
    return Distortion(
        flips=len(flipped) if oriented else None,
        total_distortion=0.25 * float(np.abs(source_ring - image_ring).sum()),
        ring_mean=float(ring.mean()),
        ring_std=float(ring.std()),
        ring_min=float(ring.min()),
        ring_max=float(ring.max()),
        element_error_mean=float(deviation.mean()),
        element_std=float(ratios.std()),
        element_error_std=float(deviation.std()),
        ratio_min=float(ratios.min()),
        ratio_max=float(ratios.max()),
        angle_mean=float(measures.angle[good].mean()) if good.any() else math.inf,
        angle_max=float(measures.angle[good].max()) if good.any() else math.inf,
        stretch_energy=factor * float((target * (target / source)).sum()),
        stretch_bound=factor * image_total**2 / source_total,
        conformal_energy=None if isinstance(mesh, TetMesh) else float(measures.conformal.sum()),
        source_total=source_total,
        image_total=image_total,
        ratios=read_only(ratios),
        ring_ratios=read_only(ring_ratios),
        angles=measures.angle,
        flipped=read_only(flipped),
    )


def require_sizes(source: NDArray[np.float64]) -> None:
    """Raise where a source element has no positive area or volume; ``ids`` are the elements."""
    if not len(source):
        raise DegenerateError("the mesh has no elements")
    inverted = np.flatnonzero(source < 0.0)
    if len(inverted):
        raise OrientationError(
            f"{len(inverted)} tets of the source are inverted; repair the mesh (orient=True turns "
            "tets that are only numbered the wrong way round)",
            inverted,
        )
    empty = np.flatnonzero(source == 0.0)
    if len(empty):
        raise DegenerateError(
            f"{len(empty)} source elements have no size, their ratios are not defined", empty
        )


def _orientation(
    mesh: TriMesh,
    image: NDArray[np.float64],
    torus: Torus | None,
    angles: NDArray[np.float64] | None,
) -> NDArray[np.float64] | None:
    """(m,) +1, -1 or 0 per face, None without a reference."""
    if torus is not None and angles is not None:
        raise OptionError("give torus or angles as the reference of orientation, not both")
    if angles is not None:
        return np.sign(chart_areas(mesh.F, angles))
    if torus is None:
        return None
    return np.sign(outward_areas(image, mesh.F, torus))
