"""What a volume map returns."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any, ClassVar

from numpy.typing import NDArray

from .. import _core
from ..area.result import AreaMap
from ..base.arrays import read_only
from ..base.torus import Torus
from ..certificate.checks import certify
from ..certificate.findings import Certificate
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh
from ..mesh.refinement import Refinement
from .problem import Outcome

__all__ = ["VolumeMap", "volume_result"]

_LEAST = 1e-12  # volume of an image; those of sound ones are near 1


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class VolumeMap(MapResult):
    """A map of a solid onto the solid torus.

    Attributes
    ----------
    mesh : TetMesh
        The mesh that was mapped: the input, or its refinement (see ``refinement``); the first
        vertices are those of the input.
    image : ndarray, shape (n, 3)
        Image of each vertex. The image has the volume of the source.
    torus : Torus
        Boundary vertices lie on it.
    method : str
        ``"certified"``, ``"vsem"`` or the name of an optimizer of your own.
    boundary : str
        ``"frozen"`` or ``"glide"``; ``"own"`` where the optimizer saw to it.
    boundary_map : AreaMap or None
        The boundary map; None if the boundary was prescribed.
    refinement : Refinement or None
        How ``mesh`` came from the input, if it was refined.
    history : tuple of IterationRecord
        Stages ``"vsem"``, ``"untangle"``, ``"frozen"``, ``"glide"``, ``"equalize"``, ``"exact"``,
        in that order. ``energy`` is the stretch energy in the first, the distortion energy in the
        next three, the largest error of a marginal volume in ``"equalize"`` and the largest error
        of a ring volume in ``"exact"``.
    distortion : Distortion
    certificate : Certificate
        Whether the map is proven to be a bijection, computed independently of the optimisation.
    converged : bool
    stop_reason : str
    seconds : dict
        Wall-clock time per stage; ``"other starts"``: of those that led nowhere.
    vertex_exact : bool
        Whether the ring volumes of all interior vertices were made exact.

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.volume_map(sm.samples.bumpy_torus(1000))
    >>> u, v, s = result.coordinates().T
    >>> result.method, result.boundary, result.certificate.certified
    ('certified', 'glide', True)
    """

    _title: ClassVar[str] = "volume"

    mesh: TetMesh
    torus: Torus = field()
    method: str
    boundary: str
    boundary_map: AreaMap | None = field(repr=False)
    refinement: Refinement | None = field(repr=False)
    certificate: Certificate
    vertex_exact: bool = False

    @property
    def filled(self) -> float:
        """What the image encloses over the torus' volume.

        Flat boundary faces cut off the rest; where they span the hole they lie outside, so that it
        may be a little more than 1.
        """
        return self.distortion.image_total / self.torus.volume

    def extra_scalars(self) -> dict[str, Any]:
        """Method, boundary, what the image fills and what was added to the input mesh."""
        added = self.refinement
        certificate = self.certificate
        return {
            "certified": certificate.certified,
            "certificate": certificate.to_dict(),
            "method": self.method,
            "boundary": self.boundary,
            "vertex_exact": self.vertex_exact,
            "filled": self.filled,
            "added_vertices": 0 if added is None else added.n_split,
            "added_tets": 0 if added is None else added.n_added_tets,
        }

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """``parent_tet`` (k,), the input tet of each tet, if the mesh was refined."""
        return {} if self.refinement is None else {"parent_tet": self.refinement.parent_tet}


def volume_result(outcome: Outcome, method: str, boundary: str, start: MapResult) -> VolumeMap:
    """What came of a problem, scaled to the volume of the source and certified."""
    problem, refinement = outcome.problem, outcome.problem.refinement
    assert problem.torus is not None
    volume = float(_core.mesh.tet_volumes(problem.x, problem.solid.T).sum())
    # Of what has been folded until it is inside out as a whole, the certificate says that it is.
    scale = (problem.solid.volume / max(abs(volume), _LEAST)) ** (1.0 / 3.0)
    image, torus = problem.x * scale, problem.torus.scaled(scale)
    clock = time.perf_counter()
    certificate = certify(problem.solid, image, torus)
    seconds = {**outcome.seconds, "certificate": time.perf_counter() - clock}
    converged, stop_reason = outcome.converged, outcome.stop_reason
    if method == "certified" and converged and not certificate.certified:
        converged, stop_reason = False, f"{stop_reason}, but {certificate.reason}"
    boundary_map = start if isinstance(start, AreaMap) else None
    if boundary_map is not None:
        seconds = {"boundary": sum(boundary_map.seconds.values()), **seconds}
    return VolumeMap(
        mesh=problem.solid,
        image=read_only(image),
        torus=torus,
        method=method,
        boundary=boundary,
        boundary_map=boundary_map,
        refinement=refinement if refinement is not None and refinement.n_split else None,
        history=outcome.history,
        certificate=certificate,
        converged=converged,
        stop_reason=stop_reason,
        seconds=seconds,
        vertex_exact=outcome.vertex_exact,
    )
