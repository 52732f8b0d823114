"""Registration of two solid tori, section 7.1: a volume-preserving map that takes landmarks to
landmarks.

The boundaries are laid on each other through their equal-area flat tori; the volume map from source
to target then has its boundary prescribed.
"""

from __future__ import annotations

import csv
import dataclasses
import logging
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from . import _core
from ._arrays import read_only
from ._flat import FlatSurface, Gauge, choose_gauge
from ._match import affine_landmark_map, match_surfaces
from .certificate import Certificate, certify
from .errors import (
    ArrayError,
    CertificationError,
    FileFormatError,
    LandmarkError,
    OptionError,
    SolverError,
)
from .flip_free import FlipFreeOptions, FlipFreeSolver
from .measures import Distortion, distortion
from .mesh import TetMesh
from .progress import Progress
from .refine import Refinement, refine_boundary_joins
from .results import IterationRecord, MapResult
from .vsem import minimise_volumetric_stretch

__all__ = ["Landmarks", "Registration", "landmarks_between", "read_landmarks", "register"]

_log = logging.getLogger("stretchmap")

_WARM_STEPS, _WARM_C = 3, 10.0
_SAME_WAY = 0.8  # least cosine between the normals of two points that are taken to correspond


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Pairs of boundary vertices that correspond.

    Attributes
    ----------
    source, target : ndarray of int32, shape (k,)
        Vertices of the two solids.
    snapped : ndarray, shape (k, 2)
        How far the points given were from these vertices, in source and target; zero for ids.
    """

    source: NDArray[np.int32]
    target: NDArray[np.int32]
    snapped: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.source)

    @classmethod
    def of(
        cls, source: TetMesh, target: TetMesh, source_at: ArrayLike, target_at: ArrayLike
    ) -> Landmarks:
        """Landmarks from vertex ids (k,) or points (k, 3), which go to the nearest boundary vertex.

        Raises
        ------
        ArrayError
            Wrong shapes or numbers of landmarks.
        LandmarkError
            A vertex that is not on the boundary or is used twice; ``ids`` are the landmarks.
        """
        ends = [_snap(mesh, at) for mesh, at in ((source, source_at), (target, target_at))]
        if len(ends[0][0]) != len(ends[1][0]):
            raise ArrayError(
                f"{len(ends[0][0])} landmarks on the source, {len(ends[1][0])} on the target"
            )
        for (ids, _), name in zip(ends, ("source", "target"), strict=True):
            _, first, count = np.unique(ids, return_index=True, return_counts=True)
            if (count > 1).any():
                vertex = ids[first[count > 1][0]]
                same = np.flatnonzero(ids == vertex)
                raise LandmarkError(
                    f"landmarks {same[0]} and {same[1]} are the same {name} vertex {vertex}", same
                )
        return cls(ends[0][0], ends[1][0], np.stack([ends[0][1], ends[1][1]], axis=1))


def _snap(mesh: TetMesh, at: ArrayLike) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    given = np.asarray(at)
    if given.ndim == 1 and given.dtype.kind in "iu":
        if len(given) and not (0 <= given.min() and given.max() < mesh.n_vertices):
            bad = np.flatnonzero((given < 0) | (given >= mesh.n_vertices))
            raise LandmarkError(f"landmark {bad[0]} names no vertex: {given[bad[0]]}", bad)
        inner = np.flatnonzero(mesh.boundary_index[given] < 0)
        if len(inner):
            raise LandmarkError(
                f"landmark {inner[0]}: vertex {given[inner[0]]} is not on the boundary", inner
            )
        return given.astype(np.int32), np.zeros(len(given))
    if given.ndim == 2 and given.shape[1] == 3 and given.dtype.kind in "fiu":
        if not np.isfinite(given).all():
            raise LandmarkError("a landmark is not finite")
        distance, nearest = cKDTree(mesh.V[mesh.boundary_vertices]).query(given.astype(float))
        return mesh.boundary_vertices[nearest], distance
    raise ArrayError(f"landmarks are vertex ids (k,) or points (k, 3), not {given.shape}")


def read_landmarks(path: str | os.PathLike[str], source: TetMesh, target: TetMesh) -> Landmarks:
    """Read landmarks from a CSV file.

    Parameters
    ----------
    path : path-like
        One landmark per row: two vertex ids, or six coordinates (source, then target). A first row
        that is not numbers is a header.
    source, target : TetMesh

    Raises
    ------
    FileFormatError
        If the rows are not like that.
    LandmarkError, ArrayError
        As `Landmarks.of`.
    OSError
        If the file cannot be opened.
    """
    with open(path, newline="", encoding="utf-8") as file:
        rows = [[cell.strip() for cell in row] for row in csv.reader(file) if any(row)]

    def numbers(row: list[str]) -> list[float] | None:
        try:
            return [float(cell) for cell in row]
        except ValueError:
            return None

    if rows and numbers(rows[0]) is None:
        rows = rows[1:]
    table = [numbers(row) for row in rows]
    widths = {len(row) for row in table if row is not None}
    if None in table or not table or widths not in ({2}, {6}):
        raise FileFormatError(
            f"{path}: every row must hold two vertex ids or six coordinates, one landmark per row"
        )
    values = np.array(table, float)
    if widths == {2}:
        if (values != np.round(values)).any():
            raise FileFormatError(f"{path}: vertex ids must be whole numbers")
        return Landmarks.of(source, target, *values.T.astype(np.int64))
    return Landmarks.of(source, target, values[:, :3], values[:, 3:])


@dataclass(frozen=True, eq=False)
class Registration(MapResult):
    """A map from one solid torus onto another.

    Attributes
    ----------
    solid : TetMesh
        The source, refined if refinement was needed; the first vertices are those of the input.
    target : TetMesh
    image : ndarray, shape (n, 3)
        Image of each vertex; boundary vertices lie on the target's surface, landmarks on their
        counterparts.
    landmarks : Landmarks
    landmark_error : float
        Largest distance of a landmark's image from its counterpart, as a share of the diagonal of
        the target's bounding box.
    gauge : Gauge
        How the flat tori were laid on each other.
    h : str
        ``"smooth"`` or ``"affine"``.
    refinement : Refinement or None
    history : tuple of IterationRecord
        Stages ``"match"``, ``"vsem"``, ``"untangle"``, ``"frozen"``.
    distortion : Distortion
    certificate : Certificate
    converged : bool
    stop_reason : str
    seconds : dict
    torus : None
    """

    title = "registration"

    solid: TetMesh
    target: TetMesh
    image: NDArray[np.float64]
    landmarks: Landmarks
    landmark_error: float
    gauge: Gauge
    h: str
    refinement: Refinement | None = field(repr=False)
    history: tuple[IterationRecord, ...] = field(repr=False)
    distortion: Distortion
    certificate: Certificate
    converged: bool
    stop_reason: str
    seconds: Mapping[str, float]
    torus: None = None

    def extra_scalars(self) -> dict[str, Any]:
        """Landmarks, gauge, kind of h and what was added to the input mesh."""
        added = self.refinement
        snapped = self.landmarks.snapped
        return {
            "h": self.h,
            "landmarks": len(self.landmarks),
            "landmark_error": self.landmark_error,
            "snapped": float(snapped.max()) if snapped.size else 0.0,
            "gauge": dataclasses.asdict(self.gauge),
            "added_vertices": 0 if added is None else added.n_split,
            "added_tets": 0 if added is None else added.n_added_tets,
        }

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """The target (``target_V``, ``target_T``) and the landmarks (k, 2)."""
        pairs = np.stack([self.landmarks.source, self.landmarks.target], axis=1)
        return {"target_V": self.target.V, "target_T": self.target.T, "landmarks": pairs}


def register(
    source: TetMesh,
    target: TetMesh,
    landmarks: Landmarks | tuple[ArrayLike, ArrayLike] | str | os.PathLike[str] | None = None,
    *,
    h: str = "smooth",
    max_iter: int = 300,
    tol: float = 1e-3,
    keep_best: bool = False,
    solver: str = "auto",
    options: FlipFreeOptions | None = None,
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
    h : {"smooth", "affine"}
        How landmarks are reached after the surfaces were matched for least distortion of area and
        shape. ``"smooth"``: by the same matching with the landmarks held, kept free of folds by a
        barrier. ``"affine"``: by the paper's piecewise-affine map on a Delaunay triangulation of
        the landmarks, here a periodic one.
    max_iter : int
        Most steps of the surface matching, twice if landmarks are held in it. With 0 and
        ``h="affine"`` the boundary map is the paper's, but for the flat tori's being equal-area.
    tol : float
        Stop the surface matching when a step lowers its energy by no more than this share.
    keep_best : bool
        Return the map even if it is not certified.
    solver : {"auto", "direct", "multigrid", "jacobi"}
        Linear solver of the harmonic and fixed-point steps.
    options : FlipFreeOptions, optional
        Knobs of the volume optimisation.
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
        Landmarks contradict each other; ``ids`` are the two at fault.
    CertificationError
        The map is not a bijection, ``ids`` are the elements.
    OptionError
        An option out of range.
    SolverError
        A numerical step broke down.

    Notes
    -----
    The flat tori can be laid on each other in several ways that respect orientation and meridian:
    both directions reversed or not, Dehn twists, and any shift. With three or more landmarks the
    one that fits them best is taken; else the one in which the two surfaces differ least from
    similar shapes (rotation, translation, scale). Reflections are never used.
    """
    if h not in ("smooth", "affine"):
        raise OptionError(f"h must be 'smooth' or 'affine', got {h!r}")
    if max_iter < 0 or not tol >= 0.0:
        raise OptionError(f"max_iter and tol must not be negative, got {max_iter} and {tol}")
    for mesh in (source, target):
        mesh.require_solid_torus()
    marks = _landmarks(landmarks, source, target)
    seconds: dict[str, float] = {}
    clock = time.perf_counter()
    points, gauge, history = _boundary_map(source, target, marks, h, max_iter, tol, progress)
    seconds["boundary"] = time.perf_counter() - clock
    return _fill(
        source, target, points, marks, gauge, h, history, options or FlipFreeOptions(), solver,
        keep_best, seconds, progress,
    )  # fmt: skip


