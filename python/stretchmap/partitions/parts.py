"""Partition of a solid into parts of prescribed volume, section 7.2.

Level surfaces of the solid-torus coordinates are pulled back to the source by cutting every tet
along all levels that cross it at once, into slabs. On a tet the level function is linear:

- ``u``: the half-plane at angle u through the axis, exact in the image;
- ``v``: with A the piecewise-linear interpolant of ``hypot(x, y) - R``, the half-sheet where (A, z)
  has the angle v; all sheets meet in the core A = z = 0;
- ``s``: the interpolant of ``(s / r)^2``, which on the standard solid torus is the share of the
  volume inside.

The levels that divide the *image* as asked are found first. What the parts of the source then lack
or have too much is the volume distortion of the map, reported as the uncorrected errors; they
correspond to Table 7.1. One-dimensional root finding then moves each level until the source is
divided as asked: those of the first coordinate divide the whole, those of the second each part of
the first by itself, and so on, so that every cell of a grid has the volume asked for.

A surface that passes a vertex within a small share of an edge goes through the vertex instead, so
that no tet is thin for its sake. Points where it cuts other edges move along them, about as little,
until what lies below has its volume again. Where it goes through all vertices near it there are no
such points, and a few vertices are passed by at a tenth of an edge.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import read_only
from ..base.options import flag, real, whole
from ..base.tables import HasSummary, plain_dict, table
from ..base.torus import MOST_ANGLE
from ..errors import OptionError, SolverError
from ..maps.given import as_map_of_solid, require_unfolded, torus_of
from ..maps.result import MapResult
from ..mesh.exchange import Cells, Exchanged
from ..mesh.meshes import TetMesh, TriMesh
from .core import with_core
from .levels import Coordinate, Levels, asked_shares, cut_nested, levels_of
from .pieces import Pieces, volumes_of_parts

__all__ = ["Coordinate", "Partition", "partition"]

_TOLERANCE = 1e-12  # relative error of a part's volume


@dataclass(frozen=True, eq=False)
class Partition(HasSummary, Exchanged):
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
        ``(s / r)^2``. Corrected levels of the second coordinate differ between the parts of the
        first: shape (parts, cuts), and so on.
    uncorrected_levels : tuple of ndarray
        The levels that divide the image along each coordinate exactly, one array each.
    volumes : ndarray, shape (p,)
    errors : ndarray, shape (p,)
        ``volume / (fraction total) - 1``.
    uncorrected_errors : ndarray, shape (p,)
        The same for the uncorrected levels.
    cumulative_errors : ndarray, shape (p - 1,)
        Uncorrected errors of the unions of the first 1, 2, ... parts, as in Table 7.1; empty for
        several coordinates.

    Examples
    --------
    >>> import stretchmap as sm
    >>> parts = sm.partition(sm.volume_map(sm.samples.solid_torus(600)), 3, by="u")
    >>> parts.part(0).surface.genus, parts.interface(0, 1).n_faces > 0
    (0, True)
    """

    by: tuple[Coordinate, ...]
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

    def __repr__(self) -> str:
        return f"Partition({self.n_parts} parts by {', '.join(self.by)})"

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
        """Closed boundary of part i, faces outward; raises as `part`.

        That of a shell has two components. The inner one looks into the hole, out of the shell, so
        `TriMesh.diagnose` calls it inside out, as it would be by itself; nothing is to be turned.
        """
        return self.part(i).surface

    def interface(self, i: int, j: int) -> TriMesh:
        """Faces that parts i and j share, looking out of part i.

        Raises
        ------
        OptionError
            If there is no such part, they are the same, or have no face in common.
        """
        if i == j:
            raise OptionError(f"an interface is between two parts, got {i} twice; see surface")
        first, second = (self._faces(p) for p in (i, j))
        keys = [
            np.sort(f, axis=1) @ (self.solid.n_vertices ** np.arange(3)) for f in (first, second)
        ]
        shared = np.isin(keys[0], keys[1])
        if not shared.any():
            raise OptionError(f"parts {i} and {j} have no face in common")
        return TriMesh(self.solid.V, first[shared]).compact()[0]

    def _tets(self, i: int) -> NDArray[np.bool_]:
        return np.asarray(self.labels == whole("the number of a part", i, 0, self.n_parts - 1))

    def _faces(self, i: int) -> NDArray[np.int64]:
        tets = np.ascontiguousarray(self.solid.T[self._tets(i)])
        boundary = _core.mesh.TetBoundary(tets, self.solid.n_vertices)
        return boundary.vertices[boundary.faces].astype(np.int64)

    def to_dict(self) -> dict[str, Any]:
        """Everything scalar, JSON-compatible."""
        names = "by fractions levels volumes errors uncorrected_errors cumulative_errors".split()
        return plain_dict({name: getattr(self, name) for name in names})

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
        from .. import io

        given = self.as_cells()
        io.write(path, self.solid, point_data=given.point_data, cell_data=given.cell_data)

    def as_cells(self) -> Cells:
        """Points, cells and all fields."""
        fields = {"part": self.labels, "parent_tet": self.parent_tet}
        return Cells(self.solid.V, "tetra", self.solid.T, {"image": self.image}, fields)


