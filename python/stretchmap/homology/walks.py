"""Loops of edges: the shortest of a homology class, and files of them."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import read_only
from ..base.files import atomic_path
from ..base.options import as_path
from ..errors import FileFormatError
from ..io.npz import save_npz

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

__all__ = ["joined_loops", "save_loops", "shortest_cycles", "shortest_in_class"]


def shortest_in_class(
    surface: TriMesh,
    forms: NDArray[np.int32],
    target: NDArray[np.int64],
    crossing: list[list[int]],
    limit: float,
    most_settled: int | None = None,
) -> NDArray[np.int32]:
    """Vertices of the shortest loop of a class, none if it is not shorter than the limit.

    The search starts from the shortest of `crossing`, loops whose intersection number with the
    class is not zero: every loop of the class crosses them. There is none, either, where more nodes
    of the cover would have to be settled than allowed.
    """
    top = surface.topology
    lengths = _core.mesh.edge_lengths(top, surface.V)
    loop = _core.homology.shortest_loop(
        top, lengths, forms, target.astype(np.int32), min(crossing, key=len), limit,
        2**62 if most_settled is None else most_settled,
    )  # fmt: skip
    return read_only(np.array(loop, dtype=np.int32))


def shortest_cycles(
    surface: TriMesh, loops: tuple[NDArray[np.int32], ...], multiples: NDArray[np.int64]
) -> list[NDArray[np.int32]]:
    """Simple loops, shortest of their classes, that add up to the class of a sum of loops.

    They are as short as can be together.
    """
    top = surface.topology
    used = np.flatnonzero(multiples)
    cycles = _core.homology.shortest_cycles(
        top,
        _core.mesh.edge_lengths(top, surface.V),
        [loops[k].tolist() for k in used],
        multiples[used].astype(np.int32),
    )
    return [read_only(np.array(cycle, dtype=np.int32)) for cycle in cycles]


def joined_loops(surface: TriMesh, loops: list[NDArray[np.int32]]) -> NDArray[np.int32]:
    """One closed walk along all of some loops, and to and fro on the shortest way between them."""
    top = surface.topology
    lengths = _core.mesh.edge_lengths(top, surface.V)
    walk = _core.homology.joined_loops(top, lengths, [loop.tolist() for loop in loops])
    return read_only(np.array(walk, dtype=np.int32))


def save_loops(
    path: str | os.PathLike[str], surface: TriMesh, arrays: dict[str, NDArray[Any]]
) -> None:
    """Write a surface with its edges and further arrays as ``.npz``."""
    path = as_path(path)
    if path.suffix.lower() != ".npz":
        raise FileFormatError(f"{path}: loops and forms are written as .npz")
    arrays = {"V": surface.V, "F": surface.F, "edges": surface.edges, **arrays}
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        save_npz(file, arrays)
