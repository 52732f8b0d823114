"""A start for the matching of surfaces by way of space: what lies where a smooth deformation of one
solid onto the other takes it.

Flat tori laid on each other whole put a process where its conformal image happens to lie, which may
be beside that of the other surface, and matching does not always bring it there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .. import _core
from ..base.progress import Progress
from ..base.torus import wrapped
from ..deformation.fitting import Anchors, Fit, Template
from ..deformation.similarity import Similarity
from ..deformation.smooth import settled, smooth_deformation
from ..mesh.meshes import TetMesh, TriMesh
from ..mesh.normals import vertex_normals
from ..mesh.split_edges import SplitSolid
from .embed import EmbeddedBoundary, crossing_faces, split_long_edges
from .flat_torus import FlatSurface, Gauge, choose_gauge, descended

__all__ = ["SmoothStart"]

_POINTS = 1000  # of either surface that draw: about ten a site
_POSES = 2  # that are followed to the end
_SAMPLE = 300  # vertices the gauge is chosen by
# Weights, one after the other, of squared distances over the target's area against what it costs to
# bend the flat torus.
_PULLS = (10.0, 100.0, 1000.0)
_STEPS, _TOL = 40, 1e-3
_COLLAPSED = 10.0  # distortion of a face
_SAME_WAY = 0.5  # least cosine between normals of a vertex and of the face it is drawn to


@dataclass(frozen=True, eq=False)
class SmoothStart:
    """A smooth deformation of the source that brings its boundary close to the target's.

    Attributes
    ----------
    source, target : TetMesh
    flat, second : FlatSurface
        Their boundaries, the target's with no edge longer than half a turn.
    held : ndarray of int32, shape (k,)
        Landmarks, surface vertices of the source.
    template : Template
        The source.
    pose : Similarity
    fit : Fit
        In the pose of the source.
    gauge : Gauge
        In which the flat tori agree best with it.
    """

    source: TetMesh
    target: TetMesh
    flat: FlatSurface
    second: FlatSurface
    held: NDArray[np.int32]
    template: Template
    pose: Similarity
    fit: Fit
    gauge: Gauge

    @classmethod
    def of(
        cls,
        source: TetMesh,
        target: TetMesh,
        flat: FlatSurface,
        second: FlatSurface,
        pairs: NDArray[np.int32],
        start: NDArray[np.float64] | None,
        progress: Progress | None,
    ) -> SmoothStart:
        """With landmarks (k, 2), surface vertices of source and target; from the poses in which the
        surfaces come closest as rigid bodies and from a first guess, if there is one, of where
        boundary vertices go (nb, 3).

        Raises
        ------
        DegenerateError
            The landmarks lie on one point.
        SolverError
            A point lies in no face of the target's flat torus.
        """
        held = pairs[:, 0]
        marks = target.surface.V[pairs[:, 1]] if len(pairs) else None
        anchors = Anchors.of(source.surface, source.surface.V[held]) if len(pairs) else None
        template = Template(source, anchors, n_points=_POINTS)
        pose, fit = smooth_deformation(template, target, start, marks, _POSES, progress)
        ids = np.arange(0, flat.surface.n_vertices, max(1, flat.surface.n_vertices // _SAMPLE))
        there = pose(fit.points[source.boundary_vertices[ids]])
        gauge = choose_gauge(flat, second, (ids, there), "smooth fit")
        return cls(source, target, flat, second, held, template, pose, fit, gauge)

    def turns(self) -> tuple[SplitSolid, FlatSurface]:
        """The source, boundary edges halved that are longer than half a turn, and its boundary near
        there in the target's flat torus, free of folds."""
        split, first = split_long_edges(SplitSolid.of(self.source), self.flat.changed(self.gauge))
        there = self.template.deformed(first.surface.V, self.fit.coefficients)
        drawn = first.at(_drawn(first, self.second, self.pose(there)))
        return split_long_edges(split, drawn)  # which may have become longer

    def laid(self, marks: NDArray[np.float64]) -> tuple[EmbeddedBoundary, float]:
        """The closest points of the target's surface, moved along it where faces cross, landmarks
        at ``marks`` (k, 3); and the distortion of faces, as the matching takes it."""
        goal = TriMesh(self.pose.back(self.target.surface.V), self.target.surface.F)
        points = np.array(self.fit.projected)
        points[self.held] = self.pose.back(marks)
        points = self.pose(settled(self.template, goal, points, self.held))
        points[self.held] = marks
        crossings = crossing_faces(points, self.source.surface)
        embedded = EmbeddedBoundary(SplitSolid.of(self.source), points, crossings)
        return embedded, _distortion(self.source.surface, self.target.surface, points)


