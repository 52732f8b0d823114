"""Volume maps with a prescribed boundary, of solids of any genus."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_points, describe, read_only
from ..base.options import callback, flag, instance
from ..base.progress import Progress
from ..base.threads import takes_threads
from ..certificate.checks import certify
from ..certificate.findings import Certificate, require_certified
from ..errors import ArrayError, GenusError
from ..homology.bounding import require_bounding_alike
from ..maps.result import MapResult
from ..mesh.crossings import UNLESS_KEPT, require_no_crossing
from ..mesh.given import as_solid
from ..mesh.meshes import TetMesh, TriMesh
from ..mesh.refinement import Refinement
from .engine import solve
from .options import FillOptions, check_prescribed
from .problem import Outcome, VolumeProblem

__all__ = ["FillMap", "fill", "filled"]

_log = logging.getLogger("stretchmap")


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class FillMap(MapResult):
    """A map of a solid whose boundary goes where it was told to.

    Attributes
    ----------
    mesh, solid : TetMesh
        The mesh that was mapped: the input, or its refinement (see ``refinement``). The first
        vertices are those of the input, the boundary is the same.
    image : ndarray, shape (n, 3)
        Image of each vertex; of boundary vertices the one prescribed, bit for bit.
    refinement : Refinement or None
        How ``mesh`` came from the input, if it was refined.
    history : tuple of IterationRecord
        Stages ``"untangle"`` and ``"frozen"``, their ``energy`` the distortion energy.
    distortion : Distortion
    certificate : Certificate
        Whether the map is proven to be a bijection, computed independently of the optimization.
    converged : bool
    stop_reason : str
    seconds : dict
        Wall-clock time per stage.
    torus : None

    Examples
    --------
    >>> import stretchmap as sm
    >>> ball = sm.samples.ball(2)
    >>> result = sm.fill(ball, ball.surface.V + 0.1 * ball.surface.V[:, [1, 2, 0]] ** 2)
    >>> result.solid is result.mesh, result.distortion.flips
    (True, 0)
    """

    _title: ClassVar[str] = "fill"

    mesh: TetMesh
    refinement: Refinement | None = field(repr=False)
    certificate: Certificate

    @property
    def solid(self) -> TetMesh:
        """The mesh that was mapped."""
        return self.mesh

    def extra_scalars(self) -> dict[str, Any]:
        """The certificate, and what was added to the input mesh."""
        added, certificate = self.refinement, self.certificate
        return {
            "certified": certificate.certified,
            "certificate": certificate.to_dict(),
            "added_vertices": 0 if added is None else added.n_split,
            "added_tets": 0 if added is None else added.n_added_tets,
        }

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """``parent_tet`` (k,), the input tet of each tet, if the mesh was refined."""
        return {} if self.refinement is None else {"parent_tet": self.refinement.parent_tet}


@takes_threads
def fill(
    solid: TetMesh,
    boundary_image: ArrayLike,
    *,
    options: FillOptions | None = None,
    keep_best: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> FillMap:
    """Extend a map of the boundary of a solid to the inside, one to one and with little distortion.

    Parameters
    ----------
    solid : TetMesh
        One component with one boundary surface, of any genus.
    boundary_image : array_like, shape (nb, 3)
        Where the boundary vertices go, in the order of ``solid.boundary_vertices``. The image of
        the boundary must not cross or touch itself. Whether the inside can follow is a matter of
        topology: the boundary map has to take loops that bound a disk inside to such loops.
    options : FillOptions, optional
    keep_best : bool
        Return the best map found even if it is not certified.
    threads : int, optional
        Threads to use, see `threads`; the result depends on it only where time runs short.
    progress : Progress, optional
        Called once per step.

    Returns
    -------
    FillMap
        Volumes are preserved as far as the boundary allows: a piece expects its share of the volume
        enclosed, unless the boundary round it is squeezed or stretched by far.

    Raises
    ------
    ArrayError
        ``boundary_image`` has another shape.
    NonFiniteError
        It holds a NaN or an infinity.
    OrientationError
        The boundary image is inside out.
    SelfIntersectionError
        It crosses itself; ``ids`` are pairs of boundary faces (``solid.surface.F``). Or the
        boundary of the solid does.
    GenusError
        What bounds in the solid, as meridians do, does not bound behind the image; without
        ``keep_best``.
    MeshError
        The solid has a defect, see `TetMesh.diagnose`, or a cavity.
    DegenerateError
        ``refine=False`` and some interior edge or face cannot be repaired; ``ids`` are the tets.
    CertificationError
        Tets stay inverted, ``ids`` are those.
    OptionError
        An option out of range, or one of a boundary that glides.

    Notes
    -----
    Foldover-free maps by regularization: Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov,
    ACM TOG 40(4), 2021. Where no position of the inner vertices serves, edges are halved; the
    boundary and the rows of the input stay as they are.

    Examples
    --------
    >>> import stretchmap as sm
    >>> ball = sm.samples.ball(3)
    >>> squeezed = ball.surface.V * [2.0, 1.0, 0.25]
    >>> result = sm.fill(ball, squeezed)
    >>> result.certificate.certified
    True
    """
    flag("keep_best", keep_best)
    callback("progress", progress)
    solid = as_solid(solid)
    _require_one_boundary(solid)
    points = as_points(boundary_image, "boundary_image")
    if points.shape != solid.surface.V.shape:
        raise ArrayError(
            f"boundary_image must have shape {solid.surface.V.shape}, one row per boundary vertex, "
            f"got {points.shape}"
        )
    options = FillOptions() if options is None else options
    instance("options", options, FillOptions, "FillOptions(...)")
    check_prescribed(options, glide=False)
    if not keep_best:
        require_no_crossing(solid.surface, "the boundary of the solid", UNLESS_KEPT)
    result = filled(solid, points, options, progress, anyway=keep_best)
    if not keep_best:
        require_certified(result.certificate, "the map")
    return result


def filled(
    solid: TetMesh,
    points: NDArray[np.float64],
    options: FillOptions,
    progress: Progress | None = None,
    *,
    anyway: bool = False,
) -> FillMap:
    """`fill` of checked arguments, even ``anyway`` where no map can be one to one."""
    clock = time.perf_counter()
    problem = VolumeProblem.of(solid, points, refine=options.refine)
    image = TriMesh(points, solid.surface.F)
    require_no_crossing(image, "the boundary image", "no map of the inside can be one to one")
    if not anyway:
        require_bounding_alike(solid, image)
    seconds = {"check": time.perf_counter() - clock}
    outcome = solve(problem, options, progress=progress)
    return _result(outcome, solid, points, seconds)


def _require_one_boundary(solid: TetMesh) -> None:
    diagnosis = solid.diagnose()
    diagnosis.require()
    if len(diagnosis.genus) != 1:
        raise GenusError(
            f"the boundary of the solid has {len(diagnosis.genus)} components; only solids without "
            f"cavities can be mapped: fill them ({describe('vertex', diagnosis.cavity_vertices)})",
            diagnosis.cavity_vertices,
        )


def _result(
    outcome: Outcome, given: TetMesh, points: NDArray[np.float64], seconds: dict[str, float]
) -> FillMap:
    problem, refinement = outcome.problem, outcome.problem.refinement
    image = problem.x * problem.length + problem.center
    image[given.boundary_vertices] = points
    clock = time.perf_counter()
    certificate = certify(problem.solid, image)
    seconds = {**seconds, **outcome.seconds, "certificate": time.perf_counter() - clock}
    if not outcome.converged:
        _log.warning("volume map not converged: %s", outcome.stop_reason)
    return FillMap(
        mesh=problem.solid,
        image=read_only(image),
        refinement=refinement if refinement is not None and refinement.n_split else None,
        history=outcome.history,
        certificate=certificate,
        converged=outcome.converged and certificate.certified,
        stop_reason=outcome.stop_reason,
        seconds=seconds,
    )
