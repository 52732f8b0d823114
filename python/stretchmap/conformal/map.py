"""Conformal map of a genus-one surface onto a torus of revolution, Algorithm 3.1."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import read_only
from ..base.options import callback, one_of
from ..base.progress import Progress, report
from ..base.threads import takes_threads
from ..base.torus import Torus
from ..forms.harmonic import WEIGHTS, HarmonicForms, Weights
from ..homology.basis import HomologyBasis, homology_basis
from ..homology.representatives import harmonic_forms, require_basis_of
from ..maps.result import MapResult
from ..mesh.given import as_surface
from ..mesh.meshes import TriMesh
from .hodge import lattice_basis
from .torus import conformal_torus, tube_angle

__all__ = ["ConformalMap", "conformal_map"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ConformalMap(MapResult):
    """A discrete conformal map to a flat torus, and from there to a torus of revolution.

    Attributes
    ----------
    mesh : TriMesh
    basis : HomologyBasis
    forms : ndarray, shape (2, e), int32
        Integer closed 1-forms of the two coordinates: ``forms + d turns`` is harmonic.
    turns : ndarray, shape (n, 2)
        Coordinates along the longitude and along the meridian, in turns, defined modulo 1.
    gram : ndarray, shape (2, 2)
        Inner products of the two unit-period forms in cotangent weights.
    lattice : ndarray, shape (2, 2)
        Rows: the periods of longitude and meridian in the plane, the first along +x, scaled so that
        the parallelogram has the area of the surface.
    aspect : float
        Length of the longitude's period over that of the meridian's, ``sqrt(G22 / G11)``.
    skew : float
        Cosine of the angle between the periods, ``-G12 / sqrt(G11 G22)``. A torus of revolution has
        none, so its image has an angle error that no map to it can avoid.
    conformal_energy : float
        Conformal energy (6.1) of the planar map over the area, ``sqrt(det G) - 1``.
    weights : str
        Weights of the harmonic forms, see `HarmonicForms`.
    chart_areas : ndarray, shape (m,)
        Signed area of each face in (u, v) turns; they sum to 1.
    torus : Torus
        The torus of revolution of that aspect, with the area of the surface.
    angles : ndarray, shape (n, 2)
        Angles (u, v) of the image in radians.
    image : ndarray, shape (n, 3)
        Points on ``torus``.
    converged : bool
        Whether the chart is free of folds; nothing is iterated.
    stop_reason : str
    seconds : dict

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.conformal_map(sm.samples.torus_surface(24, 12))
    >>> result.flips, abs(result.skew) < 1e-6
    (0, True)
    """

    _title: ClassVar[str] = "conformal map"

    mesh: TriMesh = field(repr=False)
    basis: HomologyBasis = field(repr=False)
    forms: NDArray[np.int32] = field(repr=False)
    turns: NDArray[np.float64] = field(repr=False)
    gram: NDArray[np.float64]
    lattice: NDArray[np.float64]
    aspect: float
    skew: float
    conformal_energy: float
    weights: Weights
    chart_areas: NDArray[np.float64] = field(repr=False)
    torus: Torus = field()
    angles: NDArray[np.float64] = field(repr=False)

    @property
    def flips(self) -> int:
        """Faces that are folded over or collapsed in the flat chart."""
        return int((self.chart_areas <= 0.0).sum())

    @property
    def plane(self) -> NDArray[np.float64]:
        """(n, 2) planar map ``turns @ lattice``, defined modulo the rows of ``lattice``."""
        return self.turns @ self.lattice

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """``angles`` and ``turns``, (n, 2) each, and ``lattice``."""
        return {"angles": self.angles, "turns": self.turns, "lattice": self.lattice}

    def extra_scalars(self) -> dict[str, Any]:
        """Aspect, skew, conformal energy, weights and folds in the flat chart."""
        return {
            "aspect": self.aspect,
            "skew": self.skew,
            "conformal_energy": self.conformal_energy,
            "weights": self.weights,
            "chart_flips": self.flips,
        }


@takes_threads
def conformal_map(
    surface: TriMesh,
    *,
    basis: HomologyBasis | None = None,
    weights: Literal["auto"] | Weights = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> ConformalMap:
    """Map a genus-one surface conformally onto a flat torus and a torus of revolution.

    Parameters
    ----------
    surface : TriMesh
        Closed surface of genus one.
    basis : HomologyBasis, optional
        From `homology_basis`; computed if left out.
    weights : {"auto", "cotangent", "intrinsic_delaunay", "clamped"}
        Weights of the harmonic forms, see `HarmonicForms`. ``"auto"`` takes the first of the three
        whose chart has no fold; the last cannot fold but for rounding, the result says which it is.
    threads : int, optional
        Threads to use, see `threads`; the result does not depend on it.
    progress : Progress, optional
        Called once per choice of weights tried.

    Returns
    -------
    ConformalMap

    Raises
    ------
    MeshError
        As `homology_basis`.
    GenusError
        The genus is not one.
    OptionError
        Unknown weights.
    SolverError
        The Laplacian could not be factorised.

    Examples
    --------
    A torus of revolution is mapped onto itself, ``aspect`` being near ``sqrt((R / r)^2 - 1)``.

    >>> import stretchmap as sm
    >>> result = sm.conformal_map(sm.samples.torus_surface(60, 30, R=2.0))
    >>> round(result.aspect, 2), round(result.torus.ratio, 2)
    (1.74, 2.0)
    """
    surface = as_surface(surface)
    one_of("weights", weights, ("auto", *WEIGHTS))
    callback("progress", progress)
    start = perf_counter()
    if basis is None:
        basis = homology_basis(surface)
    require_basis_of(surface, basis)
    basis.require_torus()
    middle = perf_counter()
    choices = WEIGHTS if weights == "auto" else (weights,)
    harmonic, forms, areas = _chart(surface, basis, choices, progress)
    cotangent = _core.forms.cotangent_weights(surface.topology, surface.V)
    gram = (forms * cotangent) @ forms.T
    aspect = math.sqrt(gram[1, 1] / gram[0, 0])
    turns = harmonic.potentials @ basis.torus_matrix.T
    torus = conformal_torus(aspect).with_area(surface.area)
    angles = np.column_stack([2.0 * np.pi * turns[:, 0], tube_angle(turns[:, 1], aspect)])
    image = torus.xi(angles[:, 0], angles[:, 1])
    folds = int((areas <= 0.0).sum())
    return ConformalMap(
        mesh=surface,
        basis=basis,
        forms=basis.torus_forms,
        turns=read_only(turns),
        gram=read_only(gram),
        lattice=read_only(lattice_basis(gram, surface.area)),
        aspect=aspect,
        skew=-float(gram[0, 1]) / math.sqrt(gram[0, 0] * gram[1, 1]),
        conformal_energy=math.sqrt(np.linalg.det(gram)) - 1.0,
        weights=harmonic.weights,
        chart_areas=read_only(areas),
        torus=torus,
        angles=read_only(angles),
        image=read_only(image),
        converged=folds == 0,
        stop_reason="solved" if folds == 0 else f"solved, but {folds} faces are folded",
        seconds={"homology": middle - start, "conformal": perf_counter() - middle},
    )


def _chart(
    surface: TriMesh,
    basis: HomologyBasis,
    choices: tuple[Weights, ...],
    progress: Progress | None,
) -> tuple[HarmonicForms, NDArray[np.float64], NDArray[np.float64]]:
    """First of the weights without a fold, else the one with fewest: forms (2, e), areas (m,)."""
    fewest, best = math.inf, None
    for done, weights in enumerate(choices, 1):
        harmonic = harmonic_forms(surface, basis, weights=weights)
        forms = basis.torus_matrix @ harmonic.forms
        areas = _core.forms.chart_areas(surface.topology, forms[0], forms[1])
        folds = int((areas <= 0.0).sum())
        report(progress, "conformal", done, len(choices), folds=folds)
        if best is None or folds < fewest:
            fewest, best = folds, (harmonic, forms, areas)
        if folds == 0:
            break
    assert best is not None, "there is a choice of weights"
    return best
