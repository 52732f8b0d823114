"""Source and image of a solid on one scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..area.map import AreaMap
from ..base.torus import Torus
from ..errors import ArrayError, DegenerateError
from ..mesh.refinement import Refinement

if TYPE_CHECKING:
    from ..mesh.meshes import TetMesh

__all__ = ["SolidProblem"]


@dataclass(frozen=True)
class SolidProblem:
    """Source and torus on one scale: the polyhedron the boundary image encloses has volume 1."""

    solid: TetMesh
    V: NDArray[np.float64]
    x: NDArray[np.float64]
    torus: Torus
    scale: float  # lengths of the result per length here
    warm: bool  # x is a whole map, not only its boundary
    refinement: Refinement | None  # that made the solid; None: it must not be refined

    @classmethod
    def build(
        cls,
        solid: TetMesh,
        refinement: Refinement | None,
        boundary_map: AreaMap | None,
        start: ArrayLike | None,
        torus: Torus | None,
    ) -> SolidProblem:
        mesh = solid if refinement is None else refinement.solid
        ids = solid.boundary_vertices
        if start is not None:
            assert torus is not None
            image = np.array(start, dtype=np.float64)
            if image.shape != solid.V.shape:
                raise ArrayError(f"start must have shape {solid.V.shape}, got {image.shape}")
            x = image if refinement is None else refinement.prolong(image)
        else:
            assert boundary_map is not None
            torus = boundary_map.torus
            x = np.zeros((mesh.n_vertices, 3))
            x[ids] = boundary_map.image
        enclosed = _enclosed_volume(x[ids], solid.surface.F)
        if not enclosed > 0.0:
            raise DegenerateError("the boundary image encloses no volume; is it inside out?")
        shrink = enclosed ** (-1.0 / 3.0)
        scale = solid.volume ** (1.0 / 3.0)
        V = (mesh.V - mesh.V.mean(axis=0)) / scale
        return cls(mesh, V, x * shrink, torus.scaled(shrink), scale, start is not None, refinement)

    @property
    def fixed(self) -> NDArray[np.uint8]:
        flags = np.zeros(self.solid.n_vertices, np.uint8)
        flags[self.solid.boundary_vertices] = 1
        return flags

    def result_scale(self, x: NDArray[np.float64]) -> float:
        """Factor that gives the image the volume of the source."""
        volume = float(_core.volume.signed_tet_volumes(x, self.solid.T).sum())
        return float(self.scale * volume ** (-1.0 / 3.0))


def _enclosed_volume(points: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
