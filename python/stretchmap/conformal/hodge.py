"""The lattice of the flat torus by the Hodge star, (3.6) to (3.14)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..homology.basis import HomologyBasis, homology_basis
from ..homology.representatives import holomorphic_forms

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

__all__ = ["hodge_lattice"]


def hodge_lattice(surface: TriMesh, basis: HomologyBasis | None = None) -> NDArray[np.float64]:
    """The lattice by the paper's route: Hodge star (3.6)-(3.11), holomorphic forms, beta of (3.14).

    It agrees with ``ConformalMap.lattice`` up to the conformal energy, the discrete star's square
    being ``-det G`` instead of -1.

    Parameters
    ----------
    surface : TriMesh
        Closed surface of genus one.
    basis : HomologyBasis, optional
        From `homology_basis`; computed if left out.

    Returns
    -------
    (2, 2) ndarray
        Rows: periods of longitude and meridian, scaled and turned as in `ConformalMap`.

    Raises
    ------
    MeshError, GenusError, SolverError
        As `conformal_map`.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> from stretchmap.conformal.hodge import hodge_lattice
    >>> surface = sm.samples.torus_surface(60, 30)
    >>> bool(np.allclose(hodge_lattice(surface), sm.conformal_map(surface).lattice, rtol=0.01))
    True
    """
    if basis is None:
        basis = homology_basis(surface)
    basis.require_torus()
    coefficients = holomorphic_forms(surface, basis).coefficients
    mu = basis.torus_matrix @ coefficients @ basis.torus_classes.T
    periods = np.eye(2) + 1j * mu  # a_{l, j}: zeta_l over the longitude, over the meridian
    beta = _most_rectangular(periods)
    first, second = (1.0 - beta) * periods[0] + beta * periods[1]
    ratio = second / first
    length = math.sqrt(surface.area / ratio.imag)
    return length * np.array([[1.0, 0.0], [ratio.real, ratio.imag]])


def _most_rectangular(a: NDArray[np.complex128]) -> float:
    """beta in [-1, 1] that minimises the square in (3.14)."""

    def product(beta: float) -> float:
        first, second = (1.0 - beta) * a[0] + beta * a[1]
        return float((first * second.conjugate()).real)

    middle, ends = product(0.0), (product(-1.0), product(1.0))
    quadratic = [0.5 * (ends[0] + ends[1]) - middle, 0.5 * (ends[1] - ends[0]), middle]
    candidates = [-1.0, 1.0]
    candidates += [z.real for z in np.roots(quadratic)]  # roots, or the vertex where there are none
    return min((b for b in candidates if -1.0 <= b <= 1.0), key=lambda b: product(b) ** 2)


def lattice_basis(gram: NDArray[np.float64], area: float) -> NDArray[np.float64]:
    """Rows with ``rows @ rows.T = area sqrt(det gram) gram^-1``, the first along +x."""
    return np.linalg.cholesky(area * math.sqrt(np.linalg.det(gram)) * np.linalg.inv(gram))
