"""Short loops that generate the classes that bound on one side of a surface."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import read_only
from .walks import joined_loops, shortest_cycles, shortest_in_class

if TYPE_CHECKING:
    from .generators import Generators

__all__ = ["ShortestBasis", "searched", "short_loops", "shortest_walk", "walk_below"]

_ROOTS = 4  # vertices of a loop from which others are looked for
_CANDIDATES = 20  # loops to be exchanged, per member of a basis
# Nodes of the cover, at most, in search of a loop: more than surfaces of small genus take, by the
# square of the genus, or fine ones.
_MOST_SETTLED, _SETTLED_A_FACE = 20_000_000, 50

_Loops = tuple[NDArray[np.int32], ...]


def short_loops(basis: Generators, rows: NDArray[np.int64], known: _Loops) -> _Loops:
    """The shortest loop of each of some classes or, if that takes too long, of a basis of these.

    Parameters
    ----------
    basis : Generators
    rows : (g, 2g) array of int64
        Its handle or its tunnel classes.
    known : tuple of (k,) ndarray of int32
        Loops that the former may cross.

    Returns
    -------
    tuple of (k,) ndarray of int32
    """
    loops = []
    for row in rows:
        loop = searched(basis, row, known, most=_most_settled(basis))
        if not len(loop):
            return _exchanged_loops(basis, rows)
        loops.append(loop)
    return tuple(loops)


def shortest_walk(basis: Generators, row: NDArray[np.int64]) -> NDArray[np.int32]:
    """The shortest loop of a class.

    Time grows exponentially with the genus only where the shortest cycle of the class is in pieces.
    """
    loop = searched(basis, row, most=_most_settled(basis))
    return loop if len(loop) else _walk(basis, row, _cycles(basis, row), None)


def walk_below(basis: Generators, row: NDArray[np.int64], limit: float) -> NDArray[np.int32] | None:
    """The shortest loop of a class, None if it is not shorter than a limit."""
    # Balls of the cover of that radius may well take less time than minimum cuts of the surface.
    if basis.surface.n_faces > (3 * basis.genus) ** 2:
        loop = searched(basis, row, limit=limit)
        return loop if len(loop) else None
    cycles = _cycles(basis, row)
    if not sum(basis.length(cycle) for cycle in cycles) < limit:
        return None
    loop = _walk(basis, row, cycles, _most_settled(basis))
    return loop if basis.length(loop) < limit else None


def searched(
    basis: Generators,
    row: NDArray[np.int64],
    known: _Loops = (),
    *,
    limit: float = math.inf,
    most: int | None = None,
) -> NDArray[np.int32]:
    """The shortest loop of a class by search of the cover.

    Parameters
    ----------
    basis : Generators
    row : (2g,) array of int64
    known : tuple of (k,) ndarray of int32
        Loops besides the generators that it may cross.
    limit : float
        A loop that is not shorter is not returned.
    most : int, optional
        Nodes of the cover that may be settled.

    Returns
    -------
    (k,) ndarray of int32
        Empty if there is none below the limit, or none was found in time.
    """
    meets = basis.intersection @ row
    crossing = [loop.tolist() for loop in known if basis.classes(loop) @ meets]
    crossing += [basis.generators[i].tolist() for i in np.flatnonzero(meets)]
    return shortest_in_class(basis.surface, basis.dual_forms, row, crossing, limit, most)


def _most_settled(basis: Generators) -> int | None:
    if basis.genus < 2:
        return None
    return max(_MOST_SETTLED // basis.genus**2, _SETTLED_A_FACE * basis.surface.n_faces)


def _exchanged_loops(basis: Generators, rows: NDArray[np.int64]) -> _Loops:
    """Loops of a basis of the lattice of some classes, as short as exchanges make them."""
    found = ShortestBasis(rows)
    for k in range(len(rows)):
        if found.loops[k] is None:
            _find(basis, found, k)
    for k in _exchange(basis, found):
        loop = found.loops[k]
        if loop is not None:
            _offer(basis, found, shortest_cycles(basis.surface, (loop,), np.ones(1, np.int64)))
    return tuple(loop for loop in found.loops if loop is not None)


def _find(basis: Generators, found: ShortestBasis, k: int) -> None:
    """The shortest loop of member k, or shorter ones in its place."""
    row = found.rows[k]
    cycles = _cycles(basis, row)
    _offer(basis, found, cycles)
    if found.loops[k] is None:
        loop = _walk(basis, row, cycles, _most_settled(basis))
        found.settle(k, loop, basis.length(loop))


def _cycles(basis: Generators, row: NDArray[np.int64]) -> list[NDArray[np.int32]]:
    return shortest_cycles(basis.surface, basis.generators, row)


def _walk(
    basis: Generators,
    row: NDArray[np.int64],
    cycles: list[NDArray[np.int32]],
    most: int | None,
) -> NDArray[np.int32]:
    """One loop of the class of some shortest cycles: the shortest, if it is found in time."""
    joined = joined_loops(basis.surface, cycles)
    length, least = basis.length(joined), sum(basis.length(cycle) for cycle in cycles)
    if length <= (1 + 1e-12) * least:
        return joined
    loop = searched(basis, row, limit=length, most=most)
    return loop if len(loop) else joined


def _offer(basis: Generators, found: ShortestBasis, loops: list[NDArray[np.int32]]) -> list[int]:
    """Offer loops, the first ones first, until none is taken; the members they have become."""
    offers = [(basis.classes(x), x, basis.length(x)) for x in loops]
    taken: set[int] = set()
    while True:
        places = {found.offer(*offer) for offer in offers if offer[2] < found.lengths.max()}
        if not places - {-1}:
            return sorted(taken)
        taken |= places - {-1}


def _exchange(basis: Generators, found: ShortestBasis) -> list[int]:
    """Exchange loops for shorter ones through some of their vertices; the members exchanged.

    Classes are told apart by sums with random factors modulo 2^64.
    """
    loops = [loop for loop in found.loops if loop is not None]
    roots = np.unique(np.concatenate([x[:: -(-len(x) // _ROOTS)] for x in loops]))
    random = np.random.default_rng(0)
    factors = random.integers(2**63, size=(2, 2 * basis.genus))
    # A class is one of the lattice exactly if it has no intersection with the lattice.
    factors[0] = factors[0, : basis.genus] @ found.rows @ basis.intersection
    marks = (factors @ basis.dual_forms).astype(np.uint64)
    top = basis.surface.topology
    others = _core.homology.tree_loops(
        top,
        _core.mesh.edge_lengths(top, basis.surface.V),
        marks,
        roots.tolist(),
        float(found.lengths.max()),
    )
    kept = [read_only(np.array(x, np.int32)) for x in others[: _CANDIDATES * basis.genus]]
    return _offer(basis, found, kept)


class ShortestBasis:
    """A lattice basis of homology classes whose members are exchanged for shorter ones.

    Parameters
    ----------
    rows : (d, n) array of int64
        Basis of a lattice without gaps; none of the members is known as a loop yet.
    """

    def __init__(self, rows: NDArray[np.int64]) -> None:
        self.rows = rows.copy()
        self.loops: list[NDArray[np.int32] | None] = [None] * len(rows)
        self.lengths = np.full(len(rows), math.inf)
        self._first = rows.astype(float)
        self._solve = np.linalg.pinv(rows.astype(float))
        self._coordinates = np.eye(len(rows), dtype=np.int64)  # of the first basis in this one

    def offer(self, row: NDArray[np.int64], loop: NDArray[np.int32], length: float) -> int:
        """Put a loop in the place of the longest member that it can replace and is shorter than.

        Returns
        -------
        int
            The member, -1 if there is none; the rows are a basis of the same lattice as before.
        """
        first = np.rint(row @ self._solve)
        if not np.array_equal(first @ self._first, row):
            return -1
        share = first.astype(np.int64) @ self._coordinates
        lengths = np.where(np.abs(share) == 1, self.lengths, -math.inf)
        k = int(np.argmax(lengths))
        if not length < lengths[k]:
            return -1
        self.rows[k], self.loops[k], self.lengths[k] = row, loop, length
        self._coordinates[:, k] *= share[k]
        share[k] = 0
        self._coordinates -= np.outer(self._coordinates[:, k], share)
        return k

    def settle(self, k: int, loop: NDArray[np.int32], length: float) -> None:
        """Say which loop is that of member k."""
        self.loops[k], self.lengths[k] = loop, length
