"""The smoothest deformation of a template that brings its surface onto another.

What corresponds along the surface is decided by smoothness alone: points are drawn along normals
only. So nothing slides to even out areas, as it does where areas are to be preserved.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .. import _core
from ..mesh.meshes import TetMesh, TriMesh
from ..mesh.normals import vertex_normals
from .thin_plate import ThinPlate

__all__ = ["Anchors", "Fit", "Template", "fit_surface"]

_SITES, _FEW_SITES = 100, 40  # of the spline, and of one for a first look
# Weights of the bending energy, one after the other, against the mean square distance.
_STIFFNESS = (1e-3, 1e-4, 1e-5)
_STEPS = 12  # most with each
_AT_REST = 2e-4  # a step that moves by less, over the size, is the last
_SAME_WAY = 0.5  # least cosine between normals of points drawn to each other

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Anchors:
    """Points fixed to the faces of a surface.

    Attributes
    ----------
    faces : ndarray of int32, shape (l,)
    weights : ndarray, shape (l, 3)
        Barycentric coordinates.
    """

    faces: NDArray[np.int32]
    weights: Array

    @classmethod
    def of(cls, surface: TriMesh, points: Array) -> Anchors:
        """The closest points of the surface."""
        tree = _core.maps.SurfaceTree(surface.V, surface.F)
        _, faces, weights = tree.closest(np.ascontiguousarray(points))
        return cls(faces, weights)

    def at(self, values: Array, faces: NDArray[np.int32]) -> Array:
        """Values (l, c) at the points from values at the vertices (n, c)."""
        return np.asarray(np.einsum("lk,lkc->lc", self.weights, values[faces[self.faces]]))


@dataclass(frozen=True, eq=False)
class Template:
    """A solid prepared for being deformed onto others.

    Attributes
    ----------
    solid : TetMesh
    anchors : Anchors or None
        Its landmarks.
    n_sites : int
        Of the spline.
    n_points : int or None
        Vertices of either surface, at least, that draw, evenly spread over their rows; all without.
        With ten a site correspondences of a population are off by 0.11 % of the size instead of
        0.10 %.
    """

    solid: TetMesh
    anchors: Anchors | None = None
    n_sites: int = _SITES
    n_points: int | None = None

    @cached_property
    def spline(self) -> ThinPlate:
        """Sites on the surface, where forces act."""
        return ThinPlate.of(self.solid.surface.V, self.n_sites)

    @cached_property
    def features(self) -> Array:
        """Of the spline, at the surface's vertices."""
        return self.spline.features(self.solid.surface.V)

    def deformed(self, points: Array, coefficients: Array) -> Array:
        """Where the spline takes points (k, 3)."""
        return np.asarray(points + self.spline.features(points) @ coefficients)

    @cached_property
    def coarse(self) -> Template:
        """The same with a spline of few sites."""
        return Template(self.solid, self.anchors, _FEW_SITES, self.n_points)

    @cached_property
    def ring_mean(self) -> sp.csr_matrix:
        """(nb, nb) Takes values at the surface's vertices to the means of their neighbors."""
        edges, n = self.solid.surface.edges, self.solid.surface.n_vertices
        ends = np.concatenate([edges, edges[:, ::-1]])
        degree = np.bincount(ends[:, 0], minlength=n)
        shares = 1.0 / degree[ends[:, 0]]
        return sp.csr_matrix((shares, (ends[:, 0], ends[:, 1])), shape=(n, n))


@dataclass(frozen=True, eq=False)
class Fit:
    """What `fit_surface` found.

    Attributes
    ----------
    coefficients : ndarray, shape (m + 4, 3)
        Of the spline.
    points : ndarray, shape (n, 3)
        Where it takes the template's vertices.
    projected : ndarray, shape (nb, 3)
        The closest points of the goal.
    distance : float
        Root mean square between the two.
    energy : float
        Of bending and distance: the least of several fits is the one to be believed.
    """

    coefficients: Array
    points: Array
    projected: Array
    distance: float
    energy: float


def fit_surface(
    template: Template,
    goal: TriMesh,
    start: Array,
    landmarks: Array | None,
    *,
    coarse: bool = False,
) -> Fit:
    """Lay the template's surface onto a goal in the same pose, by the smoothest deformation.

    Parameters
    ----------
    template : Template
    goal : TriMesh
    start : ndarray, shape (nb, 3)
        A first guess of where the boundary vertices go.
    landmarks : ndarray, shape (l, 3), or None
        Where the template's landmarks belong.
    coarse : bool
        A first look: few sites, and only the stiffest spline.

    Returns
    -------
    Fit

    Notes
    -----
    Iterative closest points with normals, from either surface to the other, the stiffness lowered
    in steps as long as that brings the surfaces closer (Chen and Medioni 1992; Amberg, Romdhani,
    Vetter, CVPR 2007). Pairs whose normals are more than 60 degrees apart are left out.
    """
    template = template.coarse if coarse else template
    rest = template.solid.surface.V
    side = _Side(goal.V, goal.F)
    coefficients, kept = _guess(template, start - rest), None
    for stiffness in _STIFFNESS[:1] if coarse else _STIFFNESS:
        coefficients = _drawn(template, side, coefficients, stiffness, landmarks)
        found = _fit(template, side, coefficients)
        # Where it is the faces of the meshes that keep them apart, a softer spline follows these,
        # ends farther off and folds.
        if kept is not None and not found.distance < kept.distance:
            break
        kept = found
    assert kept is not None
    return kept


