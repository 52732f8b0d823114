"""Landmarks found by a rule, from a registration there is."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..base.options import whole
from ..errors import LandmarkError
from ..maps.files import LoadedMap
from ..maps.given import as_map_of_solid, target_of
from ..mesh.normals import vertex_normals
from .landmarks import Landmarks, similarity
from .result import Registration

__all__ = ["landmarks_between"]

_SAME_WAY = 0.8  # least cosine between the normals of two points that are taken to correspond


def landmarks_between(registration: Registration | LoadedMap, n: int = 36) -> Landmarks:
    """Landmarks by a geometric rule, where nobody has placed any.

    The source is laid on the target by the similarity that fits the registration best. Candidates
    are taken one by one from the source's boundary, each the farthest from those before; each goes
    with the nearest target vertex, provided that the normals there agree (cosine above 0.8) and
    that the way back ends within two mean edge lengths of where it began.

    Parameters
    ----------
    registration : Registration, or LoadedMap of one
        Made without landmarks.
    n : int
        Number of landmarks.

    Returns
    -------
    Landmarks

    Raises
    ------
    OptionError
        If ``n`` is not positive or the map no registration.
    KindError
        If it is no map of a solid.
    LandmarkError
        If the rule finds fewer.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.registration.suggest import landmarks_between
    >>> one, other = (sm.samples.vertebra_like(2000, seed=seed) for seed in (0, 1))
    >>> len(landmarks_between(sm.register(one, other), n=4))
    4
    """
    mapped, solid = as_map_of_solid(registration, "finding landmarks")
    target = target_of(mapped, "finding landmarks")
    n = whole("n", n, 1)
    first, second = solid.surface, target.surface
    image = mapped.image[solid.boundary_vertices]
    rotation, scale, shift = similarity(first.V, image)
    moved = scale * first.V @ rotation + shift
    there, back = cKDTree(second.V), cKDTree(moved)
    _, partner = there.query(moved)
    normals = vertex_normals(first.V, first.F) @ rotation
    agree = np.einsum("ij,ij->i", normals, vertex_normals(second.V, second.F)[partner])
    _, home = back.query(second.V[partner])
    edge = np.linalg.norm(np.diff(moved[first.edges], axis=1), axis=2).mean()
    usable = (agree > _SAME_WAY) & (np.linalg.norm(moved[home] - moved, axis=1) < 2.0 * edge)
    given = solid.n_vertices - _put_in(registration)
    usable &= solid.boundary_vertices < given  # what was put in is no vertex of the source
    chosen: list[int] = []
    nearest = np.where(usable, np.linalg.norm(moved - moved.mean(axis=0), axis=1), -1.0)
    while len(chosen) < n and nearest.max() > 0.0:
        i = int(np.argmax(nearest))
        if partner[i] in partner[chosen]:
            nearest[i] = -1.0
            continue
        chosen.append(i)
        distance = np.linalg.norm(moved - moved[i], axis=1)
        nearest = np.minimum(nearest, distance) if len(chosen) > 1 else distance
        nearest[~usable] = -1.0
    if len(chosen) < n:
        raise LandmarkError(f"the rule finds {len(chosen)} landmarks, {n} were asked for")
    return Landmarks.of(
        solid,
        target,
        solid.boundary_vertices[chosen],
        target.boundary_vertices[partner[chosen]],
    )


def _put_in(registration: Registration | LoadedMap) -> int:
    """Number of vertices of its mesh, the last ones, that the source as given had not."""
    if isinstance(registration, LoadedMap):
        counts = ("added_vertices", "boundary_splits")
        return sum(registration.meta.get(name, 0) for name in counts)
    return 0 if registration.refinement is None else registration.refinement.n_split
