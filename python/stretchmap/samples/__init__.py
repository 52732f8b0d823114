"""Meshes of our own: solid tori by a structured sweep, closed surfaces, pairs to be registered."""

from ..mesh.tetrahedralize import tetrahedralize
from .population import VertebraPopulation, vertebra_population
from .solids import ball, bumpy_torus, knot_tube, solid_double_torus, solid_torus
from .surfaces import double_torus, sphere, torus_surface
from .vertebra import VertebraPair, vertebra_like, vertebra_pair

__all__ = [
    "VertebraPair",
    "VertebraPopulation",
    "ball",
    "bumpy_torus",
    "double_torus",
    "knot_tube",
    "solid_double_torus",
    "solid_torus",
    "sphere",
    "tetrahedralize",
    "torus_surface",
    "vertebra_like",
    "vertebra_pair",
    "vertebra_population",
]
