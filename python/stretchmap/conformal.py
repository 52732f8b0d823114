"""Conformal map of a genus-one surface onto a torus of revolution, Algorithm 3.1."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ._arrays import read_only
from .homology import HomologyBasis, homology_basis
from .torus import Torus

if TYPE_CHECKING:
    from .mesh import TriMesh

__all__ = ["ConformalMap", "conformal_map"]


@dataclass(frozen=True, eq=False)
class ConformalMap:
    """A conformal map to a flat torus, and from there to a torus of revolution.

    Attributes
    ----------
    surface : TriMesh
    basis : HomologyBasis
    forms : ndarray, shape (2, e), int32
        Integer closed 1-forms of the two coordinates: ``forms + d turns`` is harmonic.
    turns : ndarray, shape (n, 2)
        Coordinates along the longitude and along the meridian, in turns, defined modulo 1.
    gram : ndarray, shape (2, 2)
        Inner products of the two harmonic forms.
    lattice : ndarray, shape (2, 2)
        Rows: the periods of longitude and meridian in the plane, the first along x, scaled so that
        the parallelogram has the area of the surface. ``turns @ lattice`` is the planar map.
    aspect : float
        Length of the longitude's period over that of the meridian's, ``sqrt(G22 / G11)``.
    skew : float
        Cosine of the angle between the periods, ``-G12 / sqrt(G11 G22)``.
    conformal_energy : float
        Conformal energy of the planar map over the area, ``sqrt(det G) - 1``.
    torus : Torus
        The torus of revolution of that aspect, with the area of the surface.
    angles : ndarray, shape (n, 2)
        Angles (u, v) of the image in radians.
    image : ndarray, shape (n, 3)
        Points on ``torus``.
    """

    surface: TriMesh
    basis: HomologyBasis
    forms: NDArray[np.int32]
    turns: NDArray[np.float64]
    gram: NDArray[np.float64]
    lattice: NDArray[np.float64]
    aspect: float
    skew: float
    conformal_energy: float
    torus: Torus
    angles: NDArray[np.float64]
    image: NDArray[np.float64]


def conformal_map(surface: TriMesh, basis: HomologyBasis | None = None) -> ConformalMap:
    """Map a genus-one surface conformally onto a flat torus and a torus of revolution.

    Parameters
    ----------
    surface : TriMesh
        Closed surface of genus one.
    basis : HomologyBasis, optional
        From `homology_basis`; computed if left out.

    Raises
    ------
    GenusError
        The genus is not one.
    MeshError, SolverError
        As `homology_basis`.
    """
    if basis is None:
        basis = homology_basis(surface)
    basis.require_torus()
    change = basis.torus_matrix
    gram = change @ basis.harmonic.gram @ change.T
    turns = basis.harmonic.potentials @ change.T
    root = math.sqrt(np.linalg.det(gram))
    aspect = math.sqrt(gram[1, 1] / gram[0, 0])
    torus = conformal_torus(aspect).with_area(surface.area)
    angles = np.column_stack([2.0 * np.pi * turns[:, 0], tube_angle(turns[:, 1], aspect)])
    return ConformalMap(
        surface=surface,
        basis=basis,
        forms=basis.torus_forms,
        turns=read_only(turns),
        gram=gram,
        lattice=_lattice(gram, surface.area),
        aspect=aspect,
        skew=-gram[0, 1] / math.sqrt(gram[0, 0] * gram[1, 1]),
        conformal_energy=root - 1.0,
        torus=torus,
        angles=read_only(angles),
        image=read_only(torus.xi(angles[:, 0], angles[:, 1])),
    )


def conformal_torus(aspect: float) -> Torus:
    """The torus of (3.15) that is conformally ``aspect`` by 1: r = a/b, not the printed root.

    Centre radius ``sqrt(1 + aspect^2) / aspect``, tube radius ``1 / aspect``: every aspect embeds.
    """
    return Torus(math.sqrt(1.0 + aspect * aspect) / aspect, 1.0 / aspect)


def tube_angle(turns: NDArray[np.float64], aspect: float) -> NDArray[np.float64]:
    """Angle around the tube, radians, of the conformal coordinate y of (3.15) given in turns.

    The whole turns are kept: the angle minus 2 pi times the coordinate is periodic.
    """
    whole = np.round(turns)
    y = 2.0 * np.pi * (turns - whole)
    # tan(v/2) = k tan(y/2), k the ratio of the radii seen from the inner and the outer equator.
    scale = (math.sqrt(1.0 + aspect * aspect) + 1.0) / aspect
    return 2.0 * np.arctan2(scale * np.sin(0.5 * y), np.cos(0.5 * y)) + 2.0 * np.pi * whole


def _lattice(gram: NDArray[np.float64], area: float) -> NDArray[np.float64]:
    """Rows with ``rows @ rows.T = area sqrt(det gram) gram^-1``, the first along +x."""
    periods = area * math.sqrt(np.linalg.det(gram)) * np.linalg.inv(gram)
    return np.linalg.cholesky(periods)