def _drawn(
    template: Template, side: _Side, coefficients: Array, stiffness: float, landmarks: Array | None
) -> Array:
    """Coefficients at rest between bending and what draws onto the goal."""
    surface, spline = template.solid.surface, template.spline
    rest, F = surface.V, surface.F
    for _ in range(_STEPS):
        points = rest + template.features @ coefficients
        equations = _Equations(len(spline.bending), stiffness * spline.bending)
        _draw(equations, template, _Side(points, F), side)
        if landmarks is not None and template.anchors is not None:
            features = template.anchors.at(template.features, F)
            equations.hold(features, landmarks - template.anchors.at(rest, F))
        found = equations.solution()
        step = float(np.abs(template.features @ (found - coefficients)).max())
        coefficients = found
        if step < _AT_REST * spline.length:
            break
    return coefficients


def _fit(template: Template, side: _Side, coefficients: Array) -> Fit:
    solid, spline = template.solid, template.spline
    points = template.deformed(solid.V, coefficients)
    skin = np.ascontiguousarray(points[solid.boundary_vertices])
    projected = side.tree.closest(skin)[0]
    square = float(((projected - skin) ** 2).sum(axis=1).mean())
    bending = float(np.einsum("rk,rs,sk->", coefficients, spline.bending, coefficients))
    return Fit(coefficients, points, projected, math.sqrt(square), square + _STIFFNESS[0] * bending)


class _Side:
    """One of the two surfaces, with what closest points need."""

    def __init__(self, points: Array, faces: NDArray[np.int32]) -> None:
        self.V, self.F = np.ascontiguousarray(points), faces
        self.tree = _core.maps.SurfaceTree(self.V, self.F)
        self.normals = np.nan_to_num(vertex_normals(self.V, self.F))


class _Equations:
    """Normal equations for coefficients (r, 3), as blocks of the three coordinates."""

    def __init__(self, size: int, penalty: Array) -> None:
        self.size = size
        self.matrix = np.zeros((3, size, 3, size))
        self.right = np.zeros((3, size))
        for k in range(3):
            self.matrix[k, :, k] = penalty

    def draw(self, features: Array, normals: Array, gaps: Array, weight: float) -> None:
        """Displacements along normals (n, 3) are to be the gaps (n,)."""
        for a in range(3):
            along = weight * normals[:, a]
            self.right[a] += np.einsum("nr,n->r", features, along * gaps)
            for b in range(a, 3):
                # Not by BLAS, whose threads take turns with all else that the machine has to do.
                block = _core.linalg.normal_matrix(features, along * normals[:, b])
                self.matrix[a, :, b] += block
                if b != a:
                    self.matrix[b, :, a] += block.T

    def hold(self, features: Array, displacements: Array) -> None:
        """Displacements of landmarks are to be these (l, 3), in the mean."""
        block = np.einsum("lr,ls->rs", features, features) / len(features)
        for k in range(3):
            self.matrix[k, :, k] += block
            self.right[k] += np.einsum("lr,l->r", features, displacements[:, k]) / len(features)

    def solution(self) -> Array:
        n = 3 * self.size
        solved = _core.linalg.solve_dense(self.matrix.reshape(n, n), self.right.ravel())
        return np.ascontiguousarray(solved.reshape(3, self.size).T)


def _guess(template: Template, displacements: Array) -> Array:
    """Stiff coefficients nearest to displacements of the boundary vertices."""
    spline = template.spline
    equations = _Equations(len(spline.bending), _STIFFNESS[0] * spline.bending)
    equations.hold(template.features, displacements)
    return equations.solution()


def _draw(equations: _Equations, template: Template, moved: _Side, goal: _Side) -> None:
    """Pairs of closest points, from the moved template to the goal and back."""
    ours, theirs = (_some(len(side.V), template.n_points) for side in (moved, goal))
    surface, features = template.solid.surface.V, template.features
    rest, points, total = surface[ours], goal.V[theirs], len(moved.V) + len(goal.V)
    share = len(moved.V) / total
    feet, faces, weights = goal.tree.closest(moved.V[ours])
    normals = _unit(np.einsum("nk,nkx->nx", weights, goal.normals[goal.F[faces]]))
    near = np.einsum("nx,nx->n", normals, moved.normals[ours]) > _SAME_WAY
    gaps = np.einsum("nx,nx->n", normals, feet - rest)
    equations.draw(features[ours[near]], normals[near], gaps[near], share / len(ours))

    _, faces, weights = moved.tree.closest(points)
    corners = moved.F[faces]
    normals = _unit(np.einsum("nk,nkx->nx", weights, moved.normals[corners]))
    near = np.einsum("nx,nx->n", normals, goal.normals[theirs]) > _SAME_WAY
    corners, weights, normals = corners[near], weights[near], goal.normals[theirs[near]]
    gaps = points[near] - np.einsum("nk,nkx->nx", weights, surface[corners])
    there = np.einsum("nk,nkr->nr", weights, features[corners])
    equations.draw(
        there, normals, np.einsum("nx,nx->n", normals, gaps), (1.0 - share) / len(theirs)
    )


def _some(count: int, wanted: int | None) -> NDArray[np.intp]:
    """Ids of vertices that stand for all."""
    return np.arange(0, count, 1 if wanted is None else max(1, count // wanted))


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0.0, lengths, 1.0))
