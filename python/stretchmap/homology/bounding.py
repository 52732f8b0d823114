"""Which classes of loops bound inside and outside a surface; the longitude of a torus."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import GenusError, SelfIntersectionError
from ..mesh.given import require_same_mesh
from .generators import generators_of
from .integer import complement, integer_inverse, integer_kernel

if TYPE_CHECKING:
    from ..mesh.meshes import TetMesh, TriMesh

__all__ = [
    "bounding_by_linking",
    "bounding_in",
    "least_skew_longitude",
    "require_bounding_alike",
    "same_lattice",
]


def bounding_by_linking(
    surface: TriMesh, loops: list[NDArray[np.int32]], intersection: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Linking matrix and bases of the classes that bound inside and outside.

    A class bounds inside exactly when it links no loop that was pushed outward. On an embedded
    surface lk(a, b outward) - lk(b, a outward) is minus the intersection number of a and b, each
    kind of class has rank g, and the two kinds meet in a unimodular matrix.
    """
    linking = _core.homology.linking_matrix(
        surface.topology, surface.V, [loop.tolist() for loop in loops]
    )
    inside, outside = integer_kernel(linking.T), integer_kernel(linking)
    if not (
        2 * len(inside) == 2 * len(outside) == len(loops)
        and np.array_equal(linking.T - linking, intersection)
        and abs(round(np.linalg.det(outside @ intersection @ inside.T))) == 1
    ):
        raise SelfIntersectionError(
            f"the linking numbers of the {len(loops)} generators are not those of a surface of "
            f"genus {len(loops) // 2} without self-intersections; remove these or give the solid"
        )
    return linking, inside, outside


def bounding_in(
    solid: TetMesh, surface: TriMesh, loops: list[NDArray[np.int32]]
) -> NDArray[np.int64]:
    """Basis of the classes over ``loops`` on which every class of H^1(solid) vanishes."""
    fault = "the surface is not the boundary of the solid"
    require_same_mesh(solid.surface, surface, fault, "pass solid.surface")
    within = [solid.boundary_vertices[loop].tolist() for loop in loops]
    relations, values = _core.homology.solid_cohomology(
        solid.T, solid.edges, solid.n_vertices, within
    )
    cohomology = integer_kernel(relations)
    if 2 * len(cohomology) != len(loops):
        raise GenusError(
            f"the solid has first Betti number {len(cohomology)}, its boundary genus "
            f"{len(loops) // 2}; they have to agree"
        )
    return integer_kernel((values @ cohomology.T).T)


def same_lattice(first: NDArray[np.int64], second: NDArray[np.int64]) -> bool:
    """Whether two gapless lattices of equal dimension are the same."""
    rank = int(np.linalg.matrix_rank(np.vstack([first, second])))
    return rank == len(first) == len(second)


def require_bounding_alike(solid: TetMesh, image: TriMesh) -> None:
    """Raise where what bounds in a solid does not bound behind an image of its boundary.

    Parameters
    ----------
    solid : TetMesh
    image : TriMesh
        Of its boundary, with the same faces; embedded.

    Raises
    ------
    GenusError
        Then no map of the inside is continuous.
    """
    surface = solid.surface
    if surface.euler == 2:
        return
    loops, _, intersection = generators_of(surface)
    within = bounding_in(solid, surface, loops)
    behind = bounding_by_linking(image, loops, intersection)[1]
    if not same_lattice(within, behind):
        raise GenusError(
            "the boundary image turns the solid inside out: loops that bound inside of the solid, "
            "such as meridians, do not bound behind the image, so no map of the inside is "
            "continuous; has the image its faces in another order, or are two angles exchanged?"
        )


def least_skew_longitude(
    meridian: NDArray[np.int64],
    tunnel: NDArray[np.int64] | None,
    intersection: NDArray[np.int64],
    gram: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Class that meets the meridian once and, of all those, makes the lattice least skew.

    The form dual to the longitude does not change when the longitude gains meridians; the other one
    loses as many of it, so one rounding of G12 / G11 makes them as orthogonal as they can be.
    """
    longitude = complement(meridian) * intersection[0, 1] if tunnel is None else tunnel[0]
    forms = integer_inverse(np.stack([longitude, meridian]).T)
    g = forms @ gram @ forms.T
    return np.asarray(longitude + round(g[0, 1] / g[0, 0]) * meridian)
