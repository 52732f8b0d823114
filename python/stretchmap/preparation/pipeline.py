"""From a raw surface or a voxel mask to a solid torus filled with tets."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import options
from ..base.arrays import as_reals
from ..base.progress import Progress, report
from ..errors import (
    ConnectivityError,
    DegenerateError,
    GenusError,
    OptionError,
    SelfIntersectionError,
    SolverError,
)
from ..mesh.given import as_surface
from ..mesh.meshes import TetMesh, TriMesh
from ..mesh.tetrahedralize import tetrahedralize
from .even import even, has_long_edges
from .handles import HandleCut, cut_handles
from .holes import close_holes, crossings, remove_crossings
from .rebuild import rebuilt
from .report import Preparation, Step
from .soup import Faces, Points, keep_largest, part_sheets, weld_borders
from .voxels import as_affine, mask_surface
from .wild import chosen_filler, fill_within_envelope, has_ftetwild

__all__ = ["prepare"]

_log = logging.getLogger("stretchmap")

_MUCH = 0.1  # of the volume, to be lost or cut without a word
_WELD = 1e-7  # share of the longest side of the bounding box
_WORKING_FACES = 50_000  # handles are looked for on no more than about that many
_WORKING_ITERATIONS = 3
_TET = 2.0  # largest tet, in regular tets over the boundary's mean edge
_REMESHINGS = 3
_FINER = (1.5, 2.0, 3.0)  # times the faces aimed at
_REBUILT_FACES = 16_000
_BYTES_PER_FACE = 5e3  # of the boundary, tets included; measured


def prepare(
    surface: TriMesh | NDArray[Any],
    *,
    faces: int = 8_000,
    genus: int = 1,
    max_cut: float = 0.25,
    spacing: Sequence[float] = (1.0, 1.0, 1.0),
    affine: ArrayLike | None = None,
    filler: Literal["auto", "tetgen", "ftetwild"] = "auto",
    progress: Progress | None = None,
) -> Preparation:
    """Make a solid that can be mapped from a raw surface or a voxel mask.

    Vertices are welded, sheets that touch parted, faces oriented, debris dropped, holes closed,
    self-intersections cut out and refilled or, where that does not help, the surface rebuilt from
    the voxels it winds round, surplus handles cut along their shortest loops, the
    surface remeshed to even triangles and filled with tets. A cut takes a neighborhood of its loop:
    a bridge goes, or a tunnel is filled, as far as it is hardly wider than there; the step
    ``"handles"`` says how much of the volume that is.

    Of a mask the largest island is taken and its cavities are filled; of more than a tenth as many
    voxels in other islands there is a warning. Its stairs are smoothed, at a level at which the
    surface encloses the volume of these voxels to within three per cent. The step ``"fill"`` says
    how much of it the solid lacks; of more than a tenth there is a warning.

    Parameters
    ----------
    surface : TriMesh, or (a, b, c) array of bool or integers
        Any triangles, whatever their defects; or a mask, of which what is not zero belongs to the
        solid. Holes through it may be one voxel wide where they are wanted.
    faces : int
        Number of boundary faces aimed at.
    genus : int
        Number of handles that are to be left; 1 for what `volume_map` takes.
    max_cut : float
        Longest loop a handle may be cut along, as a share of the square root of the area of the
        surface. What is longer is taken for part of the shape.
    spacing : three floats
        Distance of voxels along each axis of a mask: voxel (i, j, k) lies at
        ``(i, j, k) * spacing``.
    affine : (4, 4) array_like, optional
        Instead of ``spacing``, where images have one: voxel (i, j, k) lies at
        ``affine @ (i, j, k, 1)``. However the image is stored, mirrored or oblique, the solid is
        the one in world coordinates.
    filler : {"auto", "tetgen", "ftetwild"}
        What fills with tets: TetGen (package tetgen, AGPL) keeps the even surface as it is,
        fTetWild (package pytetwild, MPL 2.0) stays within 1 / 2000 of the size of it. By
        default TetGen where it is installed, and fTetWild where it is not, or where no even surface
        can be had that does not cross itself.
    progress : Progress, optional
        Called at the start of every step.

    Returns
    -------
    Preparation

    Raises
    ------
    OptionError
        An option out of range.
    KindError, ArrayError, NonFiniteError
        Neither a surface nor a mask, or an affine that is singular or none.
    ConnectivityError
        Two pieces too large to be debris, or triangles that share no vertices and are too far apart
        to be welded.
    GenusError
        Fewer handles than wanted, or one too many that is longer than ``max_cut`` allows.
    SelfIntersectionError
        The surface crosses itself where cutting out and refilling does not help.
    SolverError
        Remeshing or filling failed.
    MissingDependencyError
        ``gpytoolbox``, or both ``tetgen`` and ``pytetwild``, are not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> raw = sm.samples.double_torus(6)
    >>> done = sm.prepare(raw, faces=1_000, max_cut=0.7)
    >>> done.solid.surface.genus, len(done.cuts)
    (1, 1)
    """
    faces = options.whole("faces", faces, 100)
    genus = options.whole("genus", genus, 0)
    max_cut = options.real("max_cut", max_cut, 0.0)
    options.memory(f"a surface of {faces} faces and its tets", _BYTES_PER_FACE * faces)
    options.callback("progress", progress)
    filler = options.one_of("filler", filler, ("auto", "tetgen", "ftetwild"))
    steps = as_reals(spacing, "spacing", (3,))
    if (steps <= 0.0).any():
        raise OptionError(f"spacing must be three positive numbers, got {steps.tolist()}")
    matrix = np.diag([*steps, 1.0])
    if affine is not None:
        matrix = as_affine(affine)
        if (steps != 1.0).any():
            raise OptionError("spacing is part of the affine; pass one of the two")
    run = _Run(progress, chosen_filler(filler), filler == "auto" and has_ftetwild())
    kept: float | None = None
    if isinstance(surface, np.ndarray):
        V, F = run.arrays("mask", mask_surface, surface, matrix, genus)
        kept = run.steps[-1].counts["voxels_kept"] * abs(float(np.linalg.det(matrix[:3, :3])))
    else:
        raw = as_surface(surface)
        if affine is not None or (steps != 1.0).any():
            raise OptionError(
                "spacing and affine are those of the voxels of a mask, a surface has none"
            )
        V, F = raw.V, raw.F
    V, F = run.arrays("weld", weld_borders, V, F, _WELD * float(np.ptp(V, axis=0).max()))
    if not len(F):
        raise DegenerateError("the surface has no face of any size: all its points lie together")
    V, F = run.arrays("orient", part_sheets, V, F)
    V, F = run.arrays("debris", keep_largest, V, F)
    V, F = run.arrays("holes", close_holes, V, F)
    closed = TriMesh(V, F)
    volume = closed.volume if kept is None else kept  # what smoothing takes of voxels is lost
    if closed.n_faces > 1.3 * max(_WORKING_FACES, 2 * faces):
        closed = run.coarsen(closed, max(_WORKING_FACES, 2 * faces))
    sound = run.uncross(closed)
    whole, cuts = run.cut(sound, genus, max_cut)
    volume += whole.volume - sound.volume  # what was cut is not lost
    solid = run.fill(*run.remesh(whole, faces), of_volume=volume)
    if solid.surface.genus != genus:
        raise GenusError(f"the solid has genus {solid.surface.genus}, {genus} was wanted")
    solid.require_solid_torus() if genus == 1 else solid.diagnose().require()
    return Preparation(solid=solid, genus=genus, cuts=cuts, steps=tuple(run.steps))


class _Run:
    """The steps, each timed, counted and announced."""

    def __init__(self, progress: Progress | None, filler: str, rescue: bool) -> None:
        self.steps: list[Step] = []
        self._filler, self._rescue = filler, rescue  # rescue: fTetWild may help where others fail
        self._progress = progress
        self._start = time.perf_counter()

    def announce(self, name: str) -> None:
        report(self._progress, name, len(self.steps))
        self._start = time.perf_counter()

    def done(self, name: str, counts: Mapping[str, float]) -> None:
        self.steps.append(Step(name, dict(counts), time.perf_counter() - self._start))

    def arrays(self, name: str, step: Callable[..., Any], *arguments: Any) -> tuple[Points, Faces]:
        self.announce(name)
        V, F, counts = step(*arguments)
        self.done(name, counts)
        return V, F

    def coarsen(self, surface: TriMesh, faces: int) -> TriMesh:
        self.announce("coarsen")
        coarse = even(surface, faces, _WORKING_ITERATIONS)
        self.done("coarsen", {"faces_before": surface.n_faces, "faces": coarse.n_faces})
        return coarse

    def uncross(self, surface: TriMesh) -> TriMesh:
        self.announce("crossings")
        try:
            sound, counts = remove_crossings(surface)
        except (SelfIntersectionError, ConnectivityError):  # or cut in two
            sound = rebuilt(surface, 0.5 * _edge_of(surface, _REBUILT_FACES))
            if len(crossings(sound)) or not sound.diagnose().ok:
                raise
            counts = {"crossing": len(crossings(surface)), "faces_rebuilt": sound.n_faces}
        self.done("crossings", counts)
        return sound

    def cut(
        self, surface: TriMesh, genus: int, max_cut: float
    ) -> tuple[TriMesh, tuple[HandleCut, ...]]:
        self.announce("handles")
        whole, cuts = cut_handles(surface, genus, max_cut, self._progress)
        kinds = [cut.kind for cut in cuts]
        counts = {f"{kind}s_cut": float(kinds.count(kind)) for kind in ("handle", "tunnel")}
        gone = 1.0 - whole.volume / surface.volume
        change = "removed" if gone >= 0.0 else "added"
        counts[f"percent_of_volume_{change}"] = round(100.0 * abs(gone), 2)
        self.done("handles", counts)
        if abs(gone) > _MUCH:
            _log.warning(
                "prepare: cutting handles has %s %.0f %% of the volume; look at what is missing, "
                "and lower max_cut if that is part of the shape",
                change, 100.0 * abs(gone),
            )  # fmt: skip
        return whole, cuts

    def remesh(self, surface: TriMesh, faces: int) -> tuple[TriMesh, float, bool]:
        """Even triangles that do not cross, their edge length, and whether there are any."""
        self.announce("remesh")
        try:
            smooth, removed = _remeshed(surface, faces)
        except (SolverError, SelfIntersectionError, ConnectivityError) as error:
            finer = _finer(surface, faces)
            if finer is not None:
                self.done("remesh", {"faces": finer.n_faces, "more_than_asked": 1})
                return finer, _mean_edge(finer), True
            if not self._rescue and self._filler != "ftetwild":
                if isinstance(error, SolverError):
                    raise
                raise SelfIntersectionError(
                    f"with {faces} faces the surface crosses itself where it is thin; ask for "
                    "more faces, or install pytetwild, which fills it all the same"
                ) from error
            self.done("remesh", {"given_up": 1})
            return surface, _edge_of(surface, faces), False
        self.done("remesh", {"faces": smooth.n_faces, "crossing_faces_removed": removed})
        return smooth, _mean_edge(smooth), True

    def fill(self, surface: TriMesh, edge: float, is_even: bool, *, of_volume: float) -> TetMesh:
        """Tets inside, whose boundary edges are about so long."""
        self.announce("fill")
        solid = None
        if is_even and self._filler == "tetgen":
            try:
                solid = tetrahedralize(surface, _TET * edge**3 / (6.0 * 2.0**0.5))
            except (SolverError, SelfIntersectionError) as error:
                if not self._rescue:
                    raise SolverError(f"{error}; ask for more faces", error.ids) from error
        if solid is None:
            solid = fill_within_envelope(surface, edge)
            counts = {"tets_by_ftetwild": float(solid.n_tets)}
        else:
            counts = {"tets": float(solid.n_tets)}
        lost = 1.0 - solid.volume / of_volume
        self.done("fill", {**counts, "percent_of_volume_lost": round(100.0 * lost, 2)})
        if lost > _MUCH:
            _log.warning(
                "prepare: %.0f %% of the volume is lost, as a rule where the solid is thinner than "
                "its triangles are long, or than three voxels; look at what is missing, and ask "
                "for more faces, or take a finer image",
                100.0 * lost,
            )
        return solid


def _remeshed(surface: TriMesh, faces: int) -> tuple[TriMesh, int]:
    """Even triangles that do not cross, and how many faces that did were cut out.

    What crosses is cut out and the rest remeshed again, which fails where it is thin.
    """
    removed, genus = 0, surface.genus
    for _ in range(_REMESHINGS):
        smooth = even(surface, faces)
        if not len(crossings(smooth)):
            return smooth, removed
        surface, counts = remove_crossings(smooth)
        removed += counts["removed"]
        if surface.genus != genus:
            raise SelfIntersectionError("what crosses holds a handle", [])
    return surface, removed


def _finer(surface: TriMesh, faces: int) -> TriMesh | None:
    """Where edges are long, more even triangles than asked for that do not cross, if there are.

    The long, thin triangles themselves would keep fTetWild busy for hours.
    """
    if not has_long_edges(surface, _edge_of(surface, faces)):
        return None
    for more in _FINER:
        try:
            smooth = even(surface, int(more * faces))
        except SolverError:
            continue
        if not len(crossings(smooth)):
            return smooth
    return None


def _edge_of(surface: TriMesh, faces: int) -> float:
    """Edge of so many even triangles on a surface."""
    return math.sqrt(surface.area / faces * 4.0 / math.sqrt(3.0))


def _mean_edge(surface: TriMesh) -> float:
    edges = surface.V[surface.edges]
    return float(np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).mean())
