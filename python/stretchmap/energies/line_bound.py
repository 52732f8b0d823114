"""How far a step can go before a tet turns over."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from ..base.arrays import as_reals
from ..base.options import real
from ..errors import OrientationError
from ..mesh.given import as_solid
from ..mesh.meshes import TetMesh

__all__ = ["longest_step"]


def longest_step(
    solid: TetMesh, image: ArrayLike, direction: ArrayLike, *, limit: float = 1.0
) -> float:
    """Largest step along a direction that keeps every tet positive: where a line search may start.

    The determinant of a tet is a cubic along the line (Smith, Schaefer, Computer Graphics Forum
    34(5), 2015); its first root is approached from below, so any smaller step is safe.

    Parameters
    ----------
    solid : TetMesh
        Its tets count, not its vertices.
    image, direction : array_like, shape (n, 3)
        Positions and what is added to them.
    limit : float
        Longest step of interest, positive.

    Returns
    -------
    float
        ``alpha`` in (0, limit]: every tet of ``image + t * direction`` is positive for
        ``0 <= t < alpha``.

    Raises
    ------
    ArrayError, NonFiniteError
        Of the arrays.
    OptionError
        ``limit`` is not positive.
    OrientationError
        A tet of ``image`` is not positive to begin with; ``ids`` are the tets.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> sm.energies.longest_step(solid, solid.V, 0.1 * solid.V)  # larger and larger
    1.0
    >>> 0.98 < sm.energies.longest_step(solid, solid.V, -solid.V, limit=2.0) <= 1.0
    True
    """
    solid = as_solid(solid)
    shape = (solid.n_vertices, 3)
    x = np.ascontiguousarray(as_reals(image, "image", shape))
    step = np.ascontiguousarray(as_reals(direction, "direction", shape))
    limit = real("limit", limit, above=0.0)
    inverted = np.flatnonzero(_core.mesh.tet_volumes(x, solid.T) <= 0.0)
    if len(inverted):
        raise OrientationError(
            f"{len(inverted)} tets of the image are inverted, {inverted[0]} among them: untangle "
            "first, stretchmap.fill and volume_map do",
            inverted,
        )
    return float(_core.energies.longest_steps(solid.T, x, step, limit).min())
