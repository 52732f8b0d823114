"""Structured hexahedral meshes of a solid through its map, and fields carried from solid to solid.

The section of the solid torus is an O-grid: a square block in the middle, rings round it. Swept
round the axis and pulled back to the source it is a mesh of hexahedra without irregular ends. A
hexahedron is right where the Jacobian at each of its eight corners is positive, that is, where the
tet of the corner and its three neighbours is. Where the piecewise-affine map leaves one that is
not, the same flip-free optimisation that makes maps is run on these corner tets with the boundary
held. At a sharp ridge no inner point may be right for all four boundary quads of a vertex; such
vertices, and only they, are then let go of the boundary. How far they moved is reported.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from . import _core
from ._arrays import read_only
from .errors import ArrayError, FileFormatError, MissingDependencyError, OptionError, SolverError
from .flip_free import FlipFreeOptions, FlipFreeSolver
from .results import atomic_path, plain, table
from .torus import TWO_PI, Torus

if TYPE_CHECKING:
    from .coordinates import PointMap
    from .registration import Registration
    from .results import LoadedMap, MapResult

__all__ = ["HexMesh", "hex_mesh", "transfer"]

# Corner of a hexahedron and the three corners joined to it, positively oriented.
_CORNERS = np.array(
    [[0, 1, 3, 4], [1, 2, 0, 5], [2, 3, 1, 6], [3, 0, 2, 7],
     [4, 7, 5, 0], [5, 4, 6, 1], [6, 5, 7, 2], [7, 6, 4, 3]]
)  # fmt: skip
_BISECTIONS = 40
_ROUNDS = 12  # of letting vertices go, then of drawing them back
_ADAPT = 3  # steps of the inner points between two draws
_HALVINGS = 40
_SQUARE = 0.5  # half diagonal of the middle block over the radius of the section


@dataclass(frozen=True, eq=False)
class HexMesh:
    """A structured hexahedral mesh of a solid.

    Attributes
    ----------
    V : ndarray, shape (n, 3)
        Points, in the source.
    H : ndarray of int32, shape (k, 8)
        Corners in the order of VTK: one face counter-clockwise, then the opposite one.
    grid : ndarray, shape (n, 3)
        The points of the standard grid in the solid torus they came from.
    coordinates : ndarray, shape (n, 3)
        Their (u, v, s).
    jacobians : ndarray, shape (k, 8)
        Jacobian at every corner over the product of the three edge lengths, at most 1.
    n_pulled_back_negative : int
        Hexahedra with a corner that is not positive before the repair.
    rim_moved : float
        How far the repair moved a boundary point at most, as a share of the diagonal of the box;
        zero if all stayed on the surface.
    volume : float
    """

    V: NDArray[np.float64]
    H: NDArray[np.int32]
    grid: NDArray[np.float64]
    coordinates: NDArray[np.float64]
    jacobians: NDArray[np.float64]
    n_pulled_back_negative: int
    rim_moved: float
    volume: float

    @property
    def n_negative(self) -> int:
        """Hexahedra with a corner that is not positive."""
        return int((~(self.jacobians > 0.0)).any(axis=1).sum())

    def to_dict(self) -> dict[str, Any]:
        """The figures, JSON-compatible."""
        return plain(
            {
                "n_points": len(self.V),
                "n_hexahedra": len(self.H),
                "n_negative": self.n_negative,
                "n_pulled_back_negative": self.n_pulled_back_negative,
                "rim_moved": self.rim_moved,
                "jacobian_min": self.jacobians.min(),
                "jacobian_mean": self.jacobians.mean(),
                "volume": self.volume,
            }
        )

    def summary(self) -> str:
        """A table of the figures."""
        return table(self.to_dict())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the mesh as ``.vtu`` or ``.vtk``, with the coordinates and the least Jacobians.

        Raises
        ------
        FileFormatError
            Another suffix.
        MissingDependencyError
            meshio is not installed.
        OSError
            If the file cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() not in (".vtu", ".vtk"):
            raise FileFormatError(f"{path}: hexahedra are written as .vtu or .vtk")
        try:
            import meshio
        except ImportError:
            raise MissingDependencyError(
                "writing hexahedra needs meshio: pip install 'stretchmap[io]'"
            ) from None
        mesh = meshio.Mesh(
            self.V,
            [("hexahedron", self.H)],
            point_data={"coordinates": self.coordinates, "grid": self.grid},
            cell_data={"jacobian": [self.jacobians.min(axis=1)]},
        )
        with atomic_path(path) as temporary:
            meshio.write(temporary, mesh)


def hex_mesh(
    result: MapResult,
    *,
    sections: int = 64,
    block: int = 4,
    rings: int = 4,
    repair: bool = True,
) -> HexMesh:
    """Pull a structured grid of the solid torus back to the source.

    The outermost points lie where the ray from the core through them leaves the image, so that they
    come to lie on the boundary of the source.

    Parameters
    ----------
    result : VolumeMap or LoadedMap
        Certified map of a solid onto the solid torus.
    sections : int
        Hexahedra round the axis, at least 3.
    block : int
        Hexahedra along a side of the middle block.
    rings : int
        Layers of hexahedra between block and boundary.
    repair : bool
        Make all corner Jacobians positive where the pulled-back grid leaves some that are not.

    Returns
    -------
    HexMesh

    Raises
    ------
    OptionError
        If a number is too small or the map has no torus.
    ArrayError
        If the map is that of a surface.
    SolverError
        If the core of the torus lies outside the image, or the repair fails.
    """
    if sections < 3 or block < 1 or rings < 1:
        raise OptionError(
            f"a grid needs sections >= 3, block >= 1, rings >= 1, got {sections}, {block}, {rings}"
        )
    if result.torus is None:
        raise OptionError("the map has no torus to lay a grid in")
    points = result.point_map
    disk, quads, outer = _o_grid(block, rings)
    n = len(disk)
    u = np.repeat(np.arange(sections) * TWO_PI / sections, n)
    v = np.tile(np.arctan2(disk[:, 1], disk[:, 0]), sections)
    share = np.tile(np.hypot(disk[:, 0], disk[:, 1]), sections)
    here, there = (n * np.arange(sections)[:, None, None], None)
    there = n * ((np.arange(sections) + 1) % sections)[:, None, None]
    H = np.concatenate([quads[None] + here, quads[None] + there], axis=2).reshape(-1, 8)
    reach = _reach(points, result.torus, u, v)
    ids = (n * np.arange(sections)[:, None] + outer).ravel()
    grid = result.torus.xi(u, v, share * reach)
    located = points.inverse(grid)
    lost = np.flatnonzero(~located.inside)
    if len(lost):
        raise SolverError(f"{len(lost)} points of the grid lie outside the image", lost)
    V = pulled = located.points
    H = H.astype(np.int32)
    if _core.tet_volumes(np.ascontiguousarray(grid), _corner_tets(H)).sum() < 0.0:
        H = H[:, [0, 3, 2, 1, 4, 7, 6, 5]]
    bad = int((~(_jacobians(V, H) > 0.0)).any(axis=1).sum())
    if bad and repair:
        V = _repaired(grid, V, H, ids.astype(np.int32), result.torus)
    return HexMesh(
        V=read_only(V),
        H=read_only(np.ascontiguousarray(H)),
        grid=read_only(grid),
        coordinates=read_only(np.stack(result.torus.coordinates(grid), axis=-1)),
        jacobians=read_only(_jacobians(V, H)),
        n_pulled_back_negative=bad,
        rim_moved=float(np.linalg.norm((V - pulled)[ids], axis=1).max())
        / float(np.linalg.norm(np.ptp(pulled, axis=0))),
        volume=float(_hex_volumes(V, H).sum()),
    )


def _o_grid(
    block: int, rings: int
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Points of the unit disk (n, 2), quads (q, 4), and the points on the rim."""
    side = np.linspace(-1.0, 1.0, block + 1)
    x, y = (a.ravel() for a in np.meshgrid(side, side, indexing="ij"))
    # The square bulges half-way towards its circumscribed circle.
    radius = np.maximum(np.abs(x), np.abs(y))
    round_off = radius * np.sqrt(2.0) / np.maximum(np.hypot(x, y), 1e-300)
    square = np.stack([x, y], axis=1) * (0.5 + 0.5 * round_off)[:, None] * _SQUARE / np.sqrt(2.0)
    index = np.arange((block + 1) ** 2).reshape(block + 1, block + 1)
    inner = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    start = square[rim]
    angle = np.arctan2(start[:, 1], start[:, 0])
    end = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    t = np.arange(1, rings + 1)[:, None, None] / rings
    around = ((1.0 - t) * start + t * end).reshape(-1, 2)
    layers = np.concatenate(
        [rim[None], len(square) + np.arange(rings * len(rim)).reshape(rings, -1)]
    )
    low, high = layers[:-1], layers[1:]
    outer_quads = np.stack(
        [low, high, np.roll(high, -1, axis=1), np.roll(low, -1, axis=1)], axis=-1
    )
    quads = np.concatenate([inner.reshape(-1, 4), outer_quads.reshape(-1, 4)])
    return np.concatenate([square, around]), quads, layers[-1]


