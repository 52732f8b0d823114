"""Shortest loops of edges in a homology class."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import read_only

if TYPE_CHECKING:
    from .loops import HomologyBasis

__all__ = ["shortest_in_class"]


def shortest_in_class(
    basis: HomologyBasis,
    target: NDArray[np.int64],
    known: tuple[NDArray[np.int32], ...],
    limit: float,
) -> NDArray[np.int32]:
    """Vertices of the shortest loop of a class, none if it is not shorter than the limit.

    Every such loop crosses each loop whose intersection number with the class is not zero; the
    search starts from the shortest of them among `known` and the generators.
    """
    top = basis.surface.topology
    lengths = _core.mesh.edge_lengths(top, basis.surface.V)
    crossing = [
        loop.tolist()
        for loop in (*known, *basis.generators)
        if basis.classes(loop) @ basis.intersection @ target
    ]
    loop = _core.homology.shortest_loop(
        top, lengths, basis.dual_forms, target.astype(np.int32), min(crossing, key=len), limit
    )
    return read_only(np.array(loop, dtype=np.int32))