def _distortion(surface: TriMesh, target: TriMesh, points: NDArray[np.float64]) -> float:
    """Mean over the area of ``|J|^2 / (2 det) + (det + 1 / det) / 2 - 2``, the areas made equal;
    of faces that have next to collapsed no more than counts."""
    F = surface.F
    rest = _core.volume.rest_triangles(surface.V, F, target.area / surface.area).reshape(-1, 2, 2)
    edges = np.stack([points[F[:, 1]] - points[F[:, 0]], points[F[:, 2]] - points[F[:, 0]]], -1)
    gram = np.einsum("fki,fkj->fij", edges @ rest, edges @ rest)
    det = np.maximum(np.sqrt(np.maximum(np.linalg.det(gram), 0.0)), 1e-12)
    value = 0.5 * (np.trace(gram, axis1=1, axis2=2) / det + det + 1.0 / det) - 2.0
    return float(np.average(np.minimum(value, _COLLAPSED), weights=surface.face_areas))


def _drawn(
    first: FlatSurface, second: FlatSurface, there: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Turns (n, 2): the flat torus of the source bent, without folds, until its vertices come close
    to those faces of the target that are closest to where they are in space, ``there`` (n, 3)."""
    surface, target = first.surface, second.surface
    tree = _core.maps.SurfaceTree(target.V, target.F)
    _, faces, weights = tree.closest(np.ascontiguousarray(there))
    goals = np.einsum("nk,nkj->nj", weights, second.corners(faces))
    normals = np.nan_to_num(vertex_normals(there, surface.F))
    sides = np.nan_to_num(vertex_normals(target.V, target.F))[target.F[faces]].sum(axis=1)
    agree = np.einsum("nx,nx->n", normals, sides) > _SAME_WAY * np.linalg.norm(sides, axis=1)
    shares = np.bincount(surface.F.ravel(), np.repeat(surface.face_areas, 3)) / (3 * surface.area)
    slopes = second.slopes(goals).reshape(-1, 3, 2)
    metric = np.einsum("n,nki,nkj->nij", shares * agree / target.area, slopes, slopes)

    plane, chart, y = np.eye(2), first.chart, first.turns
    corners = first.corners(np.arange(surface.n_faces))
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    rest = np.ascontiguousarray(np.linalg.inv(edges).reshape(-1, 4))
    areas = 0.5 * np.linalg.det(edges)

    def bent(pull: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = np.arange(len(y) + 1)
        drawing = sp.bsr_matrix((pull * metric, rows[:-1], rows))

        def value(y: NDArray[np.float64]) -> float:
            gaps = wrapped(goals - y).ravel()
            drawn = 0.5 * float(np.einsum("n,n->", gaps, drawing @ gaps))
            return drawn + _core.registration.flat_value(chart, y, plane, rest, areas)

        def model(y: NDArray[np.float64]) -> tuple[NDArray[np.float64], sp.csr_matrix]:
            gradient, hessian = _core.registration.flat_model(chart, y, plane, rest, areas)
            gaps = wrapped(goals - y).ravel()
            return gradient - drawing @ gaps, (hessian + drawing).tocsr()

        return descended(value, model, y, steps=_STEPS, tol=_TOL)

    for pull in _PULLS:
        y = bent(pull, y)
    return y
