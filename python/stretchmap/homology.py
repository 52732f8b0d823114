"""Homology of a surface: generators, dual 1-forms, handle and tunnel classes (paper section 3.1).

The *meridian* of a torus bounds a disk inside the solid, the *longitude* runs the long way round.
Which is which is a matter of linking numbers, or of the solid when it is given, never of length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arrays import read_only
from ._integer import complement, integer_inverse, integer_kernel
from .errors import GenusError, SelfIntersectionError
from .forms import HarmonicForms, solve_harmonic

if TYPE_CHECKING:
    from .mesh import TetMesh, TriMesh

__all__ = ["HomologyBasis", "homology_basis"]


@dataclass(frozen=True, eq=False)
class HomologyBasis:
    """Generators of the first homology of a closed surface and what the embedding says of them.

    Classes are integer rows of coefficients over ``generators``.

    Attributes
    ----------
    genus : int
    generators : tuple of ndarray
        2g simple loops (vertex ids), a basis of H1 over the integers.
    dual_forms : ndarray, shape (2g, e), int32
        Closed integer 1-forms; form i has period exactly ``i == j`` over generator j, (3.1).
    linking : ndarray, shape (2g, 2g), int64
        Entry (i, j): linking number of generator i with generator j lifted outward.
    handle_classes, tunnel_classes : ndarray, shape (g, 2g), int64
        Bases of the classes that bound inside and of those that bound outside.
    harmonic : HarmonicForms
        Harmonic representatives of ``dual_forms``.
    torus_classes : ndarray, shape (2, 2), int64, or None
        Genus one only: classes of the longitude (row 0) and of the meridian (row 1).
    torus_matrix : ndarray, shape (2, 2), int64, or None
        ``torus_forms = torus_matrix @ dual_forms``.
    torus_forms : ndarray, shape (2, e), int32, or None
        Row 0 has period 1 on the longitude and 0 on the meridian, row 1 the other way round; the
        integral of row 0 wedge row 1 over the outward surface is +1.
    """

    genus: int
    generators: tuple[NDArray[np.int32], ...]
    dual_forms: NDArray[np.int32]
    linking: NDArray[np.int64]
    handle_classes: NDArray[np.int64]
    tunnel_classes: NDArray[np.int64]
    harmonic: HarmonicForms
    torus_classes: NDArray[np.int64] | None
    torus_matrix: NDArray[np.int64] | None
    torus_forms: NDArray[np.int32] | None

    def require_torus(self) -> None:
        """Check that the genus is one.

        Raises
        ------
        GenusError
            If it is not.
        """
        if self.genus != 1:
            raise GenusError(f"a torus (genus 1) is needed, the surface has genus {self.genus}")


def homology_basis(surface: TriMesh, solid: TetMesh | None = None) -> HomologyBasis:
    """Generators, dual forms, and handle and tunnel classes of a closed surface of any genus.

    Parameters
    ----------
    surface : TriMesh
        Closed, connected, embedded, faces outward.
    solid : TetMesh, optional
        The solid that ``surface`` bounds.

    Raises
    ------
    MeshError
        The surface is open, in several pieces or not manifold.
    SelfIntersectionError
        The linking numbers are not those of an embedded surface.
    SolverError
        A linking number is not an integer.
    """
    top = surface.topology
    loops, forms = _core.tree_cotree(top, _core.edge_lengths(top, surface.V))
    genus = len(loops) // 2
    linking = np.rint(_core.linking_matrix(top, surface.V, loops)).astype(np.int64)
    handle = integer_kernel(linking.T)
    tunnel = integer_kernel(linking)
    if len(handle) != genus or len(tunnel) != genus:
        raise SelfIntersectionError(
            f"{len(handle)} independent loops bound inside and {len(tunnel)} outside, a surface "
            f"of genus {genus} that does not cross itself has {genus} of each"
        )
    harmonic = solve_harmonic(surface, forms)
    classes = matrix = torus_forms = None
    if genus == 1:
        wedge = round(_core.wedge_matrix(top, forms.astype(float))[0, 1])
        classes = _torus_classes(handle[0], wedge, harmonic.gram)
        matrix = integer_inverse(classes.T)
        torus_forms = read_only((matrix @ forms).astype(np.int32))
    return HomologyBasis(
        genus=genus,
        generators=tuple(read_only(np.array(loop, dtype=np.int32)) for loop in loops),
        dual_forms=read_only(forms),
        linking=linking,
        handle_classes=handle,
        tunnel_classes=tunnel,
        harmonic=harmonic,
        torus_classes=classes,
        torus_matrix=matrix,
        torus_forms=torus_forms,
    )


def _torus_classes(
    meridian: NDArray[np.int64], wedge: int, gram: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Rows longitude and meridian, oriented, the longitude the one that makes least skew.

    The form dual to the longitude does not change when the longitude gains meridians; the other one
    loses as many of it, so one rounding of G12 / G11 makes them as orthogonal as they can be.
    """
    if wedge < 0:
        meridian = -meridian
    # Determinant +1 over a basis with the orientation of ``wedge``, hence +1 in the end.
    longitude = complement(meridian) if wedge > 0 else -complement(meridian)
    forms = integer_inverse(np.stack([longitude, meridian]).T)
    g = forms @ gram @ forms.T
    return np.stack([longitude + round(g[0, 1] / g[0, 0]) * meridian, meridian])
