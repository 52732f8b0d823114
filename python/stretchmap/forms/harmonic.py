"""Harmonic 1-forms, paper section 3.2.

A 1-form is one number per edge of the surface, along the edge from its lower to its higher vertex.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import read_only
from ..errors import OptionError

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

__all__ = ["HarmonicForms", "Weights"]

Weights = Literal["cotangent", "intrinsic_delaunay", "clamped"]
WEIGHTS: tuple[Weights, ...] = get_args(Weights)
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

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> surface = sm.samples.torus_surface(24, 12)
    >>> basis = sm.homology_basis(surface)
    >>> found = sm.harmonic_forms(surface, basis)
    >>> change = np.diff(found.potentials[surface.edges], axis=1)[:, 0].T
    >>> bool(np.allclose(found.forms, basis.dual_forms + change))
    True
    """

    forms: NDArray[np.float64] = field(repr=False)
    potentials: NDArray[np.float64] = field(repr=False)
    gram: NDArray[np.float64]
    weights: Weights
    n_negative: int
    n_flips: int = 0

    def __repr__(self) -> str:
        return f"HarmonicForms({len(self.forms)} forms on {self.forms.shape[1]} edges)"


def solve_harmonic(
    surface: TriMesh, eta: NDArray[np.int32], weights: Weights = "cotangent"
) -> HarmonicForms:
    """Harmonic forms cohomologous to the rows of ``eta (k, e) int32``, see `harmonic_forms`."""
    if weights not in WEIGHTS:
        raise OptionError(f"weights must be one of {', '.join(WEIGHTS)}, not {weights!r}")
    top, n = surface.topology, surface.n_vertices
    values = _core.forms.cotangent_weights(top, surface.V)
    n_negative, n_flips = int((values < 0.0).sum()), 0
    if weights == "intrinsic_delaunay":
        lengths = _core.mesh.edge_lengths(top, surface.V)
        edges, values, carried, n_flips = _core.forms.intrinsic_delaunay(top, lengths, eta)
        _, potentials, gram = _core.forms.harmonic_forms(n, edges, values, carried.astype(float))
        forms = eta + np.diff(potentials[top.edges], axis=1)[:, 0].T
    else:
        if weights == "clamped":
            values = np.maximum(values, CLAMP)
        forms, potentials, gram = _core.forms.harmonic_forms(
            n, top.edges, values, eta.astype(float)
        )
    return HarmonicForms(
        forms=read_only(forms),
        potentials=read_only(potentials),
        gram=read_only(gram),
        weights=weights,
        n_negative=n_negative,
        n_flips=n_flips,
    )
