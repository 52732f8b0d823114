"""From triangles as a scanner's software writes them to one oriented manifold surface.

Works on bare arrays, since what comes in need not be a surface: points are welded, sheets that
touch along edges or in vertices are parted, faces oriented, and all pieces but one dropped.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .. import _core
from ..errors import ConnectivityError

__all__ = [
    "LARGEST_DEBRIS", "compacted", "components", "keep_largest", "labels", "part_sheets", "weld",
    "weld_borders",
]  # fmt: skip

Points = NDArray[np.float64]
Faces = NDArray[np.int32]

# Two pieces are debris and body only if their areas, or numbers of voxels, are farther apart.
LARGEST_DEBRIS = 0.3
_COARSER = 3.0  # each tolerance for borders, times the one before
_SHARE_OF_EDGE = 0.1  # of the median edge, that no tolerance reaches
_LOST = 1e-3  # of the faces at borders, may be lost by a larger tolerance


def weld(V: Points, F: Faces, tolerance: float) -> tuple[Points, Faces, dict[str, int]]:
    """Make one vertex of all that are closer than ``tolerance``; drop what collapses, and copies.

    Parameters
    ----------
    V : (n, 3) ndarray
    F : (m, 3) ndarray of int32
    tolerance : float
        Chains of close vertices become one vertex, too.

    Returns
    -------
    V, F : ndarrays
    counts : dict
        ``welded`` vertices, ``collapsed`` faces (a vertex twice), ``copies`` of faces.
    """
    points, ids = np.unique(V + 0.0, axis=0, return_inverse=True)
    faces = ids.reshape(-1)[F]
    V, G, counts = _welded(points, faces, _close_pairs(points, tolerance))
    counts["welded"] += len(np.unique(F)) - len(np.unique(faces))
    return V, G, counts


def weld_borders(V: Points, F: Faces, tolerance: float) -> tuple[Points, Faces, dict[str, float]]:
    """Weld, and vertices on borders also where they are farther apart, as far as that is safe.

    Corners that differ by noise leave cracks or a soup of single triangles. So the tolerance grows
    to at most a tenth of the median edge, as long as hardly a face is lost. A larger one is taken
    only where it leaves no border edges, or at most half as many as any smaller one.

    Parameters
    ----------
    V : (n, 3) ndarray
    F : (m, 3) ndarray of int32
    tolerance : float
        The first one, for all vertices.

    Returns
    -------
    V, F : ndarrays
    counts : dict
        As of `weld`, and the ``tolerance`` where a larger one was taken.

    Raises
    ------
    ConnectivityError
        No two faces share an edge in most places all the same.
    """
    V, F, first = weld(V, F, tolerance)
    best: tuple[Points, Faces, dict[str, float]] = V, F, {**first}
    borders, n_edges = _border_edges(F)
    if not len(borders):
        return best
    among = np.unique(borders)
    most_lost = _LOST * np.count_nonzero(np.isin(F, among).any(axis=1))
    limit = _SHARE_OF_EDGE * float(np.median(np.linalg.norm(V[F] - V[np.roll(F, 1, 1)], axis=2)))
    left = len(borders)
    while left and (tolerance := _COARSER * tolerance) < limit:
        pairs = among[_close_pairs(V[among], tolerance)]
        if not len(pairs):
            continue
        W, G, more = _welded(V, F, pairs)
        if more["collapsed"] + more["copies"] > most_lost:
            break
        borders, n = _border_edges(G)
        if 2 * len(borders) <= left:
            left, n_edges = len(borders), n
            best = W, G, {**{k: first[k] + more[k] for k in first}, "tolerance": tolerance}
    if 2 * left > n_edges:
        raise ConnectivityError(
            f"{left} of {n_edges} edges belong to one face only: the triangles do not share "
            "vertices, and those that should be one are too far apart to be told from others; "
            "weld them with a tolerance of your own, or export the surface with shared vertices"
        )
    return best


def _border_edges(F: Faces) -> tuple[NDArray[Any], int]:
    """Edges of one face, as pairs of vertices, and the number of all."""
    if not len(F):
        return np.zeros((0, 2), np.int64), 0
    one, other = F.ravel().astype(np.int64), np.roll(F, -1, axis=1).ravel()
    base = int(F.max()) + 1
    key, count = np.unique(
        np.minimum(one, other) * base + np.maximum(one, other), return_counts=True
    )
    single = key[count == 1]
    return np.stack([single // base, single % base], axis=1), len(key)


def _close_pairs(points: Points, tolerance: float) -> NDArray[np.int64]:
    pairs: NDArray[np.int64] = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    return pairs


def _welded(
    points: Points, F: NDArray[Any], pairs: NDArray[np.int64]
) -> tuple[Points, Faces, dict[str, int]]:
    """Weld pairs of points, which all differ."""
    faces = F
    if len(pairs):
        label = labels(len(points), pairs[:, 0], pairs[:, 1])
        first = np.unique(label, return_index=True)[1]
        points, faces = points[first], label[faces]
    welded = len(np.unique(F)) - len(np.unique(faces))
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    _, kept = np.unique(np.sort(faces[whole], axis=1), axis=0, return_index=True)
    counts = {
        "welded": int(welded),
        "collapsed": int((~whole).sum()),
        "copies": int(whole.sum() - len(kept)),
    }
    return *compacted(points, faces[whole][np.sort(kept)]), counts


def part_sheets(V: Points, F: Faces) -> tuple[Points, Faces, dict[str, int]]:
    """Orient the faces and part sheets that meet where a manifold has only one.

    Corners of faces stay one vertex where a chain of faces joins them across edges that have
    exactly two faces, oriented alike (Gueziec et al., IEEE TVCG 7(2), 2001). Edges that have more
    than two faces even then lose all of them.

    Returns
    -------
    V, F : ndarrays
        Every edge has one or two faces and every vertex a single fan; open where sheets that
        cannot be matched were parted.
    counts : dict
        ``turned`` faces, ``parted`` vertices (copies made), ``removed`` faces.
    """
    counts = {"turned": 0, "parted": 0, "removed": 0}
    while True:
        turn = _core.mesh.misoriented_faces(V, F)
        F = F.copy()
        F[turn] = F[turn][:, [0, 2, 1]]
        counts["turned"] += len(turn)
        n_before = len(np.unique(F))
        corners, crowded = _fans(F)
        if n_before == corners.max() + 1 and not crowded.any():
            return V, F, counts
        first = np.unique(corners, return_index=True)[1]
        counts["parted"] += len(first) - n_before
        if len(first) == n_before:  # nothing to part is left, the faces have to go
            counts["removed"] += int(crowded.sum())
            V, F = compacted(V, F[~crowded])
        else:
            V, F = V[F.ravel()[first]], corners.reshape(-1, 3).astype(np.int32)


def _fans(F: Faces) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Fan of each corner of each face, and the faces at edges with more than two."""
    head = np.roll(F, -1, axis=1).ravel().astype(np.int64)
    tail = F.ravel().astype(np.int64)
    key = np.minimum(tail, head) * (F.max() + 1) + np.maximum(tail, head)
    order = np.argsort(key, kind="stable")
    start = np.flatnonzero(np.diff(key[order], prepend=-1))
    size = np.diff(start, append=len(key))
    one, other = order[start[size == 2]], order[start[size == 2] + 1]
    matched = tail[one] == head[other]
    one, other = one[matched], other[matched]

    def following(h: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.where(h % 3 == 2, h - 2, h + 1)

    corners = labels(
        F.size, np.concatenate([one, other]), np.concatenate([following(other), following(one)])
    )
    crowded = np.zeros(len(F), bool)
    crowded[order[np.repeat(size > 2, size)] // 3] = True
    return corners, crowded


def keep_largest(V: Points, F: Faces) -> tuple[Points, Faces, dict[str, Any]]:
    """Drop every component but that of the largest area.

    Returns
    -------
    V, F : ndarrays
    counts : dict
        ``dropped`` components and their ``area``, a share of what is kept.

    Raises
    ------
    ConnectivityError
        Another component that is not inside the first is too large to be debris.
    """
    label = components(F)
    area = _core.mesh.face_areas(np.ascontiguousarray(V), np.ascontiguousarray(F))
    areas = np.bincount(label, area)
    kept = int(areas.argmax())
    body = F[label == kept]
    others = np.delete(np.arange(len(areas)), kept)
    for part in others[areas[others] > LARGEST_DEBRIS * areas[kept]]:
        faces = np.flatnonzero(label == part)
        if abs(_winding(V, body, V[F[faces[0], 0]])) < 0.5:
            raise ConnectivityError(
                f"there are two large pieces, the second with {areas[part] / areas[kept]:.0%} of "
                "the area of the first; split the surface and prepare one of them",
                faces.tolist(),
            )
    share = float(areas[others].sum() / areas[kept])
    return *compacted(V, body), {"dropped": len(others), "area": share}


def components(F: Faces) -> NDArray[np.int32]:
    """Component of each face; faces that share a vertex belong together."""
    label = labels(int(F.max()) + 1, F[:, :2].ravel(), np.repeat(F[:, 2], 2))[F[:, 0]]
    return np.unique(label, return_inverse=True)[1].astype(np.int32)


def compacted(V: Points, F: Faces) -> tuple[Points, Faces]:
    """Without the vertices no face uses."""
    kept, ids = np.unique(F, return_inverse=True)
    return np.ascontiguousarray(V[kept]), ids.reshape(F.shape).astype(np.int32)


def labels(n: int, i: NDArray[Any], j: NDArray[Any]) -> NDArray[np.int32]:
    """Component of each of n nodes, joined by edges from i to j."""
    graph = coo_matrix((np.ones(len(i), np.int8), (i, j)), shape=(n, n))
    label: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return label


def _winding(V: Points, F: Faces, point: Points) -> float:
    """Winding number of a surface about a point (van Oosterom, Strackee, 1983)."""
    a, b, c = np.moveaxis(V[F] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    top = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a))]
    bottom = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return float(np.arctan2(top, bottom).sum() / (2.0 * np.pi))
