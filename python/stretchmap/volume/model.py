"""What all stages of the flip-free optimization share: the solid, its rest shapes, its boundary."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.budget import Budget
from ..base.progress import Progress, report
from ..base.torus import Torus
from ..maps.history import IterationRecord
from ..mesh.meshes import TriMesh
from .options import FillOptions

__all__ = ["History", "SolidModel", "face_areas"]

FREE, FIXED, GLIDING = 0, 1, 2
_THICK = 0.02  # share of the mean volume round its vertices that a sliver is given
# Weight of volume that is lost as a whole, where boundary faces cut off what is curved: with all of
# it, tets press outward against faces that cannot give way, and single ones pay for what all are
# missing; with none, hardly anything keeps faces from growing.
_AS_A_WHOLE = 0.1
_REACH = 8.0  # factor up to which the volume next to a boundary face may be off what it expects


@dataclass(frozen=True, eq=False)
class SolidModel:
    """A solid and what is asked of its image, on the scale of the image.

    Attributes
    ----------
    V : ndarray, shape (n, 3)
        Source positions, scaled to the volume of the image.
    T : ndarray of int32, shape (k, 4)
    boundary : ndarray of int32, shape (nb,)
        Boundary vertices.
    faces : ndarray of int32, shape (m, 3)
        Boundary faces in solid vertex ids.
    options : FillOptions
    torus : Torus or None
        What the boundary may glide on; None where it is prescribed.
    ground : TriMesh or None
        The same, of a boundary that glides on a mesh.
    scale : ndarray, shape (n,), or None
        Logarithm of the length an image piece may be expected to have, relative to its source: what
        the boundary image has there, spread inside. None: 0 everywhere.
    smooth_axes : bool
        Whether steps on the ground are taken along axes that turn smoothly, or lie in its faces.
    held, pinned : ndarray of intp
        Boundary vertices that stay in place where the others glide: for the time being, for good.
    """

    V: NDArray[np.float64]
    T: NDArray[np.int32]
    boundary: NDArray[np.int32]
    faces: NDArray[np.int32]
    options: FillOptions
    torus: Torus | None = None
    scale: NDArray[np.float64] | None = None
    held: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))
    ground: TriMesh | None = None
    pinned: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))
    smooth_axes: bool = True

    @cached_property
    def shares(self) -> NDArray[np.float64]:
        """Source volumes of the tets, summing to 1: (k,)."""
        volumes = _core.mesh.tet_volumes(self.V, self.T)
        shares: NDArray[np.float64] = volumes / volumes.sum()
        return shares

    def _mean(self, values: NDArray[np.float64]) -> float:
        """Of all tets by volume; a product of BLAS would depend on its number of threads."""
        return float((self.shares * values).sum())

    @cached_property
    def weights(self) -> NDArray[np.float64]:
        """Of the tets in the energy, summing to 1: (k,).

        Between one and all and the volume: by volume alone, small tets are left with ratios of any
        size, by number alone, large ones pay for slivers.
        """
        weights = np.sqrt(self.shares)
        return np.asarray(weights / weights.sum())

    @cached_property
    def rings(self) -> NDArray[np.float64]:
        """Source volumes round the vertices, a share of the whole each: (n,)."""
        return _core.measures.ring_sums(self.T, self.shares, len(self.V))

    def rest(self, tets: NDArray[np.intp] | slice = slice(None)) -> NDArray[np.float64]:
        """Rest matrices (k, 9), of some tets or all; not kept, as the minimizer has its own."""
        return _core.volume.rest_matrices(self.V, self.T[tets], self.options.max_aspect)

    @property
    def local_volumes(self) -> NDArray[np.float64]:
        """Volume each tet may be expected to get, relative to its source; 1 on the whole: (k,)."""
        if self.scale is None:
            return np.ones(len(self.T))
        volumes = np.exp(3.0 * self.scale[self.T].mean(axis=1))
        local: NDArray[np.float64] = volumes / self._mean(volumes)
        return local

    @cached_property
    def roomy_volumes(self) -> NDArray[np.float64]:
        """`local_volumes`, but of a sliver what there is room for among its neighbors: (k,).

        A sliver is turned by making it thicker. In units of its own volume, which may be a
        billionth of that, its determinant means nothing and its energy drowns that of all others.
        """
        volumes = _core.mesh.tet_volumes(self.V, self.T)
        counts = np.bincount(self.T.ravel(), minlength=len(self.V))
        means = _core.measures.ring_sums(self.T, volumes, len(self.V)) / np.maximum(counts, 1)
        room = _THICK * means[self.T].min(axis=1)
        roomy: NDArray[np.float64] = self.local_volumes * np.maximum(room / volumes, 1.0)
        return roomy

    @cached_property
    def roomy_weights(self) -> NDArray[np.float64]:
        """`weights` by these volumes: (k,)."""
        weights = np.sqrt(self.shares * self.roomy_volumes / self.local_volumes)
        return np.asarray(weights / weights.sum())

    @property
    def targets(self) -> NDArray[np.float64]:
        """Volume to ask of each tet behind a held boundary, relative to its share: (k,).

        1 as far as the boundary allows. Where it squeezes or stretches a region so far that the
        volumes next to it are off by more than a factor anyway, that factor is asked for.
        """
        log = np.log(self.local_volumes)
        targets = np.exp(np.sign(log) * np.maximum(np.abs(log) - math.log(_REACH), 0.0))
        asked: NDArray[np.float64] = targets / self._mean(targets)
        return asked

    def gliding(
        self, faces: NDArray[np.int32], number: NDArray[np.int32] | None = None
    ) -> _core.volume.GlidingBoundary:
        """That surface and the rest shapes of boundary faces (m, 3), their vertices renumbered."""
        surface = self.glide_surface
        rest = _core.volume.rest_triangles(
            self.V, faces, surface.area / self._source_area, self.options.max_aspect
        )
        return _core.volume.GlidingBoundary(
            surface=surface,
            faces=faces if number is None else number[faces],
            rest=rest,
            weights=face_areas(self.V, faces) / self._source_area,
        )

    def inflating(self, enclosed: float) -> NDArray[np.float64]:
        """Volume to ask of each tet whose boundary glides on a mesh, relative to its share: (k,).

        The image of a coarse boundary cuts off what is sharp and encloses less than the mesh.
        Asked for their share of the mesh, all tets press outward until it is filled as far as can
        be; but those with little weight for their size would bear most of what is missing. So each
        is asked for so much more than its share of what is enclosed by now that at rest under equal
        pressure the shares are kept.
        """
        assert self.ground is not None
        yielding = self.shares / self.weights
        missing = self.ground.volume - enclosed
        asked = enclosed + missing * yielding / self._mean(yielding)
        return np.asarray(np.maximum(asked, 0.5 * enclosed))

    def asked_alike(self, x: NDArray[np.float64]) -> float:
        """Volume to ask of every tet whose boundary glides on a torus, relative to its share.

        That of the start, less most of what the boundary has cut off since.
        """
        enclosed = float(_core.mesh.tet_volumes(x, self.T).sum())
        return math.pow(enclosed, 1.0 - _AS_A_WHOLE)

    def ring_ratios(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ratios (6.5) round the vertices: (n,)."""
        volumes = _core.mesh.tet_volumes(x, self.T)
        rings = _core.measures.ring_sums(self.T, volumes / volumes.sum(), len(self.V))
        return np.asarray(rings / self.rings)

    def misfit(self, x: NDArray[np.float64]) -> tuple[float, float]:
        """SD of the ratios (6.5) round vertices and total distortion (6.4)."""
        ratios = self.ring_ratios(x)
        return float(ratios.std()), 0.25 * float((self.rings * np.abs(ratios - 1.0)).sum())

    def kept(self, x: NDArray[np.float64]) -> bool:
        """Whether volumes are kept as well as is asked of a boundary that glides on a mesh."""
        spread, moved = self.misfit(x)
        return spread <= self.options.glide_std and moved <= self.options.glide_distortion

    @cached_property
    def glide_surface(self) -> _core.volume.GlideSurface:
        """What the boundary may glide on."""
        if self.ground is not None:
            return _core.volume.MeshSurface(
                self.ground.V, self.ground.F, smooth_axes=self.smooth_axes
            )
        assert self.torus is not None
        return _core.volume.TorusSurface(self.torus.R, self.torus.r)

    @cached_property
    def _source_area(self) -> float:
        return float(face_areas(self.V, self.faces).sum())

    def motion(self, *, glide: bool) -> NDArray[np.uint8]:
        """Which vertices are free, fixed, or glide: (n,)."""
        motion = np.full(len(self.V), FREE, np.uint8)
        motion[self.boundary] = GLIDING if glide else FIXED
        motion[self.held] = FIXED
        motion[self.pinned] = FIXED
        return motion

    @cached_property
    def gliding_faces(self) -> NDArray[np.intp]:
        """Boundary faces of which at least one vertex glides where the boundary does."""
        moving = self.motion(glide=True) == GLIDING
        return np.flatnonzero(moving[self.faces].any(axis=1))

    def newton(
        self,
        x: NDArray[np.float64],
        *,
        glide: bool,
        weights: NDArray[np.float64] | None = None,
    ) -> _core.volume.SolidNewton:
        """The minimizer of the distortion of all tets, started near ``x``; `weights` by default."""
        return _core.volume.SolidNewton(
            x,
            tets=self.T,
            rest=self.rest(),
            weights=self.weights if weights is None else weights,
            motion=self.motion(glide=glide),
            boundary=self.gliding(self.faces[self.gliding_faces]) if glide else None,
        )


