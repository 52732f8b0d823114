"""Long, thin limbs spread out in the flat chart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import breadth_first_order, connected_components, dijkstra
from scipy.sparse.linalg import splu

from .. import _core
from ..base.torus import TWO_PI

if TYPE_CHECKING:
    from ..mesh.meshes import TriMesh

# Area ratios in the chart from which on faces are part of a limb, tried in turn: further out its
# rim is rounder, and a limb of a limb is alone; further in there is more room.
_SMALL = (1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12, 1e-16)
_SOUND = 0.0  # areas above it are neither folded nor lost
# What is left of the logarithm by which a limb shrinks, tried in turn: with less, chords of a ring
# reach into the next one.
_LEFT = (0.15, 0.22, 0.35, 0.5, 0.75, 1.0)
_REPAIRS = 3  # of folds, by means of neighbors
_FLAT = 3.14  # a wider angle is a fold's

_Floats = NDArray[np.float64]
_Ints = NDArray[np.intp]


def spread_limbs(
    surface: TriMesh,
    chart: _core.area.SurfaceChart,
    turns: _Floats,
    forms: _Floats,
    aspect: float,
    least: float,
    *,
    drawn: bool = False,
) -> _Floats:
    """Turns (n, 2) with limbs spread that hold lost faces, fewer than before, or as they were.

    A conformal map shrinks a limb by the factor e with every radius outward. Without its tip it is
    a cylinder, and on that one, in the logarithm of the distance from the tip and the angle round
    it, nothing shrinks: positive weights embed it there (Tutte), as short as one likes. Few faces
    that fold on the way back are unfolded by means of neighbors (Floater 1997).

    Parameters
    ----------
    surface : TriMesh
    chart : SurfaceChart
    turns : ndarray, shape (n, 2)
        Without folds but for those lost in rounding.
    forms : ndarray, shape (2, e)
    aspect : float
        Of the flat torus.
    least : float
        Area of a face in the chart that is not lost.
    drawn : bool
        Whether limbs with three edges round them are drawn instead, straight (Schnyder): behind
        such a neck sizes fall by a factor with every ring whatever the weights. All faces have room
        then, and that is all there is to be said for it.
    """
    areas = _core.area.turn_areas(chart, turns)
    lost, share = ~(areas > least), surface.face_areas / surface.face_areas.sum()
    best, fewest = turns, int(lost.sum())
    for small in _SMALL:
        other = turns.copy()
        for faces in _limbs(surface, ~(areas > small * share), lost):
            limb = _Limb.of(surface, faces, forms)
            if limb is None:
                continue
            at = _drawn(limb, turns) if drawn else None
            at = _spread(surface, limb, turns, aspect) if at is None else at
            if at is not None:
                other[limb.vertices] = at
        left = int((~(_core.area.turn_areas(chart, other) > least)).sum())
        if left < fewest:
            best, fewest = other, left
        if left == 0:
            break
    return best


def _limbs(surface: TriMesh, small: NDArray[np.bool_], lost: NDArray[np.bool_]) -> list[_Ints]:
    """Faces of each limb: what the small ones cut off the largest of the rest, if any is lost."""
    large = np.flatnonzero(~small)
    if not len(large):
        return []
    part = _parts(surface.topology.edge.reshape(-1, 3)[large], len(surface.edges))
    limb = np.delete(np.arange(len(surface.F)), large[part == np.bincount(part).argmax()])
    part = _parts(surface.F[limb], len(surface.V))
    return [limb[part == each] for each in np.unique(part[lost[limb]])]


def _parts(shared: NDArray[np.int32], n: int) -> NDArray[np.int32]:
    """(p,) number of the part each row is in; rows that name the same of n things are in one."""
    rows = np.repeat(np.arange(len(shared)), 3)
    links = (np.ones(len(rows)), (rows, len(shared) + shared.ravel()))
    graph = coo_matrix(links, (len(shared) + n,) * 2)
    part: NDArray[np.int32] = connected_components(graph, directed=False)[1][: len(shared)]
    return part


@dataclass(frozen=True, eq=False)
class _Limb:
    """A disk of faces, its vertices numbered anew.

    Attributes
    ----------
    vertices : ndarray, shape (q,)
    F : ndarray, shape (p, 3)
    edge : ndarray, shape (p, 3)
        Rows of ``ends``, from each corner of a face to the next one.
    ends : ndarray, shape (l, 2)
    at_rim : ndarray of bool, shape (l,)
    offsets : ndarray, shape (q, 2)
        Added to turns, they are one chart of all.
    """

    vertices: _Ints
    F: _Ints
    edge: _Ints
    ends: _Ints
    at_rim: NDArray[np.bool_]
    offsets: _Floats

    @classmethod
    def of(cls, surface: TriMesh, faces: _Ints, forms: _Floats) -> _Limb | None:
        """None if the faces are not a disk."""
        vertices = np.unique(surface.F[faces]).astype(np.intp)
        number = np.full(len(surface.V), -1, np.intp)
        number[vertices] = np.arange(len(vertices))
        edges, edge = np.unique(surface.topology.edge.reshape(-1, 3)[faces], return_inverse=True)
        at_rim = np.bincount(edge.ravel()) == 1
        rim = np.unique(surface.edges[edges[at_rim]])
        disk = len(vertices) - len(edges) + len(faces) == 1 and len(rim) == at_rim.sum()
        if not disk:
            return None
        ends = number[surface.edges[edges]]
        offsets = _summed(ends, forms[:, edges].T, len(vertices))
        return cls(vertices, number[surface.F[faces]], edge.reshape(-1, 3), ends, at_rim, offsets)

    def rim(self) -> tuple[_Ints, _Ints, _Ints, _Ints]:
        """Its edges as in their face: row, corner, first and second vertex."""
        face, corner = np.nonzero(self.at_rim[self.edge])
        return face, corner, self.F[face, corner], self.F[face, (corner + 1) % 3]

    def areas(self, z: NDArray[np.complex128]) -> _Floats:
        """(p,) twice the signed areas of the faces over squared distances from zero."""
        a, b, c = z[self.F].T
        size = np.maximum(np.abs(a), np.abs(b)) ** 2
        area: _Floats = np.imag(np.conj(b - a) * (c - a)) / np.maximum(size, 1e-300)
        return area


def _summed(ends: _Ints, steps: _Floats, n: int) -> _Floats:
    """(n, d) values that grow by the steps along the edges of a tree, zero at vertex 0."""
    graph = coo_matrix((np.ones(len(ends)), ends.T), (n, n)).tocsr()
    before = breadth_first_order(graph, 0, directed=False)[1].astype(np.intp)
    before[0] = 0
    sign = np.zeros((n, 1))
    which = np.zeros(n, np.intp)
    for way, (i, j) in ((1.0, ends.T), (-1.0, ends[:, ::-1].T)):
        of_tree = np.flatnonzero(before[j] == i)
        sign[j[of_tree]], which[j[of_tree]] = way, of_tree
    values: _Floats = sign * steps[which]
    while before.any():
        values = values + values[before]
        before = before[before]
    return values


def _drawn(limb: _Limb, turns: _Floats) -> _Floats | None:
    """Turns of a limb's vertices, None if not three of them are at its rim."""
    _, _, i, j = limb.rim()
    if len(i) != 3:
        return None
    corners = [i[0], j[0], j[i == j[0]][0]]
    shares = _core.area.straight_drawing(limb.F.astype(np.int32), len(limb.vertices), corners)
    at: _Floats = shares @ (turns[limb.vertices] + limb.offsets)[corners] - limb.offsets
    return at