def _landmarks(given: Any, source: TetMesh, target: TetMesh) -> Landmarks:
    if given is None:
        none = np.zeros(0, np.int32)
        return Landmarks(none, none, np.zeros((0, 2)))
    if isinstance(given, Landmarks):
        return Landmarks.of(source, target, given.source, given.target) if len(given) else given
    if isinstance(given, (str, os.PathLike)):
        return read_landmarks(given, source, target)
    if not (isinstance(given, (tuple, list)) and len(given) == 2):
        raise ArrayError("landmarks must be a pair (source, target), a file or a Landmarks object")
    return Landmarks.of(source, target, *given)


def _boundary_map(
    source: TetMesh,
    target: TetMesh,
    marks: Landmarks,
    h: str,
    max_iter: int,
    tol: float,
    progress: Progress | None,
) -> tuple[NDArray[np.float64], Gauge, tuple[IterationRecord, ...]]:
    """Points of the target surface for the boundary vertices of the source."""
    first, second = FlatSurface.of(source.surface), FlatSurface.of(target.surface)
    pairs = np.stack(
        [source.boundary_index[marks.source], target.boundary_index[marks.target]], axis=1
    )
    gauge = choose_gauge(first, second, pairs)
    first = first.changed(gauge)
    held = pairs if h == "smooth" else pairs[:0]
    match = match_surfaces(
        first, second, first.turns, held, max_iter=max_iter, tol=tol, progress=progress
    )
    points = match.points
    if h == "affine":
        y = match.y
        y = affine_landmark_map(y[pairs[:, 0]], second.turns[pairs[:, 1]], y)
        folded = np.flatnonzero(~(_core.turn_areas(first.chart, np.ascontiguousarray(y)) > 0.0))
        if len(folded):
            raise SolverError(
                f"the source mesh is too coarse for the affine map: {len(folded)} faces turn over; "
                "use h='smooth'",
                folded,
            )
        points = second.points(y)
    points[pairs[:, 0]] = second.surface.V[pairs[:, 1]]
    return points, gauge, match.history


