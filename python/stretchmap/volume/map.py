"""Maps of a solid onto the standard solid torus that preserve volume."""

from __future__ import annotations

import dataclasses
import logging
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..area.map import area_map
from ..area.result import AreaMap
from ..base.arrays import read_only
from ..base.options import callback, flag, instance, one_of, real, whole
from ..base.progress import Progress
from ..base.threads import takes_threads
from ..base.torus import Torus
from ..certificate.checks import certify
from ..certificate.findings import Certificate
from ..errors import KindError, OptionError
from ..maps.files import LoadedMap
from ..maps.result import MapResult
from ..mesh.given import as_solid, require_same_mesh
from ..mesh.meshes import TetMesh
from ..mesh.refinement import Refinement
from .boundary_starts import boundary_starts
from .engine import require_certified, solve
from .model import Budget
from .options import VolumeOptions, weight_at
from .own import Optimizer, run_optimizer
from .problem import Outcome, VolumeProblem
from .vsem import run_vsem

__all__ = ["VolumeMap", "volume_map"]

_log = logging.getLogger("stretchmap")

# Peak resident bytes per tet of a whole call, mesh and result included, rounded up from what was
# measured on generated solid tori of 1e6 tets: 594 and 1261 (493 for "vsem" at 1e7).
_BYTES_PER_TET = {"vsem": 600, "certified": 1300}
# Larger runs say beforehand how much they need.
_LARGE = 1_000_000
# Share of the time left that untangling may take, from each start.
_PATIENCE = (0.5, 0.8, 0.8, 1.0)


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

    def extra_scalars(self) -> dict[str, Any]:
        """Method, boundary and what was added to the input mesh."""
        added = self.refinement
        certificate = self.certificate
        return {
            "certified": certificate.certified,
            "certificate": certificate.to_dict(),
            "method": self.method,
            "boundary": self.boundary,
            "vertex_exact": self.vertex_exact,
            "added_vertices": 0 if added is None else added.n_split,
            "added_tets": 0 if added is None else added.n_added_tets,
        }

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """``parent_tet`` (k,), the input tet of each tet, if the mesh was refined."""
        return {} if self.refinement is None else {"parent_tet": self.refinement.parent_tet}


