"""Options of the volume maps, checked when they are made."""

from __future__ import annotations

import dataclasses
from collections.abc import Set
from dataclasses import dataclass

from ..area.search import Ratio
from ..base.options import SOLVERS, flag, instance, one_of, real, shown, whole
from ..base.torus import MOST_ANGLE, MOST_RATIO
from ..errors import OptionError

__all__ = [
    "FillOptions",
    "VolumeOptions",
    "balanced",
    "check_call",
    "check_own",
    "check_prescribed",
    "free_at",
    "weight_at",
]


_MOST_WEIGHT = 1e4  # of the volume term; beyond it nothing changes
_EVEN_WEIGHT = 10.0  # half-way to shape
# At the end of shape: ratios between these are free, and others cost more than half-way.
_SHAPE_WEIGHT, _SHAPE_RATIOS = 30.0, (0.3, 1.2)


def weight_at(balance: float) -> float:
    """``volume_weight`` between shape, 0, and volume, 1."""
    if balance < 0.5:
        return float(_SHAPE_WEIGHT * (_EVEN_WEIGHT / _SHAPE_WEIGHT) ** (2.0 * balance))
    return float(1e-2 * 1e6**balance)


def free_at(balance: float) -> tuple[float, float]:
    """``free_ratios`` there."""
    least, most = (ratio ** max(1.0 - 2.0 * balance, 0.0) for ratio in _SHAPE_RATIOS)
    return least, most


@dataclass(frozen=True, kw_only=True)
class FillOptions:
    """Options of a volume map whose boundary is prescribed; the defaults are meant for every mesh.

    Attributes
    ----------
    refine : bool
        Split interior edges and faces whose vertices all lie on the boundary, which nothing inside
        can repair, and edges round tets that stay inverted; where the boundary glides on a torus,
        volumes have their full weight (the default) and the mean of abs(ratio - 1) is above 0.05,
        also edges of the tets that keep their volume worst. False: a mesh of the first kind is
        refused, and no other gets vertices.
    time_limit : float
        Processor time per tet of the solid given, in seconds, after which no further stage is begun
        and a map with inverted tets is given up; a small mesh gets some seconds all the same.
    volume_weight : float
        Largest weight lambda of the volume term against the shape term.
    growth : float
        Factor by which lambda grows after a whole step; its root after one cut short.
    max_aspect : float
        Source tets with a larger ratio of extreme singular values (relative to a regular tet) are
        slivers: their shape is not asked to be kept. Boundary triangles likewise.
    floor : float
        Least determinant untangling aims for, 1 being what a tet may expect where it lies: closer
        to folding the barrier is so steep that all following steps are short.
    untangle_iter, frozen_iter : int
        Most steps of these stages.
    patience : int
        Untangling steps without fewer inverted tets before something else is tried.
    frozen_tol : float
        At the largest lambda: stop when a step lowers the energy by no more than this share.
    frozen_weight, face_weight, glide_iter, glide_tol
        Only where the boundary glides: lambda at which that starts (on a mesh at 0.2 at most),
        weight of the boundary triangles' barrier, most steps and the share at which to stop (on a
        mesh at 5e-4 at most; on a torus also eight steps in a row, none short, that gain sixteen
        times that). Before, the boundary is held, and lambda grows up to there until a step is
        whole.
    glide_std, glide_distortion : float
        Only for `register`: SD of the ratios (6.5) round vertices, and total distortion (6.4), that
        are enough of a boundary that glides on a mesh: when both are met it stops, for the farther
        vertices glide the less they correspond. 0 goes on until the energy is at rest.
    shared : int
        Most steps in a row that share one Hessian; 1 renews it at every step.
    cg_tol : float
    max_cg : int
        Relative residual and most iterations of the linear solves of Newton steps; twice that
        residual before the largest lambda.
    solver : {"auto", "direct", "multigrid", "jacobi", "cholmod"}
        Linear solver of the harmonic start and of Algorithm 5.1; the last in builds that have it.

    Raises
    ------
    OptionError
        A value out of range.

    Examples
    --------
    >>> import stretchmap as sm
    >>> ball = sm.samples.ball(3)
    >>> options = sm.FillOptions(volume_weight=10.0)
    >>> sm.fill(ball, 2.0 * ball.surface.V, options=options).distortion.flips
    0
    """

    refine: bool = True
    time_limit: float = 1e-3
    volume_weight: float = _MOST_WEIGHT
    growth: float = 2.0
    max_aspect: float = 6.0
    floor: float = 0.02
    untangle_iter: int = 400
    frozen_iter: int = 400
    patience: int = 30
    frozen_tol: float = 5e-4
    frozen_weight: float = 10.0
    face_weight: float = 1.0
    glide_iter: int = 1000
    glide_tol: float = 2e-3
    glide_std: float = 0.028
    glide_distortion: float = 0.014
    shared: int = 5
    cg_tol: float = 0.1
    max_cg: int = 200
    solver: str = "auto"

    def __post_init__(self) -> None:
        flag("refine", self.refine)
        one_of("solver", self.solver, SOLVERS)
        for name in ("time_limit", "volume_weight", "frozen_weight", "face_weight", "cg_tol"):
            real(name, getattr(self, name), above=0.0)
        for name in ("growth", "max_aspect"):
            real(name, getattr(self, name), 1.0)
        for name in ("floor", "frozen_tol", "glide_tol", "glide_std", "glide_distortion"):
            real(name, getattr(self, name), 0.0, below=1.0)
        for name in ("untangle_iter", "frozen_iter", "glide_iter"):
            whole(name, getattr(self, name), 0)
        for name in ("patience", "shared", "max_cg"):
            whole(name, getattr(self, name), 1)