def partition(
    result: MapResult,
    fractions: int | Sequence[float] | Sequence[int | Sequence[float]] = 5,
    by: Coordinate | Sequence[Coordinate] = "s",
    *,
    start: float = 0.0,
    correct: bool = True,
) -> Partition:
    """Divide a mapped solid into parts of prescribed volume.

    Parameters
    ----------
    result : VolumeMap, or LoadedMap of one
        Map of a solid onto the solid torus.
    fractions : int or sequence of float
        Number of equal parts, or the share of each, summing to 1. With several coordinates a tuple,
        one entry each.
    by : {"s", "u", "v"} or tuple of them
        Nested shells, sectors the long way round, sectors around the tube. Several make a grid; its
        parts are numbered with the last coordinate running fastest.
    start : float
        Angle in radians at which the first sector of ``u`` or ``v`` begins; of shells alone 0.
    correct : bool
        Move the levels until every part, and every cell of a grid, has exactly its share of the
        source's volume (up to rounding, about 1e-13). False: cut at the uncorrected levels.

    Returns
    -------
    Partition

    Raises
    ------
    OptionError
        If an option is out of range, the map has no torus, or the pieces do not fit into memory.
    KindError
        If it is no map, or that of a surface.
    CertificationError
        If tets of the image are folded or flat; ``ids`` are these.
    SolverError
        If the image has no volume to be divided, or a part misses its volume by more than 1e-12 of
        it or has tets without volume, as parts do that are so small that rounding decides; ``ids``
        are those parts. Coordinates far from the origin are rounded, and volumes after them.

    Notes
    -----
    Exact are the volumes of the parts, as sums of the tets they are cut into. The cuts lie close to
    where the piecewise-linear level functions vanish (see the head of
    `stretchmap.partitions.parts`): for u these are the half-planes of the image themselves, for v
    and s polyhedral sheets. They go through vertices nearer than 3 % of an edge. Of tets there are
    about five for each slab of a tet between two levels, so their number grows with that of parts;
    where parts are thinner than tets these get thin, too.
    Section 7.2 of Yueh, Li, Lin, Yau (2020); the uncorrected errors are those of its Table 7.1.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> result = sm.volume_map(sm.samples.solid_torus(600))
    >>> shells = sm.partition(result, [0.2, 0.3, 0.5])
    >>> bool(np.allclose(shells.volumes / result.mesh.volume, [0.2, 0.3, 0.5]))
    True
    >>> sm.partition(result, (2, 3), by=("s", "u")).n_parts
    6
    """
    mapped, source = as_map_of_solid(result, "a partition")
    axes, shares = asked_shares(fractions, by, source.n_tets)
    start, correct = real("start", start, -MOST_ANGLE, MOST_ANGLE), flag("correct", correct)
    if start != 0.0 and axes == ("s",):
        raise OptionError("start is the angle where sectors of u or v begin; shells have none")
    torus = torus_of(mapped)
    require_unfolded(mapped, source, "a partition")
    pieces = Pieces.of(source, mapped.image, torus)
    if "v" in axes:
        pieces = with_core(pieces)
    same = [levels_of(pieces, a, p, start, "image") for a, p in zip(axes, shares, strict=True)]
    counts = [len(share) for share in shares]
    cut, labels, _ = cut_nested(
        pieces, axes, counts, start, lambda i, cell, inside: (same[i], None)
    )
    raw = volumes_of_parts(labels, cut.volumes("source"), math.prod(counts))

    def as_asked(i: int, cell: tuple[int, ...], inside: Pieces) -> Levels:
        here = levels_of(inside, axes[i], shares[i], start, "source")
        share = math.prod(shares[j][part] for j, part in enumerate(cell))
        return here, share * total * shares[i]

    def as_found(i: int, cell: tuple[int, ...], inside: Pieces) -> Levels:
        return same[i], raw.reshape(counts)[cell].reshape(counts[i], -1).sum(axis=1)

    total = float(pieces.volumes("source").sum())
    cut, labels, levels = cut_nested(pieces, axes, counts, start, as_asked if correct else as_found)
    asked = np.ones(1)
    for share in shares:
        asked = np.multiply.outer(asked, share).ravel()
    if correct:
        _require_volumes(cut, labels, asked * total)
    solid = TetMesh(
        np.concatenate([source.V, cut.points[source.n_vertices :, :3] + cut.center]), cut.T
    )
    _require_sound(solid, cut, labels)
    volumes = volumes_of_parts(labels, solid.tet_volumes, len(asked))
    if not correct:
        raw = volumes
    running = np.cumsum(asked)[:-1]
    errors = volumes / (asked * total) - 1.0
    return Partition(
        by=axes,
        fractions=read_only(asked),
        solid=solid,
        image=read_only(np.ascontiguousarray(cut.points[:, 3:6])),
        labels=read_only(labels),
        parent_tet=read_only(cut.parent),
        levels=levels,
        uncorrected_levels=tuple(
            entry + (0.0 if axis == "s" else start) for axis, entry in zip(axes, same, strict=True)
        ),
        volumes=read_only(volumes),
        errors=read_only(errors),
        uncorrected_errors=read_only(raw / (asked * total) - 1.0),
        cumulative_errors=read_only(
            np.cumsum(raw)[:-1] / (running * total) - 1.0 if len(axes) == 1 else np.zeros(0)
        ),
    )


def _require_volumes(cut: Pieces, labels: NDArray[np.int32], wanted: NDArray[np.float64]) -> None:
    """Refuse parts that miss their volumes, apart from how far off the origin the solid lies."""
    errors = volumes_of_parts(labels, cut.volumes("source"), len(wanted)) / wanted - 1.0
    off = np.flatnonzero(~(np.abs(errors) <= _TOLERANCE))
    if len(off):
        raise SolverError(
            f"{len(off)} parts miss their volumes, part {off[0]} by {errors[off[0]]:.1e}: there is "
            "not that much to divide but for rounding; ask for fewer or larger parts",
            off,
        )


def _require_sound(solid: TetMesh, cut: Pieces, labels: NDArray[np.int32]) -> None:
    """Refuse tets that rounding has left without volume."""
    flat = solid.tet_volumes <= 0.0
    image = np.ascontiguousarray(cut.points[:, 3:6])
    flat[_core.certificate.not_positive_tets(image, cut.T)] = True
    if flat.any():
        off = np.unique(labels[flat])
        raise SolverError(
            f"part {off[0]} is so thin that rounding turns {int(flat.sum())} of its tets inside "
            "out; ask for fewer or larger parts",
            off,
        )
