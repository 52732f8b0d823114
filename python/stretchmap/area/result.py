"""What `area_map` returns."""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from ..base.options import instance
from ..base.torus import Torus
from ..certificate.checks import certify
from ..certificate.findings import Certificate
from ..errors import OptionError
from ..maps.history import IterationRecord
from ..maps.result import MapResult
from ..mesh.halved_faces import SurfaceRefinement

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh
    from .route import Made

__all__ = ["AreaMap", "mapped", "moved", "n_folded"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class AreaMap(MapResult):
    """An area-preserving map onto a torus of revolution.

    Attributes
    ----------
    mesh : TriMesh
        The surface that was mapped: the input, or its refinement (see ``refinement``); the first
        vertices are those of the input.
    angles : ndarray, shape (n, 2)
        Angles (u, v) of the image in radians, not reduced to one turn: ``2 pi forms + d angles`` is
        the change along an edge. They do not depend on the size of the torus.
    image : ndarray, shape (n, 3)
        Points on ``torus``.
    torus : Torus
        Torus with the surface's area and the ratio of radii in ``ratio``.
    phase : float
        Turns of the equal-area coordinate around the tube that were added to the conformal map's.
    ratio : float
        ``R / r`` of the torus.
    forms : ndarray, shape (2, e), int32
        Integer closed 1-forms of u and v, as in `ConformalMap`.
    refinement : SurfaceRefinement or None
        How ``mesh`` came from the input, if it was refined.
    history : tuple of IterationRecord
        One record per iteration: stage ``"coarse"`` where a surface of more than 40,000 faces was
        mapped by way of coarser ones; stage ``"sem"`` measured in the equal-area chart, its energy
        E_S (4.1) of shares, at least 1; stage ``"balance"``, Newton steps in that chart where the
        first jams; stages ``"untangle"``, ``"approach"``, whichever way faces look meanwhile, and
        ``"newton"`` on the polyhedral image, the energy of the last that of the finishing solve
        over the weight of its area term: within ``"sem"`` and ``"newton"`` it never rises. There
        ``flips`` are the faces that do not look outward along the whole face, what the certificate
        checks.
    certificate : Certificate
        Whether the map is proven to be one to one, computed independently of how it was found.
    distortion : Distortion
        Of the polyhedral image; a face is flipped where it looks into the torus.
    converged : bool
    stop_reason : str
    seconds : dict
        Wall-clock time per stage.

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.area_map(sm.samples.torus_surface(24, 12))
    >>> larger = sm.Torus.from_ratio(result.ratio, area=4.0 * result.torus.area)
    >>> result.image_on(larger).shape
    (288, 3)
    """

    _title: ClassVar[str] = "area"

    mesh: TriMesh
    torus: Torus = field()
    angles: NDArray[np.float64] = field(repr=False)
    phase: float
    ratio: float
    forms: NDArray[np.int32] = field(repr=False)
    refinement: SurfaceRefinement | None = field(default=None, repr=False)
    certificate: Certificate = field(repr=False)

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """``angles`` (n, 2), ``forms`` (2, e) and, if the input was refined, ``parent_face`` (m,),
        the input face of each face."""
        added = {} if self.refinement is None else {"parent_face": self.refinement.parent_face}
        return {"angles": self.angles, "forms": self.forms, **added}

    def extra_scalars(self) -> dict[str, Any]:
        """``phase`` and ``ratio``, what was added, and what the certificate says."""
        added = self.refinement
        return {
            "phase": self.phase,
            "ratio": self.ratio,
            "added_vertices": 0 if added is None else added.n_split,
            "added_faces": 0 if added is None else added.n_added_faces,
            "certified": self.certificate.certified,
            "certificate": self.certificate.to_dict(),
        }

    def image_on(self, torus: Torus) -> NDArray[np.float64]:
        """The same map on a torus of another size, (n, 3).

        Raises
        ------
        OptionError
            If the torus has another ratio of radii: the map would not preserve areas there.
        """
        instance("torus", torus, Torus, "Torus(R, r)")
        if not math.isclose(torus.ratio, self.ratio, rel_tol=1e-9):
            raise OptionError(f"the map is for R / r = {self.ratio}, the torus has {torus.ratio}")
        return torus.xi(self.angles[:, 0], self.angles[:, 1])


def mapped(
    surface: TriMesh,
    forms: NDArray[np.int32],
    made: Made,
    torus: Torus | None,
    refinement: SurfaceRefinement | None = None,
) -> AreaMap:
    """The map of angles, with its certificate."""
    clock = time.perf_counter()
    torus = torus or Torus.from_ratio(made.ratio, area=surface.area)
    image = torus.xi(made.angles[:, 0], made.angles[:, 1])
    certificate = certify(surface, image, torus)
    return AreaMap(
        mesh=surface,
        angles=read_only(made.angles),
        image=read_only(image),
        torus=torus,
        phase=made.phase,
        ratio=made.ratio,
        forms=forms,
        refinement=refinement,
        certificate=certificate,
        history=tuple(made.history),
        converged=made.converged,
        stop_reason=made.reason,
        seconds={**made.seconds, "certificate": time.perf_counter() - clock},
    )


def moved(
    start: AreaMap, angles: NDArray[np.float64], records: list[IterationRecord], clock: float
) -> AreaMap:
    """A map whose vertices steps have moved on since ``clock``, certified anew."""
    image = start.torus.xi(angles[:, 0], angles[:, 1])
    return dataclasses.replace(
        start,
        angles=read_only(angles),
        image=read_only(image),
        certificate=certify(start.mesh, image, start.torus),
        history=start.history + tuple(records),
        seconds={**start.seconds, "finish": time.perf_counter() - clock},
    )


def n_folded(found: AreaMap) -> int:
    """Faces that look inward or cross each other, at most a thousand or two of each."""
    ids = found.certificate.ids
    return sum(len(ids.get(check, ())) for check in ("boundary_oriented", "boundary_embedded"))