def _reach(
    points: PointMap, torus: Torus, u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest s, up to r, for which xi(u, v, s) lies in the image; by bisection."""
    low, high = np.zeros(len(u)), np.full(len(u), torus.r)
    if not points.inverse(torus.xi(u, v, low)).inside.all():
        raise SolverError("the core of the torus lies outside the image; is the map certified?")
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        inside = points.inverse(torus.xi(u, v, middle)).inside
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


def _corner_tets(H: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.ascontiguousarray(H[:, _CORNERS].reshape(-1, 4))


def _jacobians(V: NDArray[np.float64], H: NDArray[np.int32]) -> NDArray[np.float64]:
    """(k, 8) Jacobians at the corners over the product of the lengths of the edges there."""
    corners = V[H[:, _CORNERS]]
    edges = corners[:, :, 1:] - corners[:, :, :1]
    lengths = np.linalg.norm(edges, axis=-1).prod(axis=-1)
    return np.linalg.det(edges) / np.maximum(lengths, 1e-300)


def _hex_volumes(V: NDArray[np.float64], H: NDArray[np.int32]) -> NDArray[np.float64]:
    """Volumes of the trilinear hexahedra, by Gauss quadrature that is exact for them."""
    signs = np.array(
        [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
         [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
    )  # fmt: skip
    total = np.zeros(len(H))
    for node in signs / np.sqrt(3.0):
        factors = 1.0 + signs * node
        slopes = (
            np.stack(
                [signs[:, a] * factors[:, (a + 1) % 3] * factors[:, (a + 2) % 3] for a in range(3)]
            )
            / 8.0
        )
        total += np.linalg.det(np.einsum("ac,kcx->kax", slopes, V[H]))
    return total


def _repaired(
    grid: NDArray[np.float64],
    V: NDArray[np.float64],
    H: NDArray[np.int32],
    boundary: NDArray[np.int32],
    torus: Torus,
) -> NDArray[np.float64]:
    """Points with all corner tets positive, the boundary held but where no inner point can do."""
    T = _corner_tets(H)
    sizes = [_hex_volumes(p, H).sum() ** (1.0 / 3.0) for p in (grid, V)]
    centre = V.mean(axis=0)
    goal = np.ascontiguousarray((V - centre) / sizes[1])

    def solver(held: NDArray[np.int32]) -> FlipFreeSolver:
        return FlipFreeSolver(
            V=np.ascontiguousarray(grid / sizes[0]), T=T, boundary=held,
            faces=np.zeros((0, 3), np.int32), R=torus.R, r=torus.r,
            options=FlipFreeOptions(frozen_iter=_ADAPT),
        )  # fmt: skip

    x, held = goal, boundary
    for _ in range(_ROUNDS):
        x, flips = solver(held).untangle(x, glide=False)
        if not flips:
            break
        held = np.setdiff1d(held, T[~(_core.signed_tet_volumes(x, T) > 0.0)])
    else:
        raise SolverError(
            f"{flips} corners of hexahedra could not be made positive; a finer grid may help"
        )
    loose = np.setdiff1d(boundary, held)
    if len(loose):
        inner = solver(boundary)
        for _ in range(_ROUNDS):
            x = _drawn(x, goal, loose, T)
            x, _, _ = inner.minimise(x, glide=False, start=1.0, goal=1.0)
    out = x * sizes[1] + centre
    out[held] = V[held]
    return out


def _drawn(
    x: NDArray[np.float64], goal: NDArray[np.float64], ids: NDArray[np.int32], T: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Each of some points moved to its goal as far as the tets at it stay positive.

    One share of the way for all of them, then halved for those at a tet that would turn over.
    """
    floor = 1e-2 * np.abs(_core.signed_tet_volumes(x, T))
    share = np.zeros(len(x))
    share[ids] = 1.0
    for _ in range(_HALVINGS):
        moved = x + share[:, None] * (goal - x)
        bad = T[~(_core.signed_tet_volumes(moved, T) > floor)]
        if not len(bad):
            return moved
        share[bad.ravel()] *= 0.5
    return x


def transfer(
    registration: Registration | LoadedMap,
    values: ArrayLike,
    *,
    conserve: str = "integral",
    per: str = "vertex",
) -> NDArray[np.float64]:
    """Carry a scalar field from the source to the target of a registration.

    Every target tet gets the mean of the field over it, by a four-point rule of the pulled-back
    field; a point in the thin space between the image's and the target's boundary takes the value
    of the nearest image vertex. The rule does not see the kinks of the field, so that the sum comes
    out right only nearly; one factor for all tets then makes it exact.

    Parameters
    ----------
    registration : Registration or LoadedMap
    values : array_like, shape (n,) or (k,)
        At the vertices of ``registration.solid`` or in its tets, see ``per``.
    conserve : {"integral", "mean"}
        What agrees exactly: the integral over the solid (for a density), or its mean. They differ
        if the volumes do.
    per : {"vertex", "tet"}

    Returns
    -------
    ndarray, shape (target.n_tets,)

    Raises
    ------
    ArrayError
        If ``values`` has the wrong shape.
    OptionError
        If an option is unknown, the map is no registration, or the sum is zero while the carried
        field's is not, so that no factor exists.
    """
    solid, target = registration.solid, getattr(registration, "target", None)
    if solid is None or target is None:
        raise OptionError("a field is carried by a registration; this map has no target solid")
    if conserve not in ("integral", "mean") or per not in ("vertex", "tet"):
        raise OptionError(f"conserve is integral or mean, per is vertex or tet: {conserve}, {per}")
    field = np.asarray(values, float)
    count = solid.n_vertices if per == "vertex" else solid.n_tets
    if field.shape != (count,):
        raise ArrayError(f"values must have shape ({count},), got {field.shape}")
    weight = (5.0 - np.sqrt(5.0)) / 20.0
    rule = np.full((4, 4), weight) + (1.0 - 4.0 * weight) * np.eye(4)
    samples = np.einsum("qc,tcx->tqx", rule, target.V[target.T]).reshape(-1, 3)
    found = registration.point_map.inverse(samples)
    if per == "vertex":
        carried = found.interpolate(solid.T, field)
        sites, at_sites = registration.image, field
        total = float((solid.tet_volumes * field[solid.T].mean(axis=1)).sum())
    else:
        carried = field[found.tets]
        sites, at_sites = registration.image[solid.T].mean(axis=1), field
        total = float((solid.tet_volumes * field).sum())
    outside = ~found.inside
    if outside.any():
        carried[outside] = at_sites[cKDTree(sites).query(samples[outside])[1]]
    means = carried.reshape(-1, 4).mean(axis=1)
    if conserve == "mean":
        total *= target.volume / solid.volume
    have = float((target.tet_volumes * means).sum())
    if have == total:
        return means
    if have == 0.0 or total == 0.0:
        raise OptionError("the field sums to zero: no factor conserves its sum; add a constant")
    return means * (total / have)
