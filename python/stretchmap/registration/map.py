"""Registration of two solid tori, section 7.1: a volume-preserving map that takes landmarks to
landmarks.

The boundaries are laid on each other through their flat tori; the volume map from source
to target then has its boundary prescribed, or gliding from there.
"""

from __future__ import annotations

import logging
import os
import time
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import read_only
from ..base.budget import Budget
from ..base.options import callback, flag, instance, one_of, real, whole
from ..base.progress import Progress
from ..base.threads import takes_threads
from ..certificate.checks import certify
from ..certificate.findings import Certificate, require_certified
from ..errors import ArrayError, CertificationError, LandmarkError
from ..maps.history import IterationRecord
from ..mesh.given import as_solid
from ..mesh.meshes import TetMesh
from ..mesh.refinement import Refinement
from ..volume.options import FillOptions, check_prescribed
from .boundary import BoundaryWays
from .filling import Filled, fill_boundary, fill_either_way
from .landmarks import Landmarks, read_landmarks
from .mirror import mirrored_landmarks
from .result import LandmarkMap, Registration

__all__ = ["register"]

_log = logging.getLogger("stretchmap")

_AGAIN = 0.1  # share of the time that a last attempt with the boundary held has at least


@takes_threads
def register(
    source: TetMesh,
    target: TetMesh,
    landmarks: Landmarks | tuple[ArrayLike, ArrayLike] | str | os.PathLike[str] | None = None,
    *,
    boundary: Literal["glide", "frozen"] = "glide",
    landmark_map: LandmarkMap = "smooth",
    max_iter: int = 300,
    tol: float = 1e-3,
    keep_best: bool = False,
    options: FillOptions | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Registration:
    """Map one solid torus onto another, every piece keeping its share of the volume.

    Parameters
    ----------
    source, target : TetMesh
        Solid tori.
    landmarks : Landmarks, (source, target), path or None
        Pairs that correspond: vertex ids (k,) or points (k, 3) on either side, or a CSV file (see
        `read_landmarks`). Points are moved to the nearest boundary vertex; the result says how far.
    boundary : {"glide", "frozen"}
        ``"glide"``: boundary vertices, but for landmarks, move on the target's surface until
        volumes are kept below it as they are inside, and no farther (``glide_std`` and
        ``glide_distortion`` of `FillOptions`). ``"frozen"``: they stay where the matching of
        the surfaces put them, which is closer to where a smooth deformation that does not keep
        volumes would; but where nothing inside can untangle tets, those round them give way. A map
        that need not glide, or that gliding would make cross itself at once, is kept frozen; the
        result says which it is.
    landmark_map : {"smooth", "affine"}
        How landmarks are reached after the surfaces were matched for least distortion of area and
        shape. ``"smooth"``: by the same matching with the landmarks held, kept free of folds by a
        barrier, if need be with edges of the boundary halved. ``"affine"``: by the paper's
        piecewise-affine map on a Delaunay triangulation of the landmarks, here a periodic one.
    max_iter : int
        Most steps of the surface matching, twice if landmarks are held in it. With 0 and
        ``landmark_map="affine"`` the boundary map is the paper's, but for the choice of the flat
        tori.
    tol : float
        Stop the surface matching when a step lowers its energy by no more than this share.
    keep_best : bool
        Return the map even if it is not certified.
    options : FillOptions, optional
        Knobs of the volume optimization.
    threads : int, optional
        Threads to use, see `threads`; the result depends on it only where time runs short.
    progress : Progress, optional
        Called once per step.

    Returns
    -------
    Registration

    Raises
    ------
    MeshError
        A mesh is not a solid torus, see `TetMesh.require_solid_torus`.
    LandmarkError
        Landmarks contradict each other; ``ids`` are the two at fault. Where they fit far better
        after a reflection, the message says so.
    CertificationError
        The map is not a bijection, ``ids`` are the elements.
    OptionError
        An option out of range or combined with one it excludes.
    SolverError
        A numerical step broke down, or a flat torus shrinks faces far out on a limb to nothing;
        ``ids`` are faces of that boundary.

    Notes
    -----
    The flat tori can be laid on each other in several ways that respect orientation and meridian:
    both directions reversed or not, Dehn twists, and any shift. With three or more landmarks the
    one that fits them best is taken; else the one in which the two surfaces differ least from
    similar shapes (rotation, translation, scale). Reflections are never used.

    Where the surfaces laid on each other cross or are distorted much, or landmarks cannot be
    reached, the source goes where a smooth deformation in space takes it (a thin-plate spline, by
    iterative closest points), or is matched once more from there if it crosses. Without landmarks
    and with ``boundary="glide"`` that is tried as well where two fifths of the time leave tets
    inverted or volumes far off, and then the volume map of the source followed by the inverse of
    the target's, if both can be had in time; the best map is returned.

    Examples
    --------
    >>> import stretchmap as sm
    >>> pair = sm.samples.vertebra_pair(n_landmarks=4, n_tets=(600, 800))
    >>> marks = (pair.source_landmarks, pair.target_landmarks)
    >>> result = sm.register(pair.source, pair.target, marks)
    >>> result.certificate.certified, result.landmark_error < 1e-9
    (True, True)
    """
    source, target = as_solid(source, "source"), as_solid(target, "target")
    one_of("boundary", boundary, ("glide", "frozen"))
    one_of("landmark_map", landmark_map, ("smooth", "affine"))
    max_iter, tol = whole("max_iter", max_iter, 0), real("tol", tol, 0.0)
    keep_best = flag("keep_best", keep_best)
    callback("progress", progress)
    if options is not None:
        instance("options", options, FillOptions, "stretchmap.FillOptions(...)")
        check_prescribed(options, glide=boundary == "glide")
    for mesh in (source, target):
        mesh.require_solid_torus()
    marks = _landmarks(landmarks, source, target)
    options = FillOptions() if options is None else options
    budget = Budget.of(options.time_limit, source.n_tets)
    seconds: dict[str, float] = {}
    clock = time.perf_counter()
    mirrored = mirrored_landmarks(source.V[marks.source], target.V[marks.target])
    if mirrored:
        _log.warning("%s", mirrored)
    try:
        ways = BoundaryWays(
            source, target, marks, landmark_map, max_iter=max_iter, tol=tol, progress=progress
        )
        waiting = ways.lay(budget)
        laid = waiting[0]
    except LandmarkError as error:
        raise LandmarkError(f"{error}; {mirrored}" if mirrored else str(error), error.ids) from None
    embedded, gauge = laid.embedded, laid.gauge
    seconds["boundary"] = time.perf_counter() - clock
    clock, filled = time.perf_counter(), None
    if boundary == "glide" and not len(marks):
        filled = fill_either_way(source, target, waiting, ways, options, budget, progress)
    if filled is None:
        if len(embedded.crossings) and not keep_best:
            raise CertificationError(
                f"{len(embedded.crossings)} pairs of faces of the boundary image cross, and "
                "refining the source's boundary does not help: the surfaces differ too much; "
                "landmarks may bring them together, keep_best=True returns the map all the same",
                embedded.crossings.ravel(),
            )
        glide = boundary == "glide" and not len(embedded.crossings)
        filled = fill_boundary(
            embedded, gauge, target, options,
            pinned=marks.source, glide=glide, budget=budget, progress=progress,
        )  # fmt: skip
    certificate = certify(filled.outcome.problem.solid, _image(filled))
    if not certificate.certified and filled.outcome.glided:  # a matter of rounding
        again = Budget(max(budget.left, _AGAIN * budget.seconds))
        filled = fill_boundary(
            filled.boundary, filled.gauge, target, options,
            pinned=marks.source, glide=False, budget=again, progress=progress,
        )  # fmt: skip
        certificate = certify(filled.outcome.problem.solid, _image(filled))
    seconds["volume"] = time.perf_counter() - clock
    if not keep_best:
        require_certified(certificate, "the registration")
    return _result(filled, certificate, target, marks, landmark_map, ways.history, seconds)


def _landmarks(given: Any, source: TetMesh, target: TetMesh) -> Landmarks:
    if given is None:
        none = np.zeros(0, np.int32)
        return Landmarks(none, none, np.zeros((0, 2)))
    if isinstance(given, Landmarks):
        if len(given):
            Landmarks.of(source, target, given.source, given.target)  # of these two solids
        return given
    if isinstance(given, (str, os.PathLike)):
        return read_landmarks(given, source, target)
    if not (isinstance(given, (tuple, list)) and len(given) == 2):
        raise ArrayError("landmarks must be a pair (source, target), a file or a Landmarks object")
    return Landmarks.of(source, target, *given)


def _image(filled: Filled) -> NDArray[np.float64]:
    """Of all vertices (n, 3); where the boundary did not move, the very points it was laid on."""
    problem, boundary = filled.outcome.problem, filled.boundary
    image = problem.x * problem.length + problem.center
    skin = boundary.split.solid.boundary_vertices
    start = (boundary.points - problem.center) / problem.length
    still = (problem.x[skin] == start).all(axis=1)
    image[skin[still]] = boundary.points[still]
    return np.asarray(image)


def _stop_reason(filled: Filled, certificate: Certificate) -> str:
    """Why the optimization ended; where the boundary crossed itself to begin with, that."""
    outcome, crossings = filled.outcome, len(filled.boundary.crossings)
    if certificate.certified or not crossings:
        return outcome.stop_reason
    return (
        f"{crossings} pairs of faces of the boundary image cross, which more time does not mend, "
        f"but landmarks may: {outcome.stuck or outcome.stop_reason}"
    )


def _result(
    filled: Filled,
    certificate: Certificate,
    target: TetMesh,
    marks: Landmarks,
    landmark_map: LandmarkMap,
    history: tuple[IterationRecord, ...],
    seconds: dict[str, float],
) -> Registration:
    outcome, split = filled.outcome, filled.boundary.split
    refined = outcome.problem.refinement
    added = Refinement.of(split) if refined is None else refined.after(split)
    stop_reason = _stop_reason(filled, certificate)
    if not outcome.converged:
        _log.warning("registration not converged: %s", stop_reason)
    image = _image(filled)
    gap = image[marks.source] - target.V[marks.target]
    size = float(np.linalg.norm(np.ptp(target.V, axis=0)))
    return Registration(
        mesh=outcome.problem.solid,
        target=target,
        image=read_only(image),
        landmarks=marks,
        landmark_error=float(np.linalg.norm(gap, axis=1).max(initial=0.0)) / size,
        gauge=filled.gauge,
        landmark_map=landmark_map,
        refinement=added if added.n_split else None,
        boundary="glide" if outcome.glided else "frozen",
        boundary_splits=split.n_split,
        history=history + outcome.history,
        certificate=certificate,
        converged=outcome.converged and certificate.certified,
        stop_reason=stop_reason,
        seconds=seconds,
    )