def face_areas(V: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Areas (m,) of triangles."""
    corners = V[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas: NDArray[np.float64] = 0.5 * np.linalg.norm(normals, axis=1)
    return areas


@dataclass
class History:
    """Records of the steps of all stages, who is told of them, and how long there is for them."""

    model: SolidModel
    budget: Budget
    progress: Progress | None = None
    records: list[IterationRecord] = field(default_factory=list)
    _clock: float = field(default_factory=time.perf_counter)
    _stage: str = ""

    def right(self, std: float) -> bool:
        """Whether no tet was inverted when last measured and the SD of the ratios was so small."""
        last = self.records[-1] if self.records else None
        return last is not None and last.flips == 0 and last.element_std <= std

    def add(
        self,
        stage: str,
        iteration: int,
        x: NDArray[np.float64],
        *,
        energy: float,
        step: float,
        residual: float,
        total: int,
    ) -> IterationRecord:
        """Measure ``x`` and note the step that led there; ``iteration`` 1 starts the clock."""
        model = self.model
        if stage != self._stage:
            self._stage, self._clock = stage, time.perf_counter()
        volumes = _core.mesh.tet_volumes(x, model.T)
        spread = _core.measures.share_deviations(model.T, model.shares, model.rings, volumes)
        record = IterationRecord(
            stage=stage,
            iteration=iteration,
            energy=energy,
            step=step,
            residual=residual,
            flips=len(volumes) - int(np.count_nonzero(volumes > 0.0)),
            ring_std=spread.rings,
            element_std=spread.elements,
            seconds=time.perf_counter() - self._clock,
        )
        self.records.append(record)
        report(
            self.progress,
            stage,
            iteration,
            total,
            flips=record.flips,
            element_std=record.element_std,
        )
        return record
