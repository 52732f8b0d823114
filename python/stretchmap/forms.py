"""Harmonic and holomorphic 1-forms, paper sections 3.2 and 3.3.

A 1-form is one number per edge of the surface, along the edge from its lower to its higher vertex.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arrays import read_only

if TYPE_CHECKING:
    from .homology import HomologyBasis
    from .mesh import TriMesh

__all__ = ["HarmonicForms", "harmonic_forms"]


@dataclass(frozen=True, eq=False)
class HarmonicForms:
    """Harmonic representatives of the classes of ``HomologyBasis.dual_forms``.

    Attributes
    ----------
    forms : ndarray, shape (2g, e)
        ``dual_form + d potential``: closed, and co-closed in the weights used, (3.3).
    potentials : ndarray, shape (n, 2g)
        The functions h of (3.4), zero at vertex 0.
    gram : ndarray, shape (2g, 2g)
        Inner products of the forms, ``sum over edges of w form_i form_j``.
    weights : ndarray, shape (e,)
        The edge weights, (3.2) for ``kind == "cotangent"``.
    kind : str
        Which weights these are.
    """

    forms: NDArray[np.float64]
    potentials: NDArray[np.float64]
    gram: NDArray[np.float64]
    weights: NDArray[np.float64]
    kind: str


def harmonic_forms(surface: TriMesh, basis: HomologyBasis | None = None) -> HarmonicForms:
    """Harmonic 1-forms dual to the homology generators, (3.2)-(3.5).

    One factorisation of the cotangent Laplacian, 2g right-hand sides.

    Parameters
    ----------
    surface : TriMesh
        Closed surface of any genus.
    basis : HomologyBasis, optional
        Generators and dual forms; computed if left out.

    Raises
    ------
    DegenerateError
        A face has no area; ``ids`` are the faces.
    SolverError
        The Laplacian could not be factorised.
    """
    if basis is None:
        from .homology import homology_basis

        basis = homology_basis(surface)
    return basis.harmonic


def solve_harmonic(surface: TriMesh, eta: NDArray[np.int32]) -> HarmonicForms:
    """Harmonic forms cohomologous to the rows of ``eta (k, e)``, see `harmonic_forms`."""
    weights = _core.cotangent_weights(surface.topology, surface.V)
    forms, potentials, gram = _core.harmonic_forms(surface.topology, weights, eta)
    return HarmonicForms(
        forms=read_only(forms),
        potentials=read_only(potentials),
        gram=read_only(gram),
        weights=read_only(weights),
        kind="cotangent",
    )