def _fill(
    source: TetMesh,
    target: TetMesh,
    points: NDArray[np.float64],
    marks: Landmarks,
    gauge: Gauge,
    h: str,
    history: tuple[IterationRecord, ...],
    options: FlipFreeOptions,
    solver: str,
    keep_best: bool,
    seconds: dict[str, float],
    progress: Progress | None,
) -> Registration:
    """The volume map with the boundary prescribed."""
    clock = time.perf_counter()
    refinement = refine_boundary_joins(source)
    solid, ids = refinement.solid, source.boundary_vertices
    enclosed = float(_core.enclosed_volume(points, source.surface.F))
    if not enclosed > 0.0:
        raise SolverError("the boundary image is inside out")
    length, centre = enclosed ** (1.0 / 3.0), points.mean(axis=0)
    V = np.ascontiguousarray((solid.V - solid.V.mean(axis=0)) / source.volume ** (1.0 / 3.0))
    x = np.zeros((solid.n_vertices, 3))
    x[ids] = (points - centre) / length
    fixed = np.zeros(solid.n_vertices, np.uint8)
    fixed[ids] = 1
    run = minimise_volumetric_stretch(
        V, solid.T, fixed, x, c=_WARM_C, max_iter=_WARM_STEPS, tol=0.0, solver=solver,
        progress=progress,
    )  # fmt: skip
    flip_free = FlipFreeSolver(
        V=V, T=solid.T, boundary=ids, faces=ids[source.surface.F], R=2.0, r=1.0, options=options,
        progress=progress,
    )  # fmt: skip
    x, flips = flip_free.untangle(run.image, glide=False)
    converged, stop_reason = False, f"{flips} tets could not be untangled"
    if flips == 0:
        x, converged, stop_reason = flip_free.minimise(
            x, glide=False, start=1.0, goal=options.volume_weight
        )
    seconds["volume"] = time.perf_counter() - clock
    image = x * length + centre
    image[ids] = points
    clock = time.perf_counter()
    certificate = certify(solid, image)
    seconds["certificate"] = time.perf_counter() - clock
    if not certificate.certified and not keep_best:
        raise CertificationError(
            f"the registration is not certified: {certificate.reason}; keep_best=True returns it "
            "all the same",
            next(iter(certificate.ids.values()), ()),
        )
    if not converged:
        _log.warning("registration not converged: %s", stop_reason)
    gap = image[marks.source] - target.V[marks.target]
    size = float(np.linalg.norm(np.ptp(target.V, axis=0)))
    return Registration(
        solid=solid,
        target=target,
        image=read_only(image),
        landmarks=marks,
        landmark_error=float(np.linalg.norm(gap, axis=1).max(initial=0.0)) / size,
        gauge=gauge,
        h=h,
        refinement=refinement if refinement.n_split else None,
        history=history + run.history + tuple(flip_free.history),
        distortion=distortion(solid, image),
        certificate=certificate,
        converged=converged,
        stop_reason=stop_reason,
        seconds=seconds,
    )


