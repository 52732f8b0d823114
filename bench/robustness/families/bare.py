"""Solids without a vertex inside: a constrained Delaunay mesh, its quality not asked for."""

from __future__ import annotations

import numpy as np
import tetgen

from stretchmap import TetMesh

from . import Family, drilled, knots, rings, spiky, tubes

_SURFACES = (tubes.even_tubes, drilled.even, knots.knots, rings.fat, spiky.spiky)


def bare(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """Even triangles of another family, and between them tets that reach right across.

    A few vertices may be added inside, without which there would be no such mesh.
    """
    surface = _SURFACES[int(rng.integers(len(_SURFACES)))](rng, n_tets)
    made = tetgen.TetGen(np.asarray(surface.V), np.asarray(surface.F))
    V, T = made.tetrahedralize(switches="pYQ")[:2]
    return TetMesh(V, T[:, :4], orient=True)


FAMILIES = (Family("bare", "no vertex inside, tets that reach right across", True, bare),)
