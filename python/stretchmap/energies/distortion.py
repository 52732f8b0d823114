"""The energy that certified maps minimize: shape and volume of every tet, with a barrier."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base.arrays import as_reals
from ..base.options import flag, real
from ..errors import OptionError
from ..measures.elements import require_sizes
from ..mesh.given import as_solid
from ..mesh.meshes import TetMesh
from .energy import Energy

__all__ = ["DistortionEnergy"]


class DistortionEnergy(Energy):
    """``sum_t w_t [shape (tr J'J / (3 chi^(2/3)) - 1) + volume ((d^2 + 1) / (2 chi) - 1)]``.

    J is the Jacobian of the map on tet t, ``d = det J`` and
    ``chi = (d + sqrt(epsilon^2 + d^2)) / 2``, the regularized determinant of Garanzha, Kaporin,
    Kudryavtseva, Protais, Ray, Sokolov (ACM TOG 40(4), 2021). With ``epsilon = 0`` both terms are
    barriers, infinite where a tet is inverted, and vanish where its map is a rotation; with
    ``epsilon > 0`` the energy is finite and smooth everywhere and draws inverted tets back.
    `volume_map` lowers it with ``weights`` the roots of the volumes.

    Parameters
    ----------
    solid : TetMesh
    shape, volume : float
        Weights of the two terms, not negative.
    epsilon : float
        Of the regularization; 0 is the barrier.
    weights : array_like, shape (k,), optional
        Positive factor of every tet; by default its share of the volume.
    max_aspect : float
        Shapes of slivers are not asked to be kept: singular values of a source tet relative to the
        regular one are clamped to this ratio. Infinite by default: J is the Jacobian throughout.
    projected : bool
        Hessians with their negative eigenvalues by J set to zero, as Newton steps want them (Smith,
        de Goes, Kim, ACM TOG 38(1), 2019), instead of exact ones.

    Raises
    ------
    KindError
        Not a solid.
    OptionError
        A weight out of range.
    ArrayError
        ``weights`` of another length.
    OrientationError, DegenerateError
        A source tet has no positive volume.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> energy = sm.energies.DistortionEnergy(solid)
    >>> abs(energy.value(solid.V)) < 1e-12  # nothing is distorted
    True
    >>> energy.value(-solid.V)  # a mirror image
    inf
    >>> sm.energies.DistortionEnergy(solid, epsilon=0.1).value(-solid.V) < float("inf")
    True
    """

    mesh: TetMesh

    def __init__(
        self,
        solid: TetMesh,
        *,
        shape: float = 1.0,
        volume: float = 1.0,
        epsilon: float = 0.0,
        weights: ArrayLike | None = None,
        max_aspect: float = math.inf,
        projected: bool = False,
    ) -> None:
        self.mesh = as_solid(solid)
        require_sizes(self.mesh.tet_volumes)
        self._weights = _core.volume.EnergyWeights(
            real("shape", shape, 0.0), real("volume", volume, 0.0), real("epsilon", epsilon, 0.0)
        )
        if not (isinstance(max_aspect, float) and max_aspect == math.inf):
            max_aspect = real("max_aspect", max_aspect, 1.0)
        self._rest = _core.volume.rest_matrices(self.mesh.V, self.mesh.T, max_aspect)
        if weights is None:
            self._factors = np.asarray(self.mesh.tet_volumes / self.mesh.volume)
        else:
            self._factors = np.array(as_reals(weights, "weights", (self.mesh.n_tets,)))
            if not (self._factors > 0.0).all():
                raise OptionError("weights must be positive")
        self._projected = flag("projected", projected)

    def _evaluate(self, image: NDArray[np.float64], order: int) -> Any:
        return _core.energies.tet_distortion(
            image, self.mesh.T, self._rest, self._factors, self._weights, order, self._projected
        )
