"""The stretch energies of the paper, of surfaces and of solids."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..measures.elements import require_sizes
from ..mesh.given import as_solid, as_surface
from ..mesh.meshes import TetMesh, TriMesh
from .energy import Energy

__all__ = ["AreaStretch", "VolumeStretch"]


class VolumeStretch(Energy):
    """The volumetric stretch energy ``E_V(f) = 3/2 sum |f(t)|^2 / |t|``.

    Equation (5.1) of Yueh, Li, Lin, Yau (2020) with c = 0. It is at least ``3/2 V^2 / |M|`` with V
    the volume of the image, and that exactly where all volume ratios are equal. Its Hessian is
    exact, so it may be indefinite.

    Parameters
    ----------
    solid : TetMesh

    Raises
    ------
    KindError
        Not a solid.
    OrientationError, DegenerateError
        A source tet has no positive volume.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> energy = sm.energies.VolumeStretch(solid)
    >>> bool(np.isclose(energy.value(solid.V), 1.5 * solid.volume))  # the bound is reached
    True
    >>> inside = np.setdiff1d(np.arange(solid.n_vertices), solid.boundary_vertices)
    >>> bool(np.allclose(energy.gradient(solid.V)[inside], 0.0, atol=1e-12))
    True
    >>> energy.hessian(solid.V).shape == (3 * solid.n_vertices, 3 * solid.n_vertices)
    True
    """

    mesh: TetMesh

    def __init__(self, solid: TetMesh) -> None:
        self.mesh = as_solid(solid)
        require_sizes(self.mesh.tet_volumes)

    def _evaluate(self, image: NDArray[np.float64], order: int) -> Any:
        return _core.energies.tet_stretch(image, self.mesh.T, self.mesh.tet_volumes, order)


class AreaStretch(Energy):
    """The stretch energy of a surface, ``E_S(g) = sum |g(t)|^2 / |t|``.

    Equation (4.1) of Yueh, Li, Lin, Yau (2020), in space: at least ``A^2 / |M|`` with A the area of
    the image, and that exactly where all area ratios are equal. The Hessian is exact.

    Parameters
    ----------
    surface : TriMesh

    Raises
    ------
    KindError
        Not a surface.
    DegenerateError
        A face has no area.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> surface = sm.samples.torus_surface(24, 12)
    >>> energy = sm.energies.AreaStretch(surface)
    >>> bool(np.isclose(energy.value(2.0 * surface.V), 16.0 * surface.area))
    True
    """

    mesh: TriMesh

    def __init__(self, surface: TriMesh) -> None:
        self.mesh = as_surface(surface)
        require_sizes(self.mesh.face_areas)

    def _evaluate(self, image: NDArray[np.float64], order: int) -> Any:
        return _core.energies.face_stretch(image, self.mesh.F, self.mesh.face_areas, order)
