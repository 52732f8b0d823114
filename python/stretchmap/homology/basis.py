"""Homology of a surface: generators, dual 1-forms, handle and tunnel loops (paper section 3.1)."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from ..errors import SelfIntersectionError
from ..forms.harmonic import solve_harmonic
from ..mesh.given import as_solid, as_surface
from .bounding import bounding_by_linking, bounding_in, least_skew_longitude, same_lattice
from .generators import generators_of
from .integer import integer_inverse, reduced_basis
from .loops import HomologyBasis

if TYPE_CHECKING:
    from ..mesh.meshes import TetMesh, TriMesh

__all__ = ["HomologyBasis", "homology_basis"]

logger = logging.getLogger("stretchmap")


def homology_basis(surface: TriMesh, solid: TetMesh | None = None) -> HomologyBasis:
    """Generators, dual forms, and handle and tunnel classes of a closed surface of any genus.

    Parameters
    ----------
    surface : TriMesh
        Closed, connected, faces outward; embedded unless the solid is given.
    solid : TetMesh, optional
        The solid with ``solid.surface`` equal to ``surface``. Then the handle classes are those
        that bound in it (its first cohomology decides), and linking numbers only say which classes
        bound outside.

    Returns
    -------
    HomologyBasis

    Raises
    ------
    MeshError
        The surface is open, in several pieces, not manifold, inside out or degenerate.
    SelfIntersectionError
        The linking numbers are not those of an embedded surface.
    ArrayError
        ``surface`` is not the boundary of ``solid``.
    GenusError
        The first Betti number of the solid is not the genus of its boundary.

    Notes
    -----
    Signs: the pair longitude, meridian may be turned round as a whole; only its orientation with
    respect to the outward normal is fixed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_double_torus(1)
    >>> basis = sm.homology_basis(solid.surface, solid)
    >>> basis.genus, [len(loop) for loop in basis.handle_loops]
    (2, [4, 4])
    """
    surface = as_surface(surface)
    if solid is not None:
        solid = as_solid(solid)
    surface.require_closed()
    loops, forms, intersection = generators_of(surface)
    harmonic = solve_harmonic(surface, forms)

    within = None if solid is None else bounding_in(solid, surface, loops)
    linking: NDArray[np.int64] | None
    tunnel: NDArray[np.int64] | None
    try:
        linking, inside, tunnel = bounding_by_linking(surface, loops, intersection)
        if within is not None and not same_lattice(inside, within):
            raise SelfIntersectionError("the linking numbers contradict the solid")
    except SelfIntersectionError as error:
        if within is None:
            raise
        logger.warning("%s: the solid decides, loops that bound outside are left out", error)
        linking = tunnel = None
    handle = inside if within is None else within
    # x G^-1 x is the extremal length of class x.
    handle = reduced_basis(handle, np.linalg.inv(harmonic.gram))
    if tunnel is not None:
        tunnel = integer_inverse(tunnel @ intersection @ handle.T) @ tunnel

    classes = None
    if len(handle) == 1:
        longitude = least_skew_longitude(handle[0], tunnel, intersection, harmonic.gram)
        classes = np.stack([longitude, handle[0]])
    return HomologyBasis(
        surface=surface,
        genus=len(handle),
        generators=tuple(read_only(loop) for loop in loops),
        dual_forms=read_only(forms),
        intersection=intersection,
        linking=linking,
        handle_classes=handle,
        tunnel_classes=tunnel,
        harmonic=harmonic,
        _torus_classes=classes,
    )
