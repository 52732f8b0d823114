"""Harmonic and holomorphic 1-forms, paper sections 3.2 and 3.3.

A 1-form is one number per edge of the surface, along the edge from its lower to its higher vertex.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arrays import read_only
from .errors import OptionError

if TYPE_CHECKING:
    from .homology import HomologyBasis
    from .mesh import TriMesh

__all__ = ["HarmonicForms", "HolomorphicForms", "harmonic_forms", "holomorphic_forms"]

WEIGHTS = ("cotangent", "intrinsic_delaunay", "clamped")
CLAMP = 1e-2  # smallest clamped weight; the edge of an equilateral triangle pair has 0.577


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
        Inner products of the forms, the sum of ``w form_i form_j`` over the edges of the weights.
    weights : str
        ``"cotangent"``: (3.2). ``"intrinsic_delaunay"``: (3.2) on the intrinsic Delaunay
        triangulation of the same surface, none negative. ``"clamped"``: (3.2), but at least 0.01,
        so that a torus chart cannot fold.
    n_negative : int
        Edges of the surface whose cotangent weight is negative, the non-Delaunay ones.
    n_flips : int
        Intrinsic edge flips made.
    """

    forms: NDArray[np.float64] = field(repr=False)
    potentials: NDArray[np.float64] = field(repr=False)
    gram: NDArray[np.float64]
    weights: str
    n_negative: int
    n_flips: int = 0


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
    """

    real: NDArray[np.float64] = field(repr=False)
    imag: NDArray[np.float64] = field(repr=False)
    coefficients: NDArray[np.float64]
    star: NDArray[np.float64]
    wedge: NDArray[np.float64]


def harmonic_forms(
    surface: TriMesh, basis: HomologyBasis | None = None, *, weights: str = "cotangent"
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
        As `homology_basis`.
    OptionError
        Unknown weights.
    SolverError
        The Laplacian could not be factorised.
    """
    if basis is None:
        from .homology import homology_basis

        basis = homology_basis(surface)
    if weights == basis.harmonic.weights:
        return basis.harmonic
    return solve_harmonic(surface, basis.dual_forms, weights)


def solve_harmonic(
    surface: TriMesh, eta: NDArray[np.int32], weights: str = "cotangent"
) -> HarmonicForms:
    """Harmonic forms cohomologous to the rows of ``eta (k, e) int32``, see `harmonic_forms`."""
    if weights not in WEIGHTS:
        raise OptionError(f"weights must be one of {', '.join(WEIGHTS)}, not {weights!r}")
    top, n = surface.topology, surface.n_vertices
    values = _core.cotangent_weights(top, surface.V)
    n_negative, n_flips = int((values < 0.0).sum()), 0
    if weights == "intrinsic_delaunay":
        lengths = _core.edge_lengths(top, surface.V)
        edges, values, carried, n_flips = _core.intrinsic_delaunay(top, lengths, eta)
        _, potentials, gram = _core.harmonic_forms(n, edges, values, carried)
        forms = eta + np.diff(potentials[top.edges], axis=1)[:, 0].T
    else:
        if weights == "clamped":
            values = np.maximum(values, CLAMP)
        forms, potentials, gram = _core.harmonic_forms(n, top.edges, values, eta)
    return HarmonicForms(
        forms=read_only(forms),
        potentials=read_only(potentials),
        gram=read_only(gram),
        weights=weights,
        n_negative=n_negative,
        n_flips=n_flips,
    )


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
    MeshError, SolverError
        As `homology_basis`.
    """
    real = harmonic_forms(surface, basis).forms
    star, wedge = _core.hodge_products(surface.topology, surface.V, real)
    coefficients = np.linalg.solve(wedge, star).T if len(real) else np.zeros((0, 0))
    return HolomorphicForms(
        real=real,
        imag=read_only(coefficients @ real),
        coefficients=read_only(coefficients),
        star=read_only(star),
        wedge=read_only(wedge),
    )
