"""Coarser surfaces over the same chart: what takes many steps is done on the smallest of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.torus import TWO_PI, Torus
from ..mesh.meshes import TriMesh
from .flat import start_angles

_MOST_FACES = 40_000  # a surface with more is made coarser first
_STEP = 8  # times fewer faces from one surface to the next
_LEAST_FACES = 20_000  # of a coarser surface
_MAX_ASPECT = 10.0  # source triangles longer than this are not asked to keep their shape


class Folded(Exception):
    """The map of a coarse surface folds faces of the fine one."""


@dataclass(frozen=True)
class Level:
    """A surface with its flat chart.

    Attributes
    ----------
    surface : TriMesh
    turns : ndarray, shape (n, 2)
        Without folded faces.
    forms : ndarray, shape (2, e)
        Integer closed 1-forms of the two coordinates.
    aspect : float
        Of the flat torus.
    chart, reference
        The same for the kernels.
    coarse : _core.area.CoarseSurface, optional
        The next coarser surface, None for the last.
    """

    surface: TriMesh
    turns: NDArray[np.float64]
    forms: NDArray[np.int32]
    aspect: float
    chart: _core.area.SurfaceChart
    reference: _core.area.SurfaceReference
    coarse: _core.area.CoarseSurface | None = None

    @classmethod
    def of(
        cls,
        surface: TriMesh,
        turns: NDArray[np.float64],
        forms: NDArray[np.int32],
        aspect: float,
    ) -> Level:
        """The level of a surface, with nothing coarser yet."""
        chart = _core.area.SurfaceChart(surface.topology, forms)
        reference = _core.area.SurfaceReference(surface.V, surface.F, _MAX_ASPECT)
        return cls(surface, turns, forms, aspect, chart, reference)

    def newton(self, angles: NDArray[np.float64], ratio: float) -> _core.area.SurfaceNewton:
        """Newton steps on the polyhedral image from angles without folds in the chart."""
        return self._newton(self.reference, angles, ratio)

    def keeping(self, angles: NDArray[np.float64], ratio: float) -> _core.area.SurfaceNewton:
        """The same, but every face is to keep the area and shape that its image has there."""
        image = Torus(ratio, 1.0).xi(*angles.T)
        reference = _core.area.SurfaceReference(image, self.chart.faces, _MAX_ASPECT)
        return self._newton(reference, angles, ratio)

    def _newton(
        self, reference: _core.area.SurfaceReference, angles: NDArray[np.float64], ratio: float
    ) -> _core.area.SurfaceNewton:
        problem = _core.area.GlideProblem(self.chart, reference, ratio)
        return _core.area.SurfaceNewton(problem, angles)

    def prolonged(self, angles: NDArray[np.float64], ratio: float) -> NDArray[np.float64]:
        """Angles of this surface from those of its coarser one, `Folded` if there are none."""
        assert self.coarse is not None
        # Linear in the coordinates of equal area: between the vertices, too, areas are kept.
        u, v = angles.T
        turns = np.column_stack([u, v + np.sin(v) / ratio]) / TWO_PI
        fine = _core.area.prolong(self.coarse, self.chart, turns)
        if len(fine) == 0:
            raise Folded
        # Coarse shears jump from face to face: fine faces across an edge get areas that are off.
        sem = _core.area.SurfaceSem(self.chart, self.surface.face_areas, self.aspect, fine)
        sem.step()
        return start_angles(self.chart, sem.turns, 0.0, ratio)


def levels(finest: Level) -> list[Level]:
    """The surface and its coarser ones, down to one small enough for any number of steps."""
    found = [finest]
    while (n_faces := found[-1].surface.n_faces) > _MOST_FACES:
        goal = max(n_faces // _STEP, _LEAST_FACES)
        fine = found[-1]
        coarse = _core.area.coarsen(fine.surface.V, fine.chart, fine.turns, goal)
        if 2 * len(coarse.chart.faces) > n_faces:
            break  # hardly a vertex can go
        surface = TriMesh(fine.surface.V[coarse.kept], coarse.chart.faces)
        turns = np.ascontiguousarray(fine.turns[coarse.kept])
        forms = _core.area.chart_forms(surface.topology, coarse.chart.shift_u, coarse.chart.shift_v)
        found[-1] = replace(fine, coarse=coarse)
        found.append(Level.of(surface, turns, forms, fine.aspect))
    return found
