"""Solids without a vertex inside: filled by a mesher that is not asked for quality."""

from __future__ import annotations

import numpy as np

from stretchmap import TetMesh, samples

from . import Family, drilled, knots, rings, spiky, tubes

_SURFACES = (tubes.even_tubes, drilled.even, knots.knots, rings.fat, spiky.spiky)
_ANY = 1e6  # ratio of circumradius to shortest edge


def bare(rng: np.random.Generator, n_tets: float) -> TetMesh:
    """Even triangles of another family, and between them tets that reach right across.

    A few vertices may be added inside, without which there would be no such mesh.
    """
    surface = _SURFACES[int(rng.integers(len(_SURFACES)))](rng, n_tets)
    return samples.tetrahedralize(surface, quality=_ANY)


FAMILIES = (Family("bare", "no vertex inside, tets that reach right across", True, bare),)
