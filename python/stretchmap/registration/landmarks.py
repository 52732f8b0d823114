"""Landmarks of a registration: given as vertices, points or a file."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from ..errors import ArrayError, FileFormatError, LandmarkError
from ..io.numbers import read_numbers
from ..mesh.meshes import TetMesh

__all__ = ["Landmarks", "read_landmarks", "similarity"]


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Pairs of boundary vertices that correspond.

    Attributes
    ----------
    source, target : ndarray of int32, shape (k,)
        Vertices of the two solids.
    snapped : ndarray, shape (k, 2)
        How far the points given were from these vertices, in source and target; zero for ids.
    """

    source: NDArray[np.int32]
    target: NDArray[np.int32]
    snapped: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.source)

    @classmethod
    def of(
        cls, source: TetMesh, target: TetMesh, source_at: ArrayLike, target_at: ArrayLike
    ) -> Landmarks:
        """Landmarks from vertex ids (k,) or points (k, 3), which go to the nearest boundary vertex.

        Raises
        ------
        ArrayError
            Wrong shapes or numbers of landmarks.
        LandmarkError
            A vertex that is not on the boundary or is used twice; ``ids`` are the landmarks.
        """
        ends = [_snap(mesh, at) for mesh, at in ((source, source_at), (target, target_at))]
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


def _snap(mesh: TetMesh, at: ArrayLike) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    given = np.asarray(at)
    if given.ndim == 1 and given.dtype.kind in "iu":
        if len(given) and not (0 <= given.min() and given.max() < mesh.n_vertices):
            bad = np.flatnonzero((given < 0) | (given >= mesh.n_vertices))
            raise LandmarkError(f"landmark {bad[0]} names no vertex: {given[bad[0]]}", bad)
        inner = np.flatnonzero(mesh.boundary_index[given] < 0)
        if len(inner):
            raise LandmarkError(
                f"landmark {inner[0]}: vertex {given[inner[0]]} is not on the boundary", inner
            )
        return given.astype(np.int32), np.zeros(len(given))
    if given.ndim == 2 and given.shape[1] == 3 and given.dtype.kind in "fiu":
        if not np.isfinite(given).all():
            raise LandmarkError("a landmark is not finite")
        distance, nearest = cKDTree(mesh.V[mesh.boundary_vertices]).query(given.astype(float))
        return mesh.boundary_vertices[nearest], distance
    raise ArrayError(f"landmarks are vertex ids (k,) or points (k, 3), not {given.shape}")


def read_landmarks(path: str | os.PathLike[str], source: TetMesh, target: TetMesh) -> Landmarks:
    """Read landmarks from a CSV file.

    Parameters
    ----------
    path : path-like
        One landmark per row: two vertex ids, or six coordinates (source, then target). A first row
        that is not numbers is a header.
    source, target : TetMesh

    Raises
    ------
    FileFormatError
        If the rows are not like that; names the line at fault.
    LandmarkError, ArrayError
        As `Landmarks.of`.
    OSError
        If the file cannot be opened.
    """
    widths = {2: "vertex ids", 6: "coordinates in source and target"}
    values = read_numbers(path, widths)
    if values.shape[1] == 2:
        if (values != np.round(values)).any():
            raise FileFormatError(f"{path}: vertex ids must be whole numbers")
        return Landmarks.of(source, target, *values.T.astype(np.int64))
    return Landmarks.of(source, target, values[:, :3], values[:, 3:])


def similarity(
    points: NDArray[np.float64], images: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Rotation, scale, shift with ``scale * points @ rotation + shift`` nearest to the images."""
    p, q = points - points.mean(axis=0), images - images.mean(axis=0)
    U, S, W = np.linalg.svd(p.T @ q)
    S[2] *= np.sign(np.linalg.det(U @ W))
    U[:, 2] *= np.sign(np.linalg.det(U @ W))
    scale = float(S.sum() / (p**2).sum())
    rotation = U @ W
    return rotation, scale, images.mean(axis=0) - scale * points.mean(axis=0) @ rotation
