"""Partition of a solid into parts of prescribed volume, section 7.2.

Level surfaces of the solid-torus coordinates are pulled back to the source by cutting every tet
they cross. On a tet the level function is linear:

- ``u``: the half-plane at angle u through the axis, exact in the image;
- ``v``: with A the piecewise-linear interpolant of ``hypot(x, y) - R``, the half-sheet where (A, z)
  has the angle v; all sheets meet in the core A = z = 0;
- ``s``: the interpolant of ``(s / r)^2``, which on the standard solid torus is the share of the
  volume inside.

The levels that divide the *image* as asked are found first. What the parts of the source then lack
or have too much is the volume distortion of the map, reported as the uncorrected errors; they
correspond to Table 7.1. One-dimensional root finding then moves each level until the source is
divided as asked.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from . import _core
from ._arrays import read_only
from .errors import ArrayError, OptionError, SolverError
from .mesh import TetMesh, TriMesh
from .results import plain, table
from .torus import TWO_PI, Torus

if TYPE_CHECKING:
    from .results import MapResult

__all__ = ["Partition", "partition"]

_NO_GATE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Partition:
    """A solid cut into parts.

    Attributes
    ----------
    by : tuple of str
        Coordinates the levels belong to.
    fractions : ndarray, shape (p,)
        Share of the volume asked for each part.
    solid : TetMesh
        The source, cut; its first vertices are those of the source. Parts meet in whole faces.
    image : ndarray, shape (n, 3)
        Images of its vertices.
    labels : ndarray of int32, shape (k,)
        Part of each tet.
    parent_tet : ndarray of int32, shape (k,)
        Tet of the source each tet was cut from.
    levels : tuple of ndarray
        Per coordinate the levels of the cuts: angles in radians from ``start`` on, or values of
        ``(s / r)^2``.
    uncorrected_levels : tuple of ndarray
        The levels that divide the image exactly.
    volumes : ndarray, shape (p,)
    errors : ndarray, shape (p,)
        ``volume / (fraction total) - 1``.
    uncorrected_errors : ndarray, shape (p,)
        The same for the uncorrected levels.
    cumulative_errors : ndarray, shape (p - 1,)
        Uncorrected errors of the unions of the first 1, 2, ... parts, as in Table 7.1; empty for
        several coordinates.
    """

    by: tuple[str, ...]
    fractions: NDArray[np.float64]
    solid: TetMesh
    image: NDArray[np.float64]
    labels: NDArray[np.int32]
    parent_tet: NDArray[np.int32]
    levels: tuple[NDArray[np.float64], ...]
    uncorrected_levels: tuple[NDArray[np.float64], ...]
    volumes: NDArray[np.float64]
    errors: NDArray[np.float64]
    uncorrected_errors: NDArray[np.float64]
    cumulative_errors: NDArray[np.float64]

    @property
    def n_parts(self) -> int:
        """Number of parts."""
        return len(self.fractions)

    def part(self, i: int) -> TetMesh:
        """Part i as a mesh of its own.

        Raises
        ------
        OptionError
            If there is no such part.
        """
        return TetMesh(self.solid.V, self.solid.T[self._tets(i)]).compact()[0]

    def surface(self, i: int) -> TriMesh:
        """Closed boundary of part i, faces outward; raises as `part`."""
        return self.part(i).surface

    def interface(self, i: int, j: int) -> TriMesh:
        """Faces that parts i and j share, looking out of part i; raises as `part`."""
        first, second = (self._faces(p) for p in (i, j))
        keys = [
            np.sort(f, axis=1) @ (self.solid.n_vertices ** np.arange(3)) for f in (first, second)
        ]
        shared = np.isin(keys[0], keys[1])
        if not shared.any():
            return TriMesh(self.solid.V, np.zeros((0, 3), np.int32))
        return TriMesh(self.solid.V, first[shared]).compact()[0]

    def _tets(self, i: int) -> NDArray[np.bool_]:
        if not 0 <= i < self.n_parts:
            raise OptionError(f"there are parts 0 to {self.n_parts - 1}, not {i}")
        return self.labels == i

    def _faces(self, i: int) -> NDArray[np.int64]:
        tets = np.ascontiguousarray(self.solid.T[self._tets(i)])
        boundary = _core.TetBoundary(tets, self.solid.n_vertices)
        return boundary.vertices[boundary.faces].astype(np.int64)

    def to_dict(self) -> dict[str, Any]:
        """Everything scalar, JSON-compatible."""
        names = ("by", "fractions", "levels", "volumes", "errors", "uncorrected_errors",
                 "cumulative_errors")  # fmt: skip
        return plain({name: getattr(self, name) for name in names})

    def summary(self) -> str:
        """A table of the parts."""
        rows: dict[str, Any] = {
            "parts": f"{self.n_parts} by {', '.join(self.by)}",
            "volume": self.solid.volume,
            "largest uncorrected error": float(np.abs(self.uncorrected_errors).max()),
            "largest error": float(np.abs(self.errors).max()),
        }
        for i in range(self.n_parts):
            rows[f"part {i}"] = (
                f"{self.volumes[i]:.6g}  uncorrected {100 * self.uncorrected_errors[i]:+.4f} %"
            )
        return table(rows)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the cut mesh, with cell data ``part`` and ``parent_tet`` and point data ``image``.

        Raises
        ------
        FileFormatError
            If the suffix is unknown or the format cannot hold a tet mesh with data.
        OSError
            If the file cannot be written.
        """
        from . import io

        io.write(
            path,
            self.solid,
            point_data={"image": self.image},
            cell_data={"part": self.labels, "parent_tet": self.parent_tet},
        )


