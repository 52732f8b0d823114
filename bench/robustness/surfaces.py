"""From a shape to a mesh: polygonising, remeshing to even triangles, filling with tets."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stretchmap import TetMesh, TriMesh, samples

Array = NDArray[np.float64]

TETS_PER_FACE = 2.2  # as tetgen fills a closed surface of even triangles


class Rejected(Exception):
    """The random shape is not one closed surface of genus one; another one has to be drawn."""


@dataclass(frozen=True)
class RoundCone:
    """All balls whose centers run from ``a`` to ``b`` and whose radii run from ``ra`` to ``rb``."""

    a: Array
    b: Array
    ra: float
    rb: float

    def distance(self, points: Array) -> Array:
        """Distance to the axis, less the radius there; exact where the radii agree."""
        axis = self.b - self.a
        t = np.clip((points - self.a) @ axis / max(float(axis @ axis), 1e-300), 0.0, 1.0)
        away = np.linalg.norm(points - self.a - t[..., None] * axis, axis=-1)
        return away - (self.ra + t * (self.rb - self.ra))


def tube(centers: Array, radii: Array) -> list[RoundCone]:
    """A chain of round cones along a closed polygon."""
    ends = np.roll(np.arange(len(centers)), -1)
    return [
        RoundCone(centers[i], centers[j], float(radii[i]), float(radii[j]))
        for i, j in enumerate(ends)
    ]


def polygonize(parts: Sequence[RoundCone], cell: float, blend: float = 0.0) -> TriMesh:
    """Marching cubes on the union of the parts, its creases rounded to a radius of about ``blend``.

    Raises
    ------
    Rejected
        If the largest component is not closed, manifold and of genus one.
    """
    from skimage.measure import marching_cubes

    low = np.min([np.minimum(p.a, p.b) - max(p.ra, p.rb) for p in parts], axis=0)
    high = np.max([np.maximum(p.a, p.b) + max(p.ra, p.rb) for p in parts], axis=0)
    margin = blend + 4.0 * cell
    low = low - margin
    shape = np.ceil((high + margin - low) / cell).astype(int) + 1
    if np.prod(shape.astype(float)) > 4e7:
        raise Rejected(f"a grid of {shape} points")
    field = np.full(shape, margin)
    for part in parts:
        reach = max(part.ra, part.rb) + margin
        first = np.floor((np.minimum(part.a, part.b) - reach - low) / cell).astype(int).clip(0)
        last = np.ceil((np.maximum(part.a, part.b) + reach - low) / cell).astype(int) + 1
        window = tuple(slice(i, j) for i, j in zip(first, last, strict=True))
        block = field[window]
        index = np.moveaxis(np.indices(block.shape), 0, -1) + first
        field[window] = smooth_minimum(block, part.distance(low + cell * index), blend)
    V, F, _, _ = marching_cubes(field, 0.0, spacing=(cell,) * 3, allow_degenerate=False)
    return genus_one(V.astype(np.float64) + low, F)


def smooth_minimum(a: Array, b: Array, width: float) -> Array:
    """The lesser of the two, rounded off where they differ by less than ``width``."""
    if width <= 0.0:
        return np.minimum(a, b)
    overlap = np.maximum(width - np.abs(a - b), 0.0) / width
    return np.minimum(a, b) - overlap**2 * width / 4.0


def genus_one(V: Array, F: NDArray[np.integer]) -> TriMesh:
    """The component with the most faces, faces outward.

    Raises
    ------
    Rejected
        If it is not closed, manifold and of genus one.
    """
    whole = TriMesh(V, F)
    component = whole.diagnose().component
    largest = np.bincount(component[component >= 0]).argmax()
    surface, _ = TriMesh(whole.V, whole.F[component == largest]).compact()
    if surface.volume < 0.0:
        surface = TriMesh(surface.V, surface.F[:, ::-1])
    diagnosis = surface.diagnose()
    if not diagnosis.ok or list(diagnosis.genus) != [1]:
        raise Rejected(diagnosis.summary())
    return surface


def even_edge(area: float, n_tets: float) -> float:
    """Edge length of even triangles between which tetgen puts about ``n_tets`` tets."""
    return math.sqrt(area / (0.433 * n_tets / TETS_PER_FACE))


def remesh(surface: TriMesh, edge: float, sampling: float = 8.0) -> TriMesh:
    """Even triangles of about the given edge length, by clustering vertices (pyacvd).

    Parameters
    ----------
    surface : TriMesh
    edge : float
    sampling : float
        Least number of vertices clustered to one; where it is small, a few slivers stay.

    Raises
    ------
    Rejected
        If the result is not a closed manifold of genus one.
    """
    import pyacvd
    import pyvista

    n = max(int(surface.area / (0.866 * edge**2)), 60)
    faces = np.column_stack([np.full(surface.n_faces, 3), surface.F])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pyvista.core.errors.PyVistaDeprecationWarning)
        clustering = pyacvd.Clustering(pyvista.PolyData(np.asarray(surface.V), faces))
        # Long triangles have to be cut to be clustered.
        for _ in range(6):
            if len(clustering.mesh.points) > sampling * n:
                break
            clustering.subdivide(1)
        clustering.cluster(n)
        result = clustering.create_mesh()
    return genus_one(np.asarray(result.points, float), result.faces.reshape(-1, 4)[:, 1:])


def fill(surface: TriMesh, edge: float | None = None) -> TetMesh:
    """Fill with tets by tetgen, the surface kept; with ``edge``, the inside as fine as that."""
    bound = None if edge is None else 1.5 * edge**3 / (6.0 * math.sqrt(2.0))
    return samples.tetrahedralize(surface, max_volume=bound)


def even_surface(surface: TriMesh, n_tets: float, sampling: float = 8.0) -> TriMesh:
    """Even triangles of the size at which the solid has about ``n_tets`` tets."""
    return remesh(surface, even_edge(surface.area, n_tets), sampling)
