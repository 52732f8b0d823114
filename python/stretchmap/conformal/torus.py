"""The flat torus bent into a torus of revolution, (3.15)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..base.torus import Torus

__all__ = ["conformal_torus", "tube_angle"]


def conformal_torus(aspect: float) -> Torus:
    """The torus of (3.15) that is conformally ``aspect`` by 1.

    The printed ``r = sqrt(aspect^2 - 1)`` is not conformal; with ``r = aspect`` the two derivatives
    are ``r / D`` and ``1 / D``, ``D = sqrt(r^2 + 1) - cos v``, and every aspect embeds: centre
    radius ``sqrt(1 + r^2) / r``, tube radius ``1 / r``.

    Examples
    --------
    >>> from stretchmap.conformal.torus import conformal_torus
    >>> torus = conformal_torus(1.0)
    >>> round(torus.ratio**2, 12)
    2.0
    """
    return Torus(math.sqrt(1.0 + aspect * aspect) / aspect, 1.0 / aspect)


def tube_angle(turns: NDArray[np.float64], aspect: float) -> NDArray[np.float64]:
    """Angle around the tube, radians, of the conformal coordinate y of (3.15) given in turns.

    ``tan(v / 2) = tan(y / 2) (sqrt(1 + aspect^2) + 1) / aspect``, on the branch that is continuous
    in y, so that v minus y is periodic.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.conformal.torus import tube_angle
    >>> (tube_angle(np.array([0.0, 0.25, 0.5, 1.0]), aspect=1.0) / np.pi).round(3).tolist()
    [0.0, 0.75, 1.0, 2.0]
    """
    whole = np.round(turns)
    y = 2.0 * np.pi * (turns - whole)
    scale = (math.sqrt(1.0 + aspect * aspect) + 1.0) / aspect
    return 2.0 * np.arctan2(scale * np.sin(0.5 * y), np.cos(0.5 * y)) + 2.0 * np.pi * whole