def landmarks_between(registration: Registration, n: int = 36) -> Landmarks:
    """Landmarks by a geometric rule, where nobody has placed any.

    The source is laid on the target by the similarity that fits the registration best. Candidates
    are taken one by one from the source's boundary, each the farthest from those before; each goes
    with the nearest target vertex, provided that the normals there agree (cosine above 0.8) and
    that the way back ends within two mean edge lengths of where it began.

    Parameters
    ----------
    registration : Registration
        Made without landmarks.
    n : int
        Number of landmarks.

    Raises
    ------
    OptionError
        If ``n`` is not positive.
    LandmarkError
        If the rule finds fewer.
    """
    if n < 1:
        raise OptionError(f"n must be positive, got {n}")
    solid, target = registration.solid, registration.target
    first, second = solid.surface, target.surface
    image = registration.image[solid.boundary_vertices]
    rotation, scale, shift = similarity(first.V, image)
    moved = scale * first.V @ rotation + shift
    there, back = cKDTree(second.V), cKDTree(moved)
    _, partner = there.query(moved)
    normals = _vertex_normals(first.V, first.F) @ rotation
    agree = np.einsum("ij,ij->i", normals, _vertex_normals(second.V, second.F)[partner])
    _, home = back.query(second.V[partner])
    edge = np.linalg.norm(np.diff(moved[first.edges], axis=1), axis=2).mean()
    usable = (agree > _SAME_WAY) & (np.linalg.norm(moved[home] - moved, axis=1) < 2.0 * edge)
    chosen: list[int] = []
    nearest = np.where(usable, np.linalg.norm(moved - moved.mean(axis=0), axis=1), -1.0)
    while len(chosen) < n and nearest.max() > 0.0:
        i = int(np.argmax(nearest))
        if partner[i] in partner[chosen]:
            nearest[i] = -1.0
            continue
        chosen.append(i)
        distance = np.linalg.norm(moved - moved[i], axis=1)
        nearest = np.minimum(nearest, distance) if len(chosen) > 1 else distance
        nearest[~usable] = -1.0
    if len(chosen) < n:
        raise LandmarkError(f"the rule finds {len(chosen)} landmarks, {n} were asked for")
    return Landmarks.of(
        solid,
        target,
        solid.boundary_vertices[chosen],
        target.boundary_vertices[partner[chosen]],
    )


def similarity(
    points: NDArray[np.float64], images: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Rotation, scale, shift with ``scale * points @ rotation + shift`` nearest to the images."""
    p, q = points - points.mean(axis=0), images - images.mean(axis=0)
    U, S, W = np.linalg.svd(p.T @ q)
    S[2] *= np.sign(np.linalg.det(U @ W))
    U[:, 2] *= np.sign(np.linalg.det(U @ W))
    scale = float(S.sum() / (p**2).sum())
    rotation = U @ W
    return rotation, scale, images.mean(axis=0) - scale * points.mean(axis=0) @ rotation


def _vertex_normals(V: NDArray[np.float64], F: NDArray[np.int32]) -> NDArray[np.float64]:
    face = _core.face_area_vectors(V, F)
    sums = [np.bincount(F.ravel(), np.repeat(c, 3), minlength=len(V)) for c in face.T]
    normals = np.stack(sums, axis=1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