def partition(
    result: MapResult,
    fractions: int | Sequence[float] | tuple[int | Sequence[float], ...] = 5,
    by: str | tuple[str, ...] = "s",
    *,
    start: float = 0.0,
    correct: bool = True,
) -> Partition:
    """Divide a mapped solid into parts of prescribed volume.

    Parameters
    ----------
    result : VolumeMap or LoadedMap
        Map of a solid onto the solid torus.
    fractions : int or sequence of float
        Number of equal parts, or the share of each, summing to 1. With several coordinates a tuple,
        one entry each.
    by : {"s", "u", "v"} or tuple of them
        Nested shells, sectors the long way round, sectors around the tube. Several make a grid; its
        parts are numbered with the last coordinate running fastest. Only the shares along each
        coordinate are then corrected, those of the cells keep the distortion of the map.
    start : float
        Angle in radians at which the first sector of ``u`` or ``v`` begins.
    correct : bool
        Move the levels until the source is divided exactly. False: cut at the uncorrected levels.

    Returns
    -------
    Partition

    Raises
    ------
    OptionError
        If an option is out of range or the map has no torus.
    ArrayError
        If the map is that of a surface.
    SolverError
        If the image has no volume to be divided.
    """
    axes = (by,) if isinstance(by, str) else tuple(by)
    wanted = (fractions,) if isinstance(by, str) else tuple(fractions)  # type: ignore[arg-type]
    if not axes or len(set(axes)) != len(axes) or any(axis not in ("s", "u", "v") for axis in axes):
        raise OptionError(f"by must name each of 's', 'u', 'v' at most once, got {by!r}")
    if len(wanted) != len(axes):
        raise OptionError(f"{len(axes)} coordinates need as many fractions, got {len(wanted)}")
    if not math.isfinite(start):
        raise OptionError(f"start must be finite, got {start}")
    shares = [_shares(entry) for entry in wanted]
    if not hasattr(result.mesh, "T"):
        raise ArrayError("only the map of a solid can be partitioned, this is that of a surface")
    if result.torus is None:
        raise OptionError("the map has no torus, so there are no coordinates on it")

    pieces = _Pieces.of(result.mesh, result.image, result.torus)
    uncorrected = [_levels(pieces, a, p, start, "image") for a, p in zip(axes, shares, strict=True)]
    levels = uncorrected
    if correct:
        levels = [_levels(pieces, a, p, start, "source") for a, p in zip(axes, shares, strict=True)]
    raw = _volumes(*_cut_all(pieces, axes, uncorrected), shares)
    cut, labels = _cut_all(pieces, axes, levels)
    solid = TetMesh(cut.points[:, :3], cut.T)
    asked = np.ones(1)
    for share in shares:
        asked = np.multiply.outer(asked, share).ravel()
    volumes = np.bincount(labels, solid.tet_volumes, minlength=len(asked))
    total = result.mesh.volume
    running = np.cumsum(asked)[:-1]
    return Partition(
        by=axes,
        fractions=read_only(asked),
        solid=solid,
        image=read_only(np.ascontiguousarray(cut.points[:, 3:6])),
        labels=read_only(labels),
        parent_tet=read_only(cut.parent),
        levels=tuple(levels),
        uncorrected_levels=tuple(uncorrected),
        volumes=read_only(volumes),
        errors=read_only(volumes / (asked * total) - 1.0),
        uncorrected_errors=read_only(raw / (asked * total) - 1.0),
        cumulative_errors=read_only(
            np.cumsum(raw)[:-1] / (running * total) - 1.0 if len(axes) == 1 else np.zeros(0)
        ),
    )


def _shares(fractions: int | Sequence[float]) -> NDArray[np.float64]:
    if isinstance(fractions, (int, np.integer)):
        if fractions < 2:
            raise OptionError(f"a partition has at least two parts, got {fractions}")
        return np.full(fractions, 1.0 / fractions)
    shares = np.asarray(fractions, float)
    if shares.ndim != 1 or len(shares) < 2:
        raise OptionError("fractions must be a number of parts or one share for each of them")
    if not (np.isfinite(shares).all() and (shares > 0.0).all() and abs(shares.sum() - 1.0) < 1e-9):
        raise OptionError(f"fractions must be positive and sum to 1, got {shares.tolist()}")
    return shares / shares.sum()