def _spread(surface: TriMesh, limb: _Limb, turns: _Floats, aspect: float) -> _Floats | None:
    """Turns of a limb's vertices, None if it cannot be spread."""
    shape = np.array([aspect, 1.0])
    at = (turns[limb.vertices] + limb.offsets) * shape
    face, corner, i, j = limb.rim()
    center = at[i].mean(axis=0)
    z = (at - center) @ np.array([1.0, 1.0j])
    jump = np.flatnonzero(np.angle(z[j]) < np.angle(z[i]))
    if not (np.angle(z[j] * np.conj(z[i])) > 0.0).all() or len(jump) != 1:
        return None  # the rim does not run round the center
    tip = _tip(limb, surface.V[limb.vertices], i)
    ring = np.setdiff1d(limb.F[(limb.F == tip).any(axis=1)], tip)
    if np.isin(ring, i).any():
        return None
    last = int(face[jump[0]]), int(corner[jump[0]])
    with np.errstate(all="ignore"):  # what is lost in rounding is counted in the end
        spread = _on_cylinder(limb, z, i, ring, tip, last)
    if spread is None:
        return None
    flat = np.column_stack([spread.real, spread.imag]) + center
    places: _Floats = flat / shape - limb.offsets
    return places


def _tip(limb: _Limb, V: _Floats, rim: _Ints) -> int:
    """The vertex farthest from the rim."""
    n, (i, j) = len(V), limb.ends.T
    graph = coo_matrix((np.linalg.norm(V[i] - V[j], axis=1), (i, j)), (n, n))
    return int(dijkstra(graph, directed=False, indices=rim, min_only=True).argmax())


