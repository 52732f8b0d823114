"""Maps of a solid onto the standard solid torus that preserve volume."""

from __future__ import annotations

import dataclasses
import logging
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..area.map import area_map
from ..base.arrays import as_points
from ..base.options import callback, flag, instance
from ..base.progress import Progress
from ..base.threads import takes_threads
from ..base.torus import Torus
from ..certificate.findings import require_certified
from ..errors import ArrayError, KindError, OptionError
from ..maps.result import MapResult
from ..mesh.crossings import UNLESS_KEPT, require_no_crossing
from ..mesh.given import as_solid, require_same_mesh
from ..mesh.meshes import TetMesh, TriMesh
from .boundary_starts import boundary_starts
from .certified import certified_map
from .options import VolumeOptions, balanced, check_call, check_own
from .own import Optimizer, run_optimizer
from .problem import VolumeProblem
from .ranked_starts import Start
from .result import VolumeMap, volume_result
from .vsem import run_vsem

__all__ = ["volume_map"]

_log = logging.getLogger("stretchmap")

# Peak resident bytes per tet of a whole call, mesh and result included, rounded up from what was
# measured on generated solid tori of 1e6 tets: 314 and 868.
_BYTES_PER_TET = {"vsem": 320, "certified": 900}
# Larger runs say beforehand how much they need.
_LARGE = 1_000_000
# Of the area map Algorithm 5.1 starts from. The last per cent of the faces' areas takes most of the
# time and costs them their shape, and so the tets behind them; exact rings would bring no volume
# nearer and need twice the memory.
_BOUNDARY_TOL = 0.01
# Share of the tets that stay flipped from which on the solid itself may be the reason.
_KNOTTED = 0.05
_IF_KNOTTED = (
    "so many may mean that the hole is knotted, which makes it no solid torus and is not checked"
)


@takes_threads
def volume_map(
    solid: TetMesh,
    *,
    method: Literal["certified", "vsem"] | None = None,
    boundary: Literal["glide", "frozen"] | None = None,
    c: float | None = None,
    balance: float | None = None,
    max_iter: int | None = None,
    start: MapResult | None = None,
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
        ``"vsem"``: Algorithm 5.1 as it stands in the paper, from an `area_map` of equal face areas,
        ``tol=0.01`` and ``finish="face"``; may leave flipped tets, which are reported. Default:
        ``"vsem"`` if ``c`` is given, else ``"certified"``.
    boundary : {"glide", "frozen"}, optional
        Certified route only. ``"glide"`` (default) lets boundary vertices move on the torus,
        ``"frozen"`` keeps them where the area-preserving map put them.
    c : float, optional
        Regularization constant of (5.6) of the ``"vsem"`` method, dimensionless, default 0.
    balance : float, optional
        Certified route only: from 0, pieces keep their shape, to 1, they keep their volume
        (default). From 0.5 on the volume term weighs ``10^(6 balance - 2)`` times the shape term;
        towards 0 it weighs 30 times and leaves ratios between 0.3 and 1.2 free, so that no part
        grows much for the sake of angles. For angles alone give no balance, but
        ``VolumeOptions(volume_weight=0.01)``. Below 1 the volumes between level surfaces are left
        as they come. Where all tets are stretched along an axis more than three times, shape is
        that of the solid with this undone.
    max_iter : int, optional
        Most steps of ``"vsem"`` (default 20) or of each last stage of ``"certified"``.
    start : MapResult, optional
        Any map to a torus, which is kept (no ``ratio``, ``phase``): of ``solid.surface``, to
        prescribe the boundary, or of ``solid``, or of its refinement, to go on from. One of a
        refined surface is made anew of the surface as it is, on the same torus. What an optimizer
        of your own returned is one, too.
    optimizer : callable, optional
        ``optimizer(solid, image, torus)`` returns a better image, see `Optimizer`: a method of your
        own in place of ours, from the start of a frozen boundary, measured and certified alike. Of
        the options it takes ``ratio``, ``phase``, ``refine`` and ``solver``.
    options : VolumeOptions, optional
        All other options. ``"vsem"`` takes ``ratio``, ``phase``, ``tol`` and ``solver``.
    keep_best : bool
        Return the best map found even if it is not certified.
    threads : int, optional
        Threads to use, see `threads`; the result depends on it only where time runs short.
    progress : Progress, optional
        Called once per step.

    Returns
    -------
    VolumeMap

    Raises
    ------
    MeshError
        The mesh is not a solid torus, see `TetMesh.require_solid_torus`.
    SelfIntersectionError
        Certified route without ``keep_best``: the boundary of the solid crosses itself.
    DegenerateError
        ``refine=False`` and some interior edge or face cannot be repaired; ``ids`` are the tets. Or
        the solid is so small that its volumes are no numbers any more.
    CertificationError
        The certified route left flipped tets or failed the certificate, ``ids`` are the elements.
    KindError
        ``start`` belongs to another mesh, or names no torus.
    ArrayError, NonFiniteError, OrientationError
        The optimizer returned no image, or one without positive volume; or ``start`` holds one.
    OptionError
        An option out of range or combined with one it excludes.
    SolverError
        A linear solve of Algorithm 5.1 broke down.

    Notes
    -----
    Before a run of more than a million tets the logger ``"stretchmap"`` says (level INFO) how much
    memory to expect: about 320 bytes per tet for ``"vsem"``, 900 for ``"certified"``.

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
    check_call(method, boundary, c, max_iter, options, started=start is not None)
    if balance is not None:
        options = balanced(method, balance, options)
    callback("optimizer", optimizer)
    if optimizer is not None:
        if (method, max_iter, balance, boundary) != ("certified", None, None, None):
            raise OptionError(
                "an optimizer of your own takes no method, boundary, c, max_iter or balance"
            )
        check_own(options)
    keep_best = flag("keep_best", keep_best)
    callback("progress", progress)
    if solid.n_tets > _LARGE:
        _log.info(
            "%d tets, method %s: about %.1f GiB of memory",
            solid.n_tets, method, solid.n_tets * _BYTES_PER_TET[method] / 2**30,
        )  # fmt: skip
    solid.require_solid_torus()
    if method == "certified" and not keep_best:
        require_no_crossing(solid.surface, "the boundary of the solid", UNLESS_KEPT)
    if start is not None:
        instance("start", start, MapResult, "a map of this solid; for an image see optimizer")
        start = _of_the_input(solid, start, progress)
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
        begin = None if start is None else Start(start, _problem(solid, start, options.refine))
        result = certified_map(solid, options, begin, glide=glide, progress=progress)
    _warn(result)
    if not keep_best:
        lost = (result.distortion.flips or 0) > _KNOTTED * result.mesh.n_tets
        require_certified(result.certificate, "the map", _IF_KNOTTED if lost else "")
    return result


def _problem(
    solid: TetMesh, start: MapResult, refine: bool | None, *, unstretch: bool = True
) -> VolumeProblem:
    image, torus = _start_of(solid, start)
    warm = isinstance(start.mesh, TetMesh)
    return VolumeProblem.of(
        solid, image, torus=torus, refine=refine, warm=warm, unstretch=unstretch
    )


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
    problem = _problem(solid, start, options.refine)
    outcome = run_optimizer(problem, optimizer, solver=options.solver)
    name = getattr(optimizer, "__name__", type(optimizer).__name__)
    return volume_result(outcome, name, "own", start)


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
            tol=_BOUNDARY_TOL, finish="face", refine=False, keep_best=True, progress=progress,
        )  # fmt: skip
    problem = _problem(solid, start, None, unstretch=False)
    outcome = run_vsem(problem, options, c=c, max_iter=max_iter, progress=progress)
    result = volume_result(outcome, "vsem", "frozen", start)
    _warn(result)
    return result