@dataclass(frozen=True)
class _Pieces:
    """A tet mesh being cut. Columns of ``points``: source, image, hypot(x, y) - R, (s / r)^2."""

    points: NDArray[np.float64]
    T: NDArray[np.int32]
    parent: NDArray[np.int32]
    side: NDArray[np.int32]  # (k,) of the last cut

    @classmethod
    def of(cls, mesh: TetMesh, image: NDArray[np.float64], torus: Torus) -> _Pieces:
        radial = np.hypot(image[:, 0], image[:, 1]) - torus.R
        share = (radial**2 + image[:, 2] ** 2) / torus.r**2
        k = len(mesh.T)
        return cls(
            points=np.column_stack([mesh.V, image, radial, share]),
            T=mesh.T,
            parent=np.arange(k, dtype=np.int32),
            side=np.zeros(k, np.int32),
        )

    def volumes(self, of: str) -> NDArray[np.float64]:
        columns = slice(0, 3) if of == "source" else slice(3, 6)
        return _core.tet_volumes(np.ascontiguousarray(self.points[:, columns]), self.T)

    def cut(self, values: NDArray[np.float64], gate: NDArray[np.float64] = _NO_GATE) -> _Pieces:
        split = _core.split_tets(self.T, np.ascontiguousarray(values), np.ascontiguousarray(gate))
        first, second = (self.points[split.cut_edges[:, k]] for k in (0, 1))
        added = first + split.cut_weight[:, None] * (second - first)
        return _Pieces(
            points=np.concatenate([self.points, added]),
            T=split.tets,
            parent=self.parent[split.parent],
            side=split.side,
        )

    def sheet(self, axis: str, angle: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Function that vanishes on the sheet at an angle and on its continuation, and its gate."""
        a, b = self.points[:, [3, 4] if axis == "u" else [6, 5]].T
        c, s = math.cos(angle), math.sin(angle)
        return b * c - a * s, a * c + b * s


def _levels(
    pieces: _Pieces, axis: str, shares: NDArray[np.float64], start: float, of: str
) -> NDArray[np.float64]:
    """Levels that divide source or image as asked: p - 1 for s, p angles for u and v."""
    if axis == "s":
        volumes = pieces.volumes(of)
        values = pieces.points[:, 7]

        def below(level: float) -> float:
            return _core.volume_below(pieces.T, volumes, values - level)

        ends = (float(values.min()), float(values.max()))
    else:
        below = _sector_volume(pieces, axis, start, of)
        volumes = pieces.volumes(of)
        ends = (start, start + TWO_PI)
    total = float(volumes.sum())
    found = [_root(below, share * total, ends) for share in np.cumsum(shares)[:-1]]
    return np.array(found if axis == "s" else [start, *found])


def _sector_volume(pieces: _Pieces, axis: str, start: float, of: str) -> Callable[[float], float]:
    """Volume from the angle ``start`` up to another."""
    halves = pieces.cut(pieces.sheet(axis, start)[0])
    volumes = halves.volumes(of)
    ahead = halves.side > 0
    parts = [(np.ascontiguousarray(halves.T[m]), volumes[m]) for m in (ahead, ~ahead)]
    first = float(parts[0][1].sum())

    def below(angle: float) -> float:
        values = np.ascontiguousarray(halves.sheet(axis, angle)[0])
        if angle - start <= math.pi:
            return _core.volume_below(*parts[0], values)
        return first + _core.volume_below(*parts[1], values)

    return below


def _root(below: Callable[[float], float], target: float, ends: tuple[float, float]) -> float:
    def excess(level: float) -> float:
        return below(level) - target

    if not excess(ends[0]) <= 0.0 <= excess(ends[1]):
        raise SolverError("no level divides the image as asked; is the map certified?")
    return float(brentq(excess, *ends, xtol=1e-15, rtol=4 * np.finfo(float).eps))


def _cut_all(
    pieces: _Pieces, axes: tuple[str, ...], levels: list[NDArray[np.float64]]
) -> tuple[_Pieces, NDArray[np.int32]]:
    """Cut along every level; the pieces and the part of each."""
    for axis, cuts in zip(axes, levels, strict=True):
        for level in cuts:
            if axis == "s":
                pieces = pieces.cut(pieces.points[:, 7] - level)
            else:
                sheet, gate = pieces.sheet(axis, level)
                pieces = pieces.cut(sheet, gate if axis == "u" else _NO_GATE)
    # Every function is linear on a piece and has one sign in it, so its centroid tells the part.
    centre = 0.25 * sum(pieces.points[corner] for corner in pieces.T.T)
    labels = np.zeros(len(pieces.T), np.intp)
    for axis, cuts in zip(axes, levels, strict=True):
        if axis == "s":
            labels = labels * (len(cuts) + 1) + np.searchsorted(cuts, centre[:, 7])
            continue
        a, b = centre[:, [3, 4] if axis == "u" else [6, 5]].T
        turned = (np.arctan2(b, a) - cuts[0]) % TWO_PI
        labels = labels * len(cuts) + np.searchsorted(cuts[1:] - cuts[0], turned)
    return pieces, labels.astype(np.int32)


def _volumes(
    pieces: _Pieces, labels: NDArray[np.int32], shares: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    count = math.prod(len(share) for share in shares)
    return np.bincount(labels, pieces.volumes("source"), minlength=count)