@takes_threads
def volume_map(
    solid: TetMesh,
    *,
    method: Literal["certified", "vsem"] | None = None,
    boundary: Literal["glide", "frozen"] | None = None,
    c: float | None = None,
    balance: float | None = None,
    max_iter: int | None = None,
    start: AreaMap | VolumeMap | LoadedMap | None = None,
    optimizer: Optimizer | None = None,
    options: VolumeOptions | None = None,
    keep_best: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> VolumeMap:
    """Map a solid with a hole onto the solid torus, every piece keeping its volume.

    Parameters
    ----------
    solid : TetMesh
        A solid torus.
    method : {"certified", "vsem"}, optional
        ``"certified"``: a bijection with the least volume distortion, proven by a certificate; in
        the end the volumes between level surfaces of u, v and s (with a frozen boundary: of s) are
        made equal to those of the source.
        ``"vsem"``: Algorithm 5.1 as it stands in the paper; may leave flipped tets, which are
        reported. Default: ``"vsem"`` if ``c`` is given, else ``"certified"``.
    boundary : {"glide", "frozen"}, optional
        Certified route only. ``"glide"`` (default) lets boundary vertices move on the torus,
        ``"frozen"`` keeps them where the area-preserving map put them.
    c : float, optional
        Regularization constant of (5.6) of the ``"vsem"`` method, dimensionless, default 0.
    balance : float, optional
        Certified route only: from 0, pieces keep their shape, to 1, they keep their volume
        (default). The volume term weighs ``10^(6 balance - 2)`` times the shape term; below 1 the
        volumes between level surfaces are left as they come. Where all tets are stretched along an
        axis more than three times, shape is that of the solid with this undone.
    max_iter : int, optional
        Most steps of ``"vsem"`` (default 20) or of each last stage of ``"certified"``.
    start : AreaMap, VolumeMap or LoadedMap, optional
        A map of ``solid.surface`` to prescribe the boundary, or a map of ``solid``, or of its
        refinement, to go on from.
    optimizer : callable, optional
        ``optimizer(solid, image, torus)`` returns a better image, see `Optimizer`: a method of your
        own in place of ours, from the same start, measured and certified alike.
    options : VolumeOptions, optional
        All other options.
    keep_best : bool
        Return the best map found even if it is not certified.
    threads : int, optional
        Threads to use, see `threads`; the result does not depend on it.
    progress : Progress, optional
        Called once per step.

    Returns
    -------
    VolumeMap

    Raises
    ------
    MeshError
        The mesh is not a solid torus, see `TetMesh.require_solid_torus`.
    DegenerateError
        ``refine=False`` and some interior edge or face cannot be repaired; ``ids`` are the tets.
    CertificationError
        The certified route left flipped tets or failed the certificate, ``ids`` are the elements.
    KindError
        ``start`` belongs to another mesh, or names no torus.
    ArrayError, NonFiniteError, OrientationError
        The optimizer returned no image, or one without positive volume.
    OptionError
        An option out of range or combined with one it excludes.
    SolverError
        A linear solve of Algorithm 5.1 broke down.

    Notes
    -----
    Before a run of more than a million tets the logger ``"stretchmap"`` says (level INFO) how much
    memory to expect: about 600 bytes per tet for ``"vsem"``, 1300 for ``"certified"``.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.bumpy_torus(1000)
    >>> result = sm.volume_map(solid)
    >>> result.distortion.flips, result.certificate.certified
    (0, True)
    >>> bool(abs(result.distortion.image_total / solid.volume - 1.0) < 1e-12)
    True

    Between shape and volume:

    >>> shape = sm.volume_map(solid, balance=0.0).distortion
    >>> shape.angle_mean < result.distortion.angle_mean
    True
    >>> shape.element_std > result.distortion.element_std
    True

    Algorithm 5.1 as it is in the paper:

    >>> sm.volume_map(solid, c=10.0, max_iter=5).history[-1].stage
    'vsem'

    A method of your own:

    >>> def shrink(solid, image, torus):
    ...     return 0.5 * image  # the size does not matter
    >>> own = sm.volume_map(solid, optimizer=shrink, keep_best=True)
    >>> own.method, bool(abs(own.distortion.image_total / solid.volume - 1.0) < 1e-12)
    ('shrink', True)
    """
    solid = as_solid(solid)
    if method is None:
        method = "certified" if c is None else "vsem"
    options = VolumeOptions() if options is None else options
    _check_options(method, boundary, c, max_iter, options)
    if balance is not None:
        options = _balanced(method, balance, options)
    callback("optimizer", optimizer)
    if optimizer is not None and (method, max_iter, balance) != ("certified", None, None):
        raise OptionError("an optimizer of your own takes no method, c, max_iter or balance")
    keep_best = flag("keep_best", keep_best)
    callback("progress", progress)
    if solid.n_tets > _LARGE:
        _log.info(
            "%d tets, method %s: about %.1f GiB of memory",
            solid.n_tets, method, solid.n_tets * _BYTES_PER_TET[method] / 2**30,
        )  # fmt: skip
    solid.require_solid_torus()
    if start is not None:
        instance("start", start, MapResult, "a map of this solid")
    if method == "vsem":
        return _paper_map(solid, start, options, c or 0.0, max_iter, progress)
    if max_iter is not None:
        options = dataclasses.replace(options, frozen_iter=max_iter, glide_iter=max_iter)
    if options.tol is not None:
        options = dataclasses.replace(options, frozen_tol=options.tol, glide_tol=options.tol)
    if optimizer is not None:
        result = _own_map(solid, start, options, optimizer, progress)
    else:
        glide = boundary != "frozen"
        result = _certified_map(solid, start, options, glide=glide, progress=progress)
    _warn(result)
    if not keep_best:
        require_certified(result.certificate, "the map")
    return result


def _certified_map(
    solid: TetMesh,
    start: MapResult | None,
    options: VolumeOptions,
    *,
    glide: bool,
    progress: Progress | None,
) -> VolumeMap:
    """The map from the first start that leads to a certified one, or the best there is."""
    budget = Budget.of(options, solid.n_tets)
    starts: Iterator[MapResult] = iter([start] if start is not None else [])
    patience: tuple[float, ...] = (1.0,)
    if start is None:
        starts = boundary_starts(solid, options, glide=glide, progress=progress)
        patience = _PATIENCE
    best, clock, vain = None, time.perf_counter(), 0.0
    for begin, share in zip(starts, patience, strict=False):
        image, torus = _start_of(solid, begin)
        problem = VolumeProblem.of(solid, image, torus=torus, refine=options.refine)
        outcome = solve(
            problem, options, glide=glide, budget=budget, patience=share, progress=progress
        )
        found = _result(outcome, "certified", "glide" if glide else "frozen", begin)
        if best is None or _better(found, best):
            best = found
        if best.certificate.certified or budget.spent:
            break
        vain = time.perf_counter() - clock
        _log.info("not certified (%s): once more from another start", best.certificate.reason)
    assert best is not None
    if not vain:
        return best
    return dataclasses.replace(best, seconds={**best.seconds, "other starts": vain})


def _own_map(
    solid: TetMesh,
    start: MapResult | None,
    options: VolumeOptions,
    optimizer: Optimizer,
    progress: Progress | None,
) -> VolumeMap:
    """The map an optimizer of the user's own makes of the first start."""
    if start is None:
        start = next(boundary_starts(solid, options, glide=False, progress=progress))
    image, torus = _start_of(solid, start)
    problem = VolumeProblem.of(solid, image, torus=torus, refine=options.refine)
    outcome = run_optimizer(problem, optimizer, solver=options.solver)
    name = getattr(optimizer, "__name__", type(optimizer).__name__)
    return _result(outcome, name, "own", start)


def _paper_map(
    solid: TetMesh,
    start: MapResult | None,
    options: VolumeOptions,
    c: float,
    max_iter: int | None,
    progress: Progress | None,
) -> VolumeMap:
    """Algorithm 5.1."""
    if start is None:
        start = area_map(
            solid.surface, ratio=options.ratio or "conformal", phase=options.phase,
            keep_best=True, progress=progress,
        )  # fmt: skip
    image, torus = _start_of(solid, start)
    problem = VolumeProblem.of(solid, image, torus=torus, refine=None)
    outcome = run_vsem(problem, options, c=c, max_iter=max_iter, progress=progress)
    result = _result(outcome, "vsem", "frozen", start)
    _warn(result)
    return result


def _better(one: VolumeMap, other: VolumeMap) -> bool:
    """Certified, or else with fewer flipped tets."""

    def rank(result: VolumeMap) -> tuple[bool, int]:
        return result.certificate.certified, -int(result.distortion.flips or 0)

    return rank(one) > rank(other)


def _warn(result: VolumeMap) -> None:
    if not result.converged:
        _log.warning("volume map not converged: %s", result.stop_reason)
    if result.distortion.flips:
        _log.warning("volume map has %d flipped tets", result.distortion.flips)


def _check_options(
    method: str,
    boundary: str | None,
    c: float | None,
    max_iter: int | None,
    options: VolumeOptions,
) -> None:
    one_of("method", method, ("certified", "vsem"))
    if boundary is not None:
        one_of("boundary", boundary, ("glide", "frozen"))
    instance("options", options, VolumeOptions, "stretchmap.VolumeOptions(...)")
    if method == "vsem" and boundary == "glide":
        raise OptionError(
            "Algorithm 5.1 holds the boundary; use method='certified' to let it glide"
        )
    if method == "vsem" and options.vertex_exact:
        raise OptionError("vertex_exact belongs to the certified route; leave c and method out")
    if method == "certified" and c is not None:
        raise OptionError("c belongs to Algorithm 5.1; use method='vsem' or leave it out")
    if c is not None:
        real("c", c, 0.0)
    if max_iter is not None:
        whole("max_iter", max_iter, 0)


def _balanced(method: str, balance: float, options: VolumeOptions) -> VolumeOptions:
    balance = real("balance", balance, 0.0, 1.0)
    if method == "vsem":
        raise OptionError("balance belongs to the certified route; leave c and method out")
    if options.volume_weight != VolumeOptions.volume_weight:
        raise OptionError("give balance or options.volume_weight, not both")
    if balance == 1.0:
        return options
    return dataclasses.replace(
        options, volume_weight=weight_at(balance), target_iter=0, shift_iter=0
    )


def _start_of(solid: TetMesh, start: MapResult) -> tuple[NDArray[np.float64], Torus]:
    if isinstance(start.mesh, TetMesh) and _refines(start.mesh, solid):
        start = dataclasses.replace(start, mesh=solid, image=start.image[: solid.n_vertices])
    mesh = solid if isinstance(start.mesh, TetMesh) else solid.surface
    require_same_mesh(
        mesh,
        start.mesh,
        "start is of another surface or solid",
        "pass a map of the solid or its surface",
    )
    if start.torus is None:
        raise KindError("start must be a map to a torus")
    return start.image, start.torus


def _refines(mesh: TetMesh, solid: TetMesh) -> bool:
    """Whether a mesh begins with the vertices of the solid and has more, as a refinement does."""
    n = solid.n_vertices
    return mesh.n_vertices > n and bool((mesh.V[:n] == solid.V).all())


def _result(
    outcome: Outcome,
    method: str,
    boundary: str,
    start: MapResult,
) -> VolumeMap:
    problem, refinement = outcome.problem, outcome.problem.refinement
    assert problem.torus is not None
    volume = float(_core.mesh.tet_volumes(problem.x, problem.solid.T).sum())
    scale = (problem.solid.volume / volume) ** (1.0 / 3.0)
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