def _warn(result: VolumeMap) -> None:
    if not result.converged:
        _log.warning("volume map not converged: %s", result.stop_reason)
    if result.distortion.flips:
        _log.warning("volume map has %d flipped tets", result.distortion.flips)


def _of_the_input(solid: TetMesh, start: MapResult, progress: Progress | None) -> MapResult:
    """A map of a surface that was refined, made anew of the surface as it is, on the same torus."""
    if start.torus is None or not (
        isinstance(start.mesh, TriMesh) and _refines(start.mesh, solid.surface)
    ):
        return start
    ratio, phase = start.torus.ratio, start.to_dict().get("phase")
    return area_map(
        solid.surface, ratio=ratio, phase=phase, refine=False, keep_best=True, progress=progress
    )


def _start_of(solid: TetMesh, start: MapResult) -> tuple[NDArray[np.float64], Torus]:
    image = as_points(start.image, "the image of start")
    if len(image) != start.mesh.n_vertices:
        raise ArrayError(
            f"the image of start has {len(image)} rows, its mesh {start.mesh.n_vertices} vertices"
        )
    if isinstance(start.mesh, TetMesh) and _refines(start.mesh, solid):
        return image[: solid.n_vertices], _torus_of(start)
    mesh = solid if isinstance(start.mesh, TetMesh) else solid.surface
    require_same_mesh(
        mesh,
        start.mesh,
        "start is of another surface or solid",
        "pass a map of the solid or its surface",
    )
    return image, _torus_of(start)


def _torus_of(start: MapResult) -> Torus:
    if start.torus is None:
        raise KindError("start must be a map to a torus")
    return start.torus


def _refines(mesh: TetMesh | TriMesh, given: TetMesh | TriMesh) -> bool:
    """Whether a mesh begins with the vertices of the one given and has more, as a refinement."""
    n = given.n_vertices
    return mesh.n_vertices > n and bool((mesh.V[:n] == given.V).all())
