"""Holomorphic 1-forms, paper section 3.3."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["HolomorphicForms"]


@dataclass(frozen=True, eq=False)
class HolomorphicForms:
    """Holomorphic 1-forms ``zeta_l = omega_l + i *omega_l``, (3.12).

    Attributes
    ----------
    real : ndarray, shape (2g, e)
        The harmonic forms omega.
    imag : ndarray, shape (2g, e)
        Their Hodge conjugates ``coefficients @ real``, (3.8): closed to rounding.
    coefficients : ndarray, shape (2g, 2g)
        Row l: mu of (3.8) for ``*omega_l``. Its square tends to minus the identity.
    star : ndarray, shape (2g, 2g)
        Integrals of ``omega_l ^ *omega_m``, b of (3.10).
    wedge : ndarray, shape (2g, 2g)
        Integrals of ``omega_l ^ omega_m``, c of (3.10); integers to rounding.

    Examples
    --------
    >>> import stretchmap as sm
    >>> found = sm.holomorphic_forms(sm.samples.torus_surface(24, 12))
    >>> square = found.coefficients @ found.coefficients
    >>> (square.round(1) + 0.0).tolist()  # minus the identity, but for the size of the faces
    [[-1.0, 0.0], [0.0, -1.0]]
    """

    real: NDArray[np.float64] = field(repr=False)
    imag: NDArray[np.float64] = field(repr=False)
    coefficients: NDArray[np.float64]
    star: NDArray[np.float64]
    wedge: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"HolomorphicForms({len(self.real)} forms on {self.real.shape[1]} edges)"
