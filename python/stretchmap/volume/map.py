"""Maps of a solid onto the standard solid torus that preserve volume."""

from __future__ import annotations

import dataclasses
import logging
import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from numpy.typing import ArrayLike, NDArray

from ..area.map import AreaMap, Finish, area_map
from ..area.search import Ratio
from ..base.arrays import read_only
from ..base.progress import Progress
from ..base.threads import takes_threads
from ..base.torus import Torus
from ..certificate.checks import certify
from ..certificate.findings import Certificate
from ..errors import CertificationError, DegenerateError, OptionError
from ..maps.result import MapResult
from ..mesh.given import as_solid, require_same_mesh
from ..mesh.overconstrained import overconstrained_elements
from ..mesh.refinement import Refinement, refine_overconstrained
from .options import FlipFreeOptions
from .problem import SolidProblem
from .routes import SolidRun, certified_route, vsem_route

if TYPE_CHECKING:
    from ..mesh.meshes import TetMesh

__all__ = ["VolumeMap", "volume_map"]

_log = logging.getLogger("stretchmap")

# Peak resident bytes per tet of a whole call, mesh and result included, rounded up from what was
# measured on generated solid tori of 1e6 tets: 594 and 1261 (493 for "vsem" at 1e7).
_BYTES_PER_TET = {"vsem": 600, "certified": 1300}
# Larger runs say beforehand how much they need.
_LARGE = 1_000_000


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
        ``"certified"`` or ``"vsem"``.
    boundary : str
        ``"frozen"`` or ``"glide"``.
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
        Wall-clock time per stage.
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
    method: str | None = None,
    boundary: str | None = None,
    c: float | None = None,
    max_iter: int | None = None,
    tol: float | None = None,
    ratio: Ratio | float | None = None,
    phase: float | None = None,
    boundary_map: AreaMap | None = None,
    start: ArrayLike | None = None,
    torus: Torus | None = None,
    vertex_exact: bool = False,
    refine: bool = True,
    keep_best: bool = False,
    solver: str = "auto",
    options: FlipFreeOptions | None = None,
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
        Regularisation constant of (5.6) of the ``"vsem"`` method, dimensionless, default 0.
    max_iter : int, optional
        Most steps of ``"vsem"`` (default 20) or of the last stage of ``"certified"``.
    tol : float, optional
        Stop when a step lowers the energy by no more than this share (default 1e-6 for ``"vsem"``,
        2e-3 or, with a frozen boundary, 5e-4 for ``"certified"``).
    ratio : "conformal", "search" or float, optional
        R / r of the torus, as in `area_map`. Default: the conformal one for ``"vsem"``, a search
        for ``"certified"``.
    phase : float, optional
        As in `area_map`.
    boundary_map : AreaMap, optional
        Map of ``solid.surface`` to be used instead of a computed one.
    start : array_like, shape (n, 3), optional
        Image to go on from, such as that of a saved map, with its ``torus``; the boundary vertices
        have to lie on it.
    torus : Torus, optional
        With ``start`` only.
    vertex_exact : bool
        Certified route only: in the end make the ring volume (6.5) of every interior vertex exact,
        unless that turns a tet over or costs too much (`FlipFreeOptions.exact_std_factor`); the
        result says whether it was done.
    refine : bool
        Split interior edges and faces whose vertices all lie on the boundary, which nothing inside
        can repair, and edges round single tets that stay inverted. False: refuse such a mesh.
    keep_best : bool
        Return the best map found even if it is not certified.
    solver : {"auto", "direct", "multigrid", "jacobi", "cholmod"}
        Linear solver of the harmonic and fixed-point steps; the last in builds that have it.
    options : FlipFreeOptions, optional
        Finer knobs of the certified route.
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
        ``boundary_map`` is of another surface than the solid's.
    OptionError
        An option out of range or combined with one it excludes.
    SolverError
        A linear solve broke down.

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

    Algorithm 5.1 as it is in the paper:

    >>> sm.volume_map(solid, c=10.0, max_iter=5).history[-1].stage
    'vsem'
    """
    solid = as_solid(solid)
    if method is None:
        method = "certified" if c is None else "vsem"
    _check_options(method, boundary, c, max_iter, tol, start, torus, boundary_map)
    if vertex_exact and method == "vsem":
        raise OptionError("vertex_exact belongs to the certified route; leave c and method out")
    if solid.n_tets > _LARGE:
        _log.info(
            "%d tets, method %s: about %.1f GiB of memory",
            solid.n_tets, method, solid.n_tets * _BYTES_PER_TET[method] / 2**30,
        )  # fmt: skip
    solid.require_solid_torus()
    seconds: dict[str, float] = {}

    certified = method == "certified"
    if start is None and boundary_map is None:
        clock = time.perf_counter()
        if ratio is None:
            ratio = "search" if certified else "conformal"
        # A gliding boundary loses the exact areas again; a held one is only as good as them.
        # Its last per cent costs triangles their shape, which the interior has to pay for.
        finish: Finish = "face" if boundary == "frozen" else "none"
        area_tol = 0.05
        if not certified:
            finish, area_tol = "ring", 5e-3
        boundary_map = area_map(
            solid.surface, ratio=ratio, phase=phase, finish=finish, tol=area_tol, keep_best=True,
            progress=progress,
        )  # fmt: skip
        seconds["boundary"] = time.perf_counter() - clock
    elif boundary_map is not None:
        require_same_mesh(
            solid.surface,
            boundary_map.mesh,
            "boundary_map is of another surface",
            "pass area_map(solid.surface)",
        )

    refinement = None
    if certified:
        clock = time.perf_counter()
        if refine:
            refinement = refine_overconstrained(solid)
        else:
            _refuse_overconstrained(solid)
        seconds["refine"] = time.perf_counter() - clock
    problem = SolidProblem.build(solid, refinement, boundary_map, start, torus)
    if certified:
        boundary = boundary or "glide"
        problem, run = certified_route(
            problem, _with_overrides(options or FlipFreeOptions(), max_iter, tol),
            glide=boundary == "glide", vertex_exact=vertex_exact, solver=solver, progress=progress,
        )  # fmt: skip
    else:
        boundary = "frozen"
        run = vsem_route(
            problem, c=c or 0.0, max_iter=20 if max_iter is None else max_iter,
            tol=1e-6 if tol is None else tol, solver=solver, progress=progress,
        )  # fmt: skip
    result = _result(problem, run, method, boundary, boundary_map, seconds)
    if certified and not result.certificate.certified and not keep_best:
        ids = next(iter(result.certificate.ids.values()), ())
        raise CertificationError(
            f"the map is not certified: {result.certificate.reason}; keep_best=True returns it all "
            "the same",
            ids,
        )
    return result


def _check_options(
    method: str,
    boundary: str | None,
    c: float | None,
    max_iter: int | None,
    tol: float | None,
    start: ArrayLike | None,
    torus: Torus | None,
    boundary_map: AreaMap | None,
) -> None:
    if method not in ("certified", "vsem"):
        raise OptionError(f"method must be 'certified' or 'vsem', got {method!r}")
    if boundary not in (None, "glide", "frozen"):
        raise OptionError(f"boundary must be 'glide' or 'frozen', got {boundary!r}")
    if method == "vsem" and boundary == "glide":
        raise OptionError(
            "Algorithm 5.1 holds the boundary; use method='certified' to let it glide"
        )
    if method == "certified" and c is not None:
        raise OptionError("c belongs to Algorithm 5.1; use method='vsem' or leave it out")
    if c is not None and not (c >= 0.0 and math.isfinite(c)):
        raise OptionError(f"c must be finite and not negative, got {c}")
    if max_iter is not None and max_iter < 0:
        raise OptionError(f"max_iter must not be negative, got {max_iter}")
    if tol is not None and not tol >= 0.0:
        raise OptionError(f"tol must not be negative, got {tol}")
    if (start is None) != (torus is None):
        raise OptionError("start and torus go together: an image to go on from and its torus")
    if start is not None and boundary_map is not None:
        raise OptionError("give either start or boundary_map, not both")


def _with_overrides(
    options: FlipFreeOptions, max_iter: int | None, tol: float | None
) -> FlipFreeOptions:
    if max_iter is not None:
        options = dataclasses.replace(options, frozen_iter=max_iter, glide_iter=max_iter)
    return options if tol is None else dataclasses.replace(options, glide_tol=tol, frozen_tol=tol)


def _refuse_overconstrained(solid: TetMesh) -> None:
    found = overconstrained_elements(solid)
    if len(found):
        raise DegenerateError(
            f"{len(found.edges)} interior edges and {len(found.faces)} interior faces have all "
            "their vertices on the boundary, so the boundary map alone decides about the tets at "
            "them; allow their refinement (refine=True)",
            found.tets,
        )


def _result(
    problem: SolidProblem,
    run: SolidRun,
    method: str,
    boundary: str,
    boundary_map: AreaMap | None,
    seconds: dict[str, float],
) -> VolumeMap:
    scale, refinement = problem.result_scale(run.x), problem.refinement
    image, torus = run.x * scale, problem.torus.scaled(scale)
    clock = time.perf_counter()
    certificate = certify(problem.solid, image, torus)
    seconds = {**seconds, **run.seconds, "certificate": time.perf_counter() - clock}
    if not run.converged:
        _log.warning("volume map not converged: %s", run.stop_reason)
    result = VolumeMap(
        mesh=problem.solid,
        image=read_only(image),
        torus=torus,
        method=method,
        boundary=boundary,
        boundary_map=boundary_map,
        refinement=refinement if refinement is not None and refinement.n_split else None,
        history=run.history,
        certificate=certificate,
        converged=run.converged,
        stop_reason=run.stop_reason,
        seconds=seconds,
        vertex_exact=run.vertex_exact,
    )
    if result.distortion.flips:
        _log.warning("volume map has %d flipped tets", result.distortion.flips)
    return result
