"""Cutting surplus handles along shortest loops (paper section 3.1 finds the loops).

A *handle* loop bounds a disk inside the solid, and cutting there parts a bridge; a *tunnel* loop
bounds one outside, and a membrane across it fills the tunnel. Either way the surface is opened
along the loop, the opening is widened along the bridge or the tunnel as long as its two borders do
not get much longer, and both borders are closed: the genus is one less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..base.progress import Progress, report
from ..errors import GenusError, SelfIntersectionError
from ..homology.basis import HomologyBasis, homology_basis
from ..homology.integer import reduced_basis
from ..mesh.meshes import TriMesh
from .holes import close_holes, crossings, remove_crossings
from .soup import Faces, Points, compacted, labels

__all__ = ["HandleCut", "cut_handles"]

_WIDER = 1.4  # a border of the opening may be that much longer than the loop
_RINGS = (60, 6, 0)  # the opening is widened by at most so many rings of faces
_BAND = 0.35  # half-width of the first opening, as a share of the edges that leave the loop


@dataclass(frozen=True)
class HandleCut:
    """One surplus handle removed.

    Attributes
    ----------
    kind : {"handle", "tunnel"}
        A bridge of the solid that was cut, or a tunnel through it that was filled.
    length : float
        Length of the shortest loop round it, in units of the points.
    share : float
        The same over the square root of the area of the surface.
    center : tuple of three floats
        Where it was.

    Examples
    --------
    >>> import stretchmap as sm
    >>> done = sm.prepare(sm.samples.double_torus(6), faces=1_000, max_cut=0.7)
    >>> [cut.length > 0.0 for cut in done.cuts]
    [True]
    """

    kind: Literal["handle", "tunnel"]
    length: float
    share: float
    center: tuple[float, float, float]

    def __str__(self) -> str:
        what = "a bridge cut" if self.kind == "handle" else "a tunnel filled"
        x, y, z = self.center
        return f"{what}, {self.length:.6g} round, at ({x:.6g}, {y:.6g}, {z:.6g})"


@dataclass(frozen=True, eq=False)
class _Candidate:
    kind: Literal["handle", "tunnel"]
    row: NDArray[np.int64]  # its class over the generators
    loop: NDArray[np.int32]
    length: float


def cut_handles(
    surface: TriMesh, genus: int, max_cut: float, progress: Progress | None = None
) -> tuple[TriMesh, tuple[HandleCut, ...]]:
    """Cut the shortest handles until the genus is the one wanted.

    Parameters
    ----------
    surface : TriMesh
        Closed, without self-intersections.
    genus : int
    max_cut : float
        Longest loop that may be cut, as a share of the square root of the area.
    progress : Progress, optional
        Called once per round.

    Returns
    -------
    surface : TriMesh
    cuts : tuple of HandleCut

    Raises
    ------
    GenusError
        There are fewer handles than wanted, or more and the shortest is too long to be cut.
    """
    cuts: list[HandleCut] = []
    size = math.sqrt(surface.area)
    first = surface.genus
    if first < genus:
        raise GenusError(
            f"the surface has genus {first}, {genus} is wanted: a hole is missing that no repair "
            "can guess; it was closed by the segmentation, or never there"
        )
    while surface.genus > genus:
        report(progress, "handles", first - surface.genus, first - genus)
        basis = homology_basis(surface)
        found = _cut_round(basis, surface.genus - genus, max_cut * size)
        if found is None:
            raise GenusError(
                f"the surface has {surface.genus - genus} handles more than wanted and no loop "
                f"round one of them is shorter than {max_cut * size:.6g} (max_cut = {max_cut:g} "
                "times the root of its area); raise max_cut, or cut the handle that is too many"
            )
        surface, done = found
        cuts += [
            HandleCut(
                c.kind,
                c.length,
                c.length / size,
                tuple(basis.surface.V[c.loop].mean(axis=0).tolist()),
            )
            for c in done
        ]
    return surface, tuple(cuts)


def _without_crossings(cut: TriMesh, genus: int) -> TriMesh | None:
    """The surface repaired, None where that cannot be done or gives another genus."""
    try:
        repaired = remove_crossings(TriMesh(*compacted(cut.V, cut.F)))[0]
    except SelfIntersectionError:
        return None
    return repaired if repaired.genus == genus else None


def _cut_round(
    basis: HomologyBasis, most: int, limit: float
) -> tuple[TriMesh, list[_Candidate]] | None:
    """Cut up to ``most`` handles whose loops do not meet; None where none can be cut."""
    surface = basis.surface
    done: list[_Candidate] = []
    for candidate in _candidates(basis, limit):
        crossed = [c.row @ basis.intersection @ candidate.row for c in done]
        if any(crossed) or not _is_simple_loop(surface.F, candidate.loop):
            continue
        for rings in _RINGS:
            cut = _cut(surface, candidate, rings)
            crossing = cut.genus != surface.genus - 1 or len(crossings(cut)) > 0
            if not crossing:
                break
        if crossing and done:  # the repair numbers anew: in the next round
            continue
        repaired = _without_crossings(cut, surface.genus - 1) if crossing else cut
        if repaired is None:
            continue
        surface = repaired
        done.append(candidate)
        if crossing or len(done) == most:
            break
    if not done:
        return None
    return TriMesh(*compacted(surface.V, surface.F)), done


def _candidates(basis: HomologyBasis, limit: float) -> list[_Candidate]:
    """Loops of both kinds below the limit, shortest first."""
    if basis.tunnel_classes is None:
        raise SelfIntersectionError("the surface crosses itself: no loop is known to bound outside")
    # Dual to the reduced handles, the tunnels need not be short themselves.
    tunnels = reduced_basis(basis.tunnel_classes, np.linalg.inv(basis.harmonic.gram))
    found = []
    kinds: tuple[tuple[Literal["handle", "tunnel"], NDArray[np.int64]], ...] = (
        ("handle", basis.handle_classes),
        ("tunnel", tunnels),
    )
    for kind, rows in kinds:
        for row in rows:
            loop = basis.loop_below(row, limit)
            if loop is not None:
                found.append(_Candidate(kind, row, loop, basis.length(loop)))
    return sorted(found, key=lambda c: c.length)


def _cut(surface: TriMesh, candidate: _Candidate, rings: int) -> TriMesh:
    """Open the surface along a loop, widen the opening, close both sides.

    Vertices keep their numbers; those of the band that is lost are used by no face any more.
    """
    V, F = _opened(surface.V, surface.F, candidate.loop)
    border = _Border.of(F)
    for _ in range(rings):
        wider = _widened(V, F, border, _WIDER * candidate.length)
        if wider is None:
            break
        F, border = wider
    V, F, _ = close_holes(V, np.ascontiguousarray(F))
    return TriMesh(V, F)


def _widened(V: Points, F: Faces, border: _Border, limit: float) -> tuple[Faces, _Border] | None:
    """One ring of faces less at both borders, or at one; None where that changes the topology or
    a border gets longer than the limit."""
    for sides in ((0, 1), (0,), (1,)):
        at = border.edges[np.isin(border.label, sides)].ravel()
        wider = F[~np.isin(F, at).any(axis=1)]
        if not len(wider):
            continue
        after = _Border.of(wider)
        if after.euler == border.euler and after.is_two_loops and after.longest(V) <= limit:
            return wider, after
    return None


def _opened(V: Points, F: Faces, loop: NDArray[np.int32]) -> tuple[Points, Faces]:
    """Without a band along a simple loop: every edge that leaves the loop is cut near to it.

    The band is the regular neighborhood of the loop, an annulus whatever the mesh is like, also
    where an edge that is not of the loop joins two of its vertices (it is cut twice).
    """
    n = len(V)
    on_loop = np.zeros(n, bool)
    on_loop[loop] = True
    following = np.full(n, -1)
    following[loop] = np.roll(loop, -1)

    faces = F[on_loop[F].any(axis=1)]
    tail, head = faces, np.roll(faces, -1, axis=1)
    along = (following[tail] == head) | (following[head] == tail)
    # Going round a face, two places per corner: a corner on the loop gives way to a point on the
    # edge before it and one on the edge after it, where these are cut; any other corner stays.
    cut_after = on_loop[tail] & ~along
    cut_before = on_loop[tail] & ~np.roll(along, 1, axis=1)
    before = np.roll(faces, 1, axis=1)
    keys = np.stack(
        [
            np.where(cut_before, tail * np.int64(n) + before, -1),
            np.where(cut_after, tail * np.int64(n) + head, -1),
        ],
        axis=2,
    )
    made, ids = np.unique(keys, return_inverse=True)
    ids = ids.reshape(keys.shape) + n - int(made[0] == -1)
    places = np.where(keys >= 0, ids, -1)
    places[:, :, 0] = np.where(on_loop[tail], places[:, :, 0], tail)
    corners = places.reshape(-1, 6)

    made = made[made >= 0]
    near, far = made // n, made % n
    points = np.vstack([V, (1.0 - _BAND) * V[near] + _BAND * V[far]])
    kept = F[~on_loop[F].any(axis=1)]
    return points, np.vstack([kept, _fan_triangles(corners)]).astype(np.int32)


def _fan_triangles(polygons: NDArray[Any]) -> Faces:
    """Triangles of polygons given as rows with -1 in the places that are empty."""
    order = np.argsort(polygons < 0, axis=1, kind="stable")
    packed = np.take_along_axis(polygons, order, axis=1)
    size = (polygons >= 0).sum(axis=1)
    triangles = [packed[size > k + 1][:, [0, k, k + 1]] for k in range(1, polygons.shape[1] - 1)]
    return np.vstack(triangles).astype(np.int32)


@dataclass(frozen=True, eq=False)
class _Border:
    """The border of an open surface."""

    edges: NDArray[np.int32]
    vertices: NDArray[np.int32]
    label: NDArray[np.int32]  # of each edge: the loop it belongs to
    euler: int

    @classmethod
    def of(cls, F: Faces) -> _Border:
        tail, head = F.ravel().astype(np.int64), np.roll(F, -1, axis=1).ravel().astype(np.int64)
        n = int(F.max()) + 1
        key = np.minimum(tail, head) * n + np.maximum(tail, head)
        _, first, count = np.unique(key, return_index=True, return_counts=True)
        alone = first[count == 1]
        edges = np.stack([tail[alone], head[alone]], axis=1).astype(np.int32)
        vertices, local = np.unique(edges, return_inverse=True)
        local = local.reshape(-1, 2)
        label = labels(len(vertices), local[:, 0], local[:, 1])[local[:, 0]]
        euler = len(np.unique(F)) - len(count) + len(F)
        return cls(edges, vertices, label, euler)

    @property
    def is_two_loops(self) -> bool:
        """Whether it is two simple loops."""
        return len(self.vertices) == len(self.edges) and len(np.unique(self.label)) == 2

    def longest(self, V: Points) -> float:
        """Length of the longest loop."""
        steps = np.linalg.norm(V[self.edges[:, 0]] - V[self.edges[:, 1]], axis=1)
        return float(np.bincount(self.label, steps).max())


def _is_simple_loop(F: Faces, loop: NDArray[np.int32]) -> bool:
    """Whether a loop meets itself nowhere and all its edges are still there."""
    if len(np.unique(loop)) < len(loop):
        return False
    n = np.int64(F.max()) + 1
    there = F.astype(np.int64) * n + np.roll(F, -1, axis=1)
    return bool(np.isin(loop.astype(np.int64) * n + np.roll(loop, -1), there).all())
