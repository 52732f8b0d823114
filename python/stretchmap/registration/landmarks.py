"""Landmarks of a registration: given as vertices, points or a file."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from ..base.arrays import INT32_MAX, as_integers, as_reals
from ..base.options import real
from ..base.rotation import kabsch
from ..errors import ArrayError, FileFormatError, LandmarkError
from ..io.numbers import read_numbers
from ..mesh.given import as_solid
from ..mesh.meshes import TetMesh

__all__ = ["Landmarks", "read_landmarks", "similarity"]

# How far a point may lie from the boundary, as a share of the diagonal of the solid's box.
WITHIN = 0.1


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Pairs of boundary vertices that correspond.

    Attributes
    ----------
    source, target : ndarray of int32, shape (k,)
        Vertices of the two solids.
    snapped : ndarray, shape (k, 2)
        How far the points given were from these vertices, in source and target; zero for ids.

    Examples
    --------
    >>> import stretchmap as sm
    >>> source, target = sm.samples.solid_torus(600), sm.samples.solid_torus(800)
    >>> ends = source.V[source.boundary_vertices[:2]], target.V[target.boundary_vertices[:2]]
    >>> marks = sm.Landmarks.of(source, target, *ends)
    >>> len(marks), float(marks.snapped.max())
    (2, 0.0)
    """

    source: NDArray[np.int32]
    target: NDArray[np.int32]
    snapped: NDArray[np.float64]

    def __post_init__(self) -> None:
        ids = [as_integers(x, "landmarks", (None,), 0) for x in (self.source, self.target)]
        count = len(ids[0])
        arrays = {
            "source": ids[0].astype(np.int32),
            "target": as_integers(ids[1], "target", (count,)).astype(np.int32),
            "snapped": as_reals(self.snapped, "snapped", (count, 2)),
        }
        for name, array in arrays.items():
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.source)

    @classmethod
    def of(
        cls,
        source: TetMesh,
        target: TetMesh,
        source_at: ArrayLike,
        target_at: ArrayLike,
        *,
        within: float = WITHIN,
    ) -> Landmarks:
        """Landmarks from vertex ids or points, which go to the nearest boundary vertex.

        Parameters
        ----------
        source, target : TetMesh
        source_at, target_at : array_like of int, shape (k,), or of float, shape (k, 3)
            Boundary vertices, or points near the boundary.
        within : float
            How far a point may lie from the boundary, as a share of the diagonal of the solid's
            bounding box: one farther off belongs to another solid, or is in another unit.

        Raises
        ------
        ArrayError
            Wrong shapes or numbers of landmarks.
        LandmarkError
            A point too far away, or a vertex that is not on the boundary or is used twice; ``ids``
            are the landmarks.
        OptionError
            ``within`` is not positive.
        """
        within = real("within", within, above=0.0)
        source, target = as_solid(source, "source"), as_solid(target, "target")
        ends = [
            _snap(mesh, at, name, within)
            for mesh, at, name in ((source, source_at, "source"), (target, target_at, "target"))
        ]
        if len(ends[0][0]) != len(ends[1][0]):
            raise ArrayError(
                f"{len(ends[0][0])} landmarks on the source, {len(ends[1][0])} on the target"
            )
        for (ids, _), name in zip(ends, ("source", "target"), strict=True):
            _, first, count = np.unique(ids, return_index=True, return_counts=True)
            if (count > 1).any():
                vertex = ids[first[count > 1][0]]
                same = np.flatnonzero(ids == vertex)
                raise LandmarkError(
                    f"landmarks {same[0]} and {same[1]} are the same {name} vertex {vertex}", same
                )
        return cls(ends[0][0], ends[1][0], np.stack([ends[0][1], ends[1][1]], axis=1))


def _snap(
    mesh: TetMesh, at: ArrayLike, name: str, within: float
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Boundary vertices, and how far from them the points given were."""
    raw = as_reals(at, f"{name} landmarks", (None,), (None, 3))
    if raw.ndim == 1:
        ids = as_integers(at, f"{name} landmarks", (None,))
        bad = np.flatnonzero((ids < 0) | (ids >= mesh.n_vertices))
        if len(bad):
            raise LandmarkError(f"landmark {bad[0]} names no vertex: {ids[bad[0]]}", bad)
        inner = np.flatnonzero(mesh.boundary_index[ids] < 0)
        if len(inner):
            raise LandmarkError(
                f"landmark {inner[0]}: vertex {ids[inner[0]]} is not on the boundary", inner
            )
        return ids.astype(np.int32), np.zeros(len(ids))
    distance, nearest = cKDTree(mesh.V[mesh.boundary_vertices]).query(raw)
    diagonal = float(np.linalg.norm(np.ptp(mesh.V, axis=0)))
    far = np.flatnonzero(~(distance <= within * diagonal))
    if len(far):
        raise LandmarkError(
            f"landmark {far[0]} lies {distance[far[0]]:.6g} from the boundary of the {name}, whose "
            f"bounding box has a diagonal of {diagonal:.6g}; at most {within:g} of that is allowed "
            "(within=): is it in another unit, or of another solid?",
            far,
        )
    return mesh.boundary_vertices[nearest], distance


def read_landmarks(
    path: str | os.PathLike[str], source: TetMesh, target: TetMesh, *, within: float = WITHIN
) -> Landmarks:
    """Read landmarks from a CSV file.

    Parameters
    ----------
    path : path-like
        One landmark per row: two vertex ids, or six coordinates (source, then target). A first row
        that is not numbers is a header.
    source, target : TetMesh
    within : float
        As `Landmarks.of`.

    Returns
    -------
    Landmarks

    Raises
    ------
    FileFormatError
        If the rows are not like that; names the line at fault.
    LandmarkError, ArrayError
        As `Landmarks.of`.
    OSError
        If the file cannot be opened.

    Examples
    --------
    >>> import os, tempfile
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "landmarks.csv")
    ...     np.savetxt(path, [solid.boundary_vertices[[0, 1]]], fmt="%d", delimiter=",")
    ...     marks = sm.read_landmarks(path, solid, solid)
    >>> marks.source.tolist() == [solid.boundary_vertices[0]]
    True
    """
    source, target = as_solid(source, "source"), as_solid(target, "target")
    within = real("within", within, above=0.0)
    widths = {2: "vertex ids", 6: "coordinates in source and target"}
    values = read_numbers(path, widths)
    if values.shape[1] == 2:
        if (values != np.round(values)).any():
            raise FileFormatError(f"{path}: vertex ids must be whole numbers")
        if np.abs(values).max(initial=0.0) > INT32_MAX:
            raise FileFormatError(f"{path}: a vertex id is out of range")
        return Landmarks.of(source, target, *values.T.astype(np.int64))
    return Landmarks.of(source, target, values[:, :3], values[:, 3:], within=within)


def similarity(
    points: NDArray[np.float64], images: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Rotation, scale, shift with ``scale * points @ rotation + shift`` nearest to the images."""
    p, q = points - points.mean(axis=0), images - images.mean(axis=0)
    rotation, shares = kabsch(p.T @ q)
    scale = float(shares.sum() / (p**2).sum())
    return rotation, scale, images.mean(axis=0) - scale * points.mean(axis=0) @ rotation