def _on_cylinder(
    limb: _Limb,
    z: NDArray[np.complex128],
    rim: _Ints,
    ring: _Ints,
    tip: int,
    last: tuple[int, int],
) -> NDArray[np.complex128] | None:
    """Places of the vertices round the tip at zero, as much shorter than conformal as folds none.

    ``last`` is the edge of the rim where its angle jumps, by face and corner; None if no vertex
    lies between rim and ring.
    """
    n = len(limb.vertices)
    body = (limb.ends != tip).all(axis=1)
    jumps = _jumps(limb, tip, last)[body]
    i, j = limb.ends[body].T
    graph = coo_matrix((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), (n, n)).tocsr()
    laplacian = (diags(np.asarray(graph.sum(axis=1)).ravel()) - graph).tocsr()
    inside = np.setdiff1d(np.arange(n), [*rim, tip])
    between = np.setdiff1d(inside, ring)
    if not len(between):
        return None
    turned = np.bincount(i, jumps, n) - np.bincount(j, jumps, n)
    angle = np.angle(z)
    angle[inside] = splu(laplacian[inside][:, inside].tocsc()).solve(
        turned[inside] - laplacian[inside][:, rim] @ angle[rim]
    )
    factors = splu(laplacian[between][:, between].tocsc())
    drop = np.zeros(n)
    drop[ring] = 1.0
    drop[between] = factors.solve(-(laplacian[between][:, ring] @ drop[ring]))
    length = TWO_PI / np.square(drop[i] - drop[j]).sum()  # of the cylinder, conformally
    height = np.zeros(n)
    height[rim] = np.log(np.abs(z[rim]))
    height[ring] = height[rim].mean()
    ends = np.r_[rim, ring]
    height[between] = factors.solve(-(laplacian[between][:, ends] @ height[ends]))
    best, fewest = None, len(limb.F)
    for left in _LEFT:
        spread = np.exp(height - left * length * drop + 1j * angle)
        spread[rim], spread[tip] = z[rim], 0.0
        spread = _unfolded(limb, spread, rim)
        bad = int((~(limb.areas(spread) > _SOUND)).sum())
        if bad < fewest:
            best, fewest = spread, bad
        if bad == 0:
            break
    return best


def _jumps(limb: _Limb, tip: int, last: tuple[int, int]) -> _Floats:
    """(l,) by how much the angle round the tip grows along edges, beside its values at the ends."""
    order = np.argsort(limb.edge.ravel(), kind="stable")
    sides = limb.edge.ravel()[order]
    twice = np.flatnonzero(sides[1:] == sides[:-1])
    left, right = order[twice] // 3, order[twice + 1] // 3
    graph = coo_matrix((np.ones(len(left)), (left, right)), (len(limb.F),) * 2)
    first = int(np.flatnonzero((limb.F == tip).any(axis=1))[0])
    before = breadth_first_order(graph.tocsr(), first, directed=False)[1]
    path = [last[0]]
    while path[-1] != first:
        path.append(int(before[path[-1]]))
    inner, outer = np.array(path[:0:-1], np.intp), np.array(path[-2::-1], np.intp)
    shared = (limb.edge[inner][:, :, None] == limb.edge[outer][:, None, :]).any(axis=2)
    face = np.append(inner, last[0])
    corner = np.append(shared.argmax(axis=1), last[1])
    edge = limb.edge[face, corner]
    jumps = np.zeros(len(limb.ends))
    np.add.at(jumps, edge, np.where(limb.ends[edge, 0] == limb.F[face, corner], TWO_PI, -TWO_PI))
    return jumps


def _unfolded(limb: _Limb, z: NDArray[np.complex128], rim: _Ints) -> NDArray[np.complex128]:
    """Every vertex at the mean of its neighbors by mean value coordinates where they are positive,
    which changes nothing there, and by distance where faces are folded."""
    n = len(z)
    inside = np.setdiff1d(np.arange(n), rim)
    at, after, before = (
        limb.F.ravel(),
        np.roll(limb.F, -1, 1).ravel(),
        np.roll(limb.F, 1, 1).ravel(),
    )
    for _ in range(_REPAIRS):
        one, other = z[after] - z[at], z[before] - z[at]
        if (limb.areas(z) > _SOUND).all() or (one == 0.0).any():
            break
        angle = np.angle(other / one)
        folded = np.bincount(at, ~((angle > 0.0) & (angle < _FLAT)), n) > 0.0
        folded |= ~(np.abs(np.bincount(at, angle, n) - TWO_PI) < 1e-6)
        half = np.where(folded[at], 1.0, np.tan(0.5 * angle))
        weights = np.r_[half / np.abs(one), half / np.abs(other)]
        means = csr_matrix((weights, (np.r_[at, at], np.r_[after, before])), (n, n))
        means = diags(1.0 / np.asarray(means.sum(axis=1)).ravel()) @ means
        matrix = (diags(np.ones(n)) - means).tocsr()[inside]
        try:
            factors = splu(matrix[:, inside].tocsc())
        except RuntimeError:  # sizes are lost in rounding
            break
        fixed = matrix[:, rim]
        z = z.copy()
        z[inside] = factors.solve(-(fixed @ z.real[rim])) + 1j * factors.solve(
            -(fixed @ z.imag[rim])
        )
    return z