@dataclass(frozen=True, kw_only=True)
class VolumeOptions(FillOptions):
    """Options of `volume_map`; those of `FillOptions` and:

    Attributes
    ----------
    free_ratios : (float, float)
        Least and largest volume ratio of a tet that cost nothing, 1 between them: the volume term
        measures how far a ratio is outside.
    ratio : "conformal", "search" or float, optional
        R / r of the torus, as in `area_map`. Default: the conformal one for ``"vsem"``, a search
        for ``"certified"``, which also tries thinner tori where volumes are kept badly on that one.
    phase : float, optional
        As in `area_map`.
    tol : float, optional
        Stop when a step lowers the energy by no more than this share: ``"vsem"``, default 1e-6, or
        any stage of ``"certified"``, in place of ``frozen_tol`` and ``glide_tol``. Left out, the
        latter also stops where the SD of the ratios is below 1e-4, as it soon is on tori.
    target_iter, shift_iter : int
        Most steps of each kind that equalize the volumes along u, v and s.
    marginal_tol : float
        No more of the first kind when no level is off by more than this share of the volume.
    vertex_exact : bool
        In the end make the ring volume (6.5) of every interior vertex exact, unless that turns a
        tet over or costs too much; the result says whether it was done.
    exact_std_factor : float
        Only with ``vertex_exact``, which may raise the SD of the tet ratios by this factor.

    Examples
    --------
    >>> import stretchmap as sm
    >>> options = sm.VolumeOptions(ratio=2.5, glide_iter=3)
    >>> result = sm.volume_map(sm.samples.solid_torus(500), options=options)
    >>> round(result.torus.ratio, 6)
    2.5
    """

    free_ratios: tuple[float, float] = (1.0, 1.0)
    ratio: Ratio | float | None = None
    phase: float | None = None
    tol: float | None = None
    target_iter: int = 5
    shift_iter: int = 4
    marginal_tol: float = 1e-4
    vertex_exact: bool = False
    exact_std_factor: float = 1.25

    def __post_init__(self) -> None:
        super().__post_init__()
        flag("vertex_exact", self.vertex_exact)
        instance("free_ratios", self.free_ratios, tuple, "the least and the most")
        if len(self.free_ratios) != 2:
            raise OptionError(f"free_ratios must be two numbers, got {shown(self.free_ratios)}")
        real("free_ratios[0]", self.free_ratios[0], 0.0, 1.0)
        real("free_ratios[1]", self.free_ratios[1], 1.0)
        if isinstance(self.ratio, str):
            one_of("ratio", self.ratio, ("conformal", "search"))
        elif self.ratio is not None:
            real("ratio", self.ratio, above=1.0, high=MOST_RATIO)
        if self.phase is not None:
            real("phase", self.phase, -MOST_ANGLE, MOST_ANGLE)
        if self.tol is not None:
            real("tol", self.tol, 0.0, below=1.0)
        for name in ("target_iter", "shift_iter"):
            whole(name, getattr(self, name), 0)
        real("marginal_tol", self.marginal_tol, 0.0)
        real("exact_std_factor", self.exact_std_factor, 1.0)


