"""Harmonic and holomorphic 1-forms of the classes of a homology basis."""

from __future__ import annotations

import numpy as np

from .. import _core
from ..base.arrays import read_only
from ..base.options import instance, one_of
from ..forms.harmonic import WEIGHTS, HarmonicForms, Weights, solve_harmonic
from ..forms.holomorphic import HolomorphicForms
from ..mesh.given import as_surface, require_same_mesh
from ..mesh.meshes import TriMesh
from .basis import HomologyBasis, homology_basis

__all__ = ["harmonic_forms", "holomorphic_forms", "require_basis_of"]

_REMEDY = "pass homology_basis(surface), or leave it out"


def require_basis_of(surface: TriMesh, basis: HomologyBasis) -> None:
    """Raise unless the basis is one of this surface.

    Raises
    ------
    OptionError
        It is no basis.
    KindError
        It is one of another surface.
    """
    instance("basis", basis, HomologyBasis, "see homology_basis")
    require_same_mesh(surface, basis.surface, "the basis is of another surface", _REMEDY)


def harmonic_forms(
    surface: TriMesh, basis: HomologyBasis | None = None, *, weights: Weights = "cotangent"
) -> HarmonicForms:
    """Harmonic 1-forms dual to the homology generators, (3.2)-(3.5).

    One factorisation of the Laplacian, 2g right-hand sides.

    Parameters
    ----------
    surface : TriMesh
        Closed surface of any genus.
    basis : HomologyBasis, optional
        Generators and dual forms; computed if left out.
    weights : {"cotangent", "intrinsic_delaunay", "clamped"}
        See `HarmonicForms`.

    Returns
    -------
    HarmonicForms

    Raises
    ------
    MeshError
        As `homology_basis`; the basis is of another surface.
    OptionError
        Unknown weights.
    SolverError
        The Laplacian could not be factorised.

    Examples
    --------
    >>> import stretchmap as sm
    >>> surface = sm.samples.torus_surface(24, 12)
    >>> sm.harmonic_forms(surface).forms.shape
    (2, 864)
    >>> found = sm.harmonic_forms(surface, weights="intrinsic_delaunay")
    >>> found.weights, found.gram.shape
    ('intrinsic_delaunay', (2, 2))
    """
    surface = as_surface(surface)
    one_of("weights", weights, WEIGHTS)
    if basis is None:
        basis = homology_basis(surface)
    require_basis_of(surface, basis)
    if weights == basis.harmonic.weights:
        return basis.harmonic
    return solve_harmonic(surface, basis.dual_forms, weights)


def holomorphic_forms(surface: TriMesh, basis: HomologyBasis | None = None) -> HolomorphicForms:
    """Basis of the holomorphic 1-forms of a closed surface of any genus, (3.6)-(3.12).

    Parameters
    ----------
    surface : TriMesh
        Closed surface of genus at least one.
    basis : HomologyBasis, optional
        Generators and dual forms; computed if left out.

    Returns
    -------
    HolomorphicForms
        2g forms; over the complex numbers they span a space of dimension g.

    Raises
    ------
    MeshError, KindError, SolverError
        As `harmonic_forms`.

    Examples
    --------
    >>> import stretchmap as sm
    >>> found = sm.holomorphic_forms(sm.samples.double_torus(2))
    >>> found.wedge.round().astype(int).shape
    (4, 4)
    """
    surface = as_surface(surface)
    real = harmonic_forms(surface, basis).forms
    star, wedge = _core.forms.hodge_products(surface.topology, surface.V, real)
    coefficients = np.linalg.solve(wedge, star).T if len(real) else np.zeros((0, 0))
    return HolomorphicForms(
        real=real,
        imag=read_only(coefficients @ real),
        coefficients=read_only(coefficients),
        star=read_only(star),
        wedge=read_only(wedge),
    )
