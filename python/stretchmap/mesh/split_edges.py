"""Edges of a tet mesh split in two, and the way back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from .meshes import TetMesh

TET_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


@dataclass(frozen=True, eq=False)
class EdgeSplit:
    """What `split_edges` leaves behind.

    Attributes
    ----------
    solid : TetMesh
        Its first n vertices are those of the input, then one on each edge that was split.
    kept : ndarray of intp, shape (a,)
        The edges that were split, ascending.
    parent_tet : ndarray of intp, shape (k',)
        Input tet of each tet.
    """

    solid: TetMesh
    kept: NDArray[np.intp]
    parent_tet: NDArray[np.intp]


def split_edges(solid: TetMesh, edges: NDArray[np.int32], shares: NDArray[np.float64]) -> EdgeSplit:
    """Split edges in two, with all tets round them; of edges with a tet in common, the first.

    Parameters
    ----------
    solid : TetMesh
    edges : ndarray of int32, shape (e, 2)
        Different edges of the solid.
    shares : ndarray, shape (e,)
        Where to split, as a share of the way from the first end, between 0 and 1.
    """
    n = solid.n_vertices

    def keys(pairs: NDArray[np.int32]) -> NDArray[np.int64]:
        low: NDArray[np.int64] = pairs.min(axis=-1).astype(np.int64)
        return np.asarray(low * n + pairs.max(axis=-1))

    wanted = keys(edges)
    order = np.argsort(wanted)
    touched = np.zeros(n, bool)
    touched[edges] = True
    near = np.flatnonzero(touched[solid.T].sum(axis=1) > 1)
    have = keys(solid.T[near][:, TET_EDGES])  # (k', 6)
    place = order[np.minimum(np.searchsorted(wanted, have, sorter=order), len(order) - 1)]
    hit = np.where(wanted[place] == have, place, len(edges))
    nearest = hit.min(axis=1, initial=len(edges))
    first = np.full(solid.n_tets, len(edges))
    first[near] = nearest
    late = np.zeros(len(edges) + 1, bool)
    late[hit[hit > nearest[:, None]]] = True
    kept = np.flatnonzero(~late[:-1])
    number = np.full(len(edges) + 1, -1)
    number[kept] = n + np.arange(len(kept))
    new = number[first]
    cut = np.flatnonzero(new >= 0)
    halves = [solid.T[cut], solid.T[cut]]
    for half, side in zip(halves, (0, 1), strict=True):
        half[half == edges[first[cut], side][:, None]] = new[cut]
    T = np.concatenate([solid.T[new < 0], *halves])
    ends = solid.V[edges[kept]]
    share = shares[kept, None]
    V = np.concatenate([solid.V, (1.0 - share) * ends[:, 0] + share * ends[:, 1]])
    parent = np.concatenate([np.flatnonzero(new < 0), cut, cut])
    return EdgeSplit(TetMesh(V, T), kept, parent)


@dataclass(frozen=True, eq=False)
class SplitSolid:
    """A solid some of whose edges were split, pass by pass.

    Attributes
    ----------
    solid : TetMesh
        Its first n vertices are those of the input.
    parent_tet : ndarray of int32, shape (k',)
        Input tet of each tet.
    passes : tuple of (ndarray of int32, shape (a, 2); ndarray, shape (a,))
        The edges split in each pass, and where, as a share of the way from the first end; the ends
        may have been added before.
    """

    solid: TetMesh
    parent_tet: NDArray[np.int32]
    passes: tuple[tuple[NDArray[np.int32], NDArray[np.float64]], ...] = ()

    @classmethod
    def of(cls, solid: TetMesh) -> SplitSolid:
        """A solid as it is."""
        return cls(solid, read_only(np.arange(solid.n_tets, dtype=np.int32)))

    @property
    def n_split(self) -> int:
        """Number of added vertices."""
        return sum(len(edges) for edges, _ in self.passes)

    def split(
        self, edges: NDArray[np.int32], shares: NDArray[np.float64]
    ) -> tuple[SplitSolid, NDArray[np.intp]]:
        """One pass more, and which of the edges it split; see `split_edges`."""
        done = split_edges(self.solid, edges, shares)
        added = read_only(edges[done.kept]), read_only(shares[done.kept])
        parent = read_only(self.parent_tet[done.parent_tet])
        return SplitSolid(done.solid, parent, (*self.passes, added)), done.kept