def check_call(
    method: str,
    boundary: str | None,
    c: float | None,
    max_iter: int | None,
    options: VolumeOptions,
    *,
    started: bool = False,
) -> None:
    """Whether arguments of `volume_map` go together; ``started`` if a map to go on from is one."""
    one_of("method", method, ("certified", "vsem"))
    if boundary is not None:
        one_of("boundary", boundary, ("glide", "frozen"))
    instance("options", options, VolumeOptions, "stretchmap.VolumeOptions(...)")
    if method == "vsem" and boundary == "glide":
        raise OptionError(
            "Algorithm 5.1 holds the boundary; use method='certified' to let it glide"
        )
    if method == "vsem":
        _only(options, _OF_PAPER, "Algorithm 5.1 does not take {}; leave c and method out")
    if method == "certified" and c is not None:
        raise OptionError("c belongs to Algorithm 5.1; use method='vsem' or leave it out")
    if method == "certified" and boundary == "frozen":
        _require_no_gliding(options)
    elif method == "certified":
        _only(options, _FIELDS - _ON_MESH, "only register takes {}: this boundary is on a torus")
    if not options.vertex_exact:
        _only(options, _FIELDS - _OF_RINGS, "{} goes with vertex_exact=True; give both, or neither")
    if started:
        _only(options, _FIELDS - _OF_TORUS, "the torus is that of start; leave {} out")
    if c is not None:
        real("c", c, 0.0)
    if max_iter is not None:
        whole("max_iter", max_iter, 0)


def check_own(options: VolumeOptions) -> None:
    """Whether options are of use to an optimizer of the user's own."""
    _only(options, _OF_OWN, "an optimizer of your own does not take {}")


def check_prescribed(options: FillOptions, *, glide: bool) -> None:
    """Whether options are of use where the boundary is prescribed, or glides from there."""
    kept = _OF_FILL if glide else _OF_FILL | {"free_ratios"}
    _only(options, kept, "only volume_map takes {}: the boundary lies on no torus here")
    if not glide:
        _require_no_gliding(options)


def _require_no_gliding(options: FillOptions) -> None:
    _only(options, _FIELDS - _OF_GLIDING, "the boundary does not glide; leave {} out")


def _only(options: FillOptions, names: Set[str], why: str) -> None:
    """Refuse others that are not as they are by default."""
    others = [
        field.name
        for field in dataclasses.fields(options)
        if field.name not in names and getattr(options, field.name) != field.default
    ]
    if others:
        raise OptionError(why.format(", ".join(others)))


_FIELDS = {field.name for field in dataclasses.fields(VolumeOptions)}
_OF_FILL = {field.name for field in dataclasses.fields(FillOptions)}
_OF_TORUS = {"ratio", "phase"}
_OF_RINGS = {"exact_std_factor"}
_ON_MESH = {"glide_std", "glide_distortion"}
_OF_GLIDING = {*_ON_MESH, "frozen_weight", "face_weight", "glide_iter", "glide_tol"}
_OF_LEVELS = {"target_iter", "shift_iter", "marginal_tol"}
_OF_OWN = {*_OF_TORUS, "refine", "solver"}
_OF_PAPER = {*_OF_OWN, "tol"}  # which never refines


def balanced(method: str, balance: float, options: VolumeOptions) -> VolumeOptions:
    """The options for a setting between shape and volume."""
    balance = real("balance", balance, 0.0, 1.0)
    if method == "vsem":
        raise OptionError("balance belongs to the certified route; leave c and method out")
    if options.volume_weight != VolumeOptions.volume_weight:
        raise OptionError("give balance or options.volume_weight, not both")
    if options.free_ratios != VolumeOptions.free_ratios:
        raise OptionError("give balance or options.free_ratios, not both")
    if balance == 1.0:
        return options
    _only(options, _FIELDS - _OF_LEVELS, "balance below 1 leaves levels as they are: no {}")
    return dataclasses.replace(
        options,
        volume_weight=weight_at(balance),
        free_ratios=free_at(balance),
        target_iter=0,
        shift_iter=0,
    )
