"""Damaged meshes, and what each has to lead to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import shapes
from stretchmap import TetMesh, errors

DEPTHS = ("arrays", "closed", "torus")


@dataclass(frozen=True)
class Defect:
    """A damaged mesh, and the exception and ids due where it has to be noticed."""

    name: str
    depth: str
    arrays: Callable[[], tuple[Any, Any]]
    error: type[Exception]
    ids: tuple[int, ...] | None  # None: not checked


# ----------------------------------------------------------------------------------- base meshes


def surface() -> tuple[np.ndarray, np.ndarray]:
    """A torus of 96 vertices and 192 faces."""
    return shapes.torus()


def solid() -> tuple[np.ndarray, np.ndarray]:
    """A solid torus of cubes, two cells thick, so that it has vertices inside."""
    filled = shapes.box(5, 5, 2)
    filled[2, 2] = False
    return shapes.cubes(filled)


BASES = {"surface": surface, "solid": solid}
N_FACES = 192
N_TETS = len(solid()[1])
N = {"surface": len(surface()[0]), "solid": len(solid()[0])}


def inner_vertex() -> int:
    """A vertex inside the solid."""
    points, tets = solid()
    return int(np.flatnonzero(TetMesh(points, tets).boundary_index < 0)[0])


def changed(kind: str, change: Callable[[Any, Any], Any]) -> Callable[[], tuple[Any, Any]]:
    """The base mesh after ``change(points, elements)``, which returns both or edits in place."""

    def arrays() -> tuple[Any, Any]:
        points, elements = BASES[kind]()
        result = change(points, elements)
        return (points, elements) if result is None else result

    return arrays


def put(array: Any, where: Any, value: Any) -> None:
    """Assign, as an expression would."""
    array[where] = value


def flip(elements: np.ndarray, ids: Any) -> np.ndarray:
    """Turn the elements named."""
    turned = elements.copy()
    turned[ids] = turned[ids][..., [1, 0, *range(2, elements.shape[1])]]
    return turned


def join(*meshes: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Several meshes side by side in one pair of arrays."""
    starts = np.cumsum([0, *(len(points) for points, _ in meshes)])
    points = np.vstack([points + 20.0 * k for k, (points, _) in enumerate(meshes)])
    return points, np.vstack([e + s for (_, e), s in zip(meshes, starts, strict=False)])


def glued(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """The mesh and its point reflection in vertex 0, which the two share."""
    points, elements = BASES[kind]()
    ids = np.concatenate([[0], np.arange(1, len(points)) + len(points) - 1])
    mirrored = flip(ids[elements], slice(None))
    return np.vstack([points, 2 * points[0] - points[1:]]), grown(elements, mirrored)


def grown(elements: np.ndarray, *rows: Any) -> np.ndarray:
    """Elements with further rows."""
    return np.vstack([elements, *rows]).astype(np.int32)


# ------------------------------------------------------------------------------- array defects


def array_defects(kind: str) -> list[Defect]:
    """What is wrong with the arrays alone; the same list for both kinds."""

    def defect(name: str, change: Any, error: type[Exception], ids: Any = ()) -> Defect:
        return Defect(name, "arrays", changed(kind, change), error, ids)

    shape = errors.ArrayError
    return [
        defect("index 10**6", lambda V, E: put(E, (5, 1), 10**6), errors.IndexRangeError, (5,)),
        defect("index n", lambda V, E: put(E, (0, 0), len(V)), errors.IndexRangeError, (0,)),
        defect("index -1", lambda V, E: put(E, (7, 2), -1), errors.IndexRangeError, (7,)),
        defect(
            "index 2**40",
            lambda V, E: (V, np.where(np.arange(len(E))[:, None] == 3, 2**40, E.astype(np.int64))),
            errors.IndexRangeError,
            (3,),
        ),
        defect("NaN", lambda V, E: put(V, (6, 1), np.nan), errors.NonFiniteError, (6,)),
        defect("infinity", lambda V, E: put(V, (8, 0), -np.inf), errors.NonFiniteError, (8,)),
        defect("float index", lambda V, E: (V, E.astype(float)), shape),
        defect("bool index", lambda V, E: (V, E > 3), shape),
        defect("complex points", lambda V, E: (V + 0j, E), shape),
        defect("text points", lambda V, E: (V.astype(str), E), shape),
        defect("ragged points", lambda V, E: ([[0, 1, 2], [3, 4]], E), shape),
        defect("no points", lambda V, E: (None, E), shape),
        defect("empty points", lambda V, E: (V[:0], E), shape),
        defect("empty elements", lambda V, E: (V, E[:0]), shape),
        defect("points transposed", lambda V, E: (V.T, E), shape),
        defect("elements transposed", lambda V, E: (V, E.T), shape),
        defect("planar points", lambda V, E: (V[:, :2], E), shape),
        defect("flat elements", lambda V, E: (V, E.ravel()), shape),
        defect("eight corners", lambda V, E: (V, np.zeros((4, 8), int)), shape),
    ]


# ----------------------------------------------------------------------------- surface defects


def surface_defects() -> list[Defect]:
    """What is wrong with a surface."""
    faces = surface()[1]
    a, b, c = faces[30].tolist()
    zero_area = tuple(np.flatnonzero((faces == a).any(1) & (faces == b).any(1)).tolist())
    hole = sorted([*sorted([a, b]), *sorted([b, c]), *sorted([a, c])])

    def defect(name: str, change: Any, error: type[Exception], ids: Any = None) -> Defect:
        return Defect(name, "closed", changed("surface", change), error, ids)

    orientation, degenerate = errors.OrientationError, errors.DegenerateError
    new = N["surface"]
    return [
        defect("flipped", lambda V, F: (V, flip(F, [9, 40])), orientation, (9, 40)),
        defect("inside out", lambda V, F: (V, F[:, ::-1]), orientation, tuple(range(N_FACES))),
        defect("duplicate", lambda V, F: (V, grown(F, F[3])), degenerate, (N_FACES,)),
        defect("turned duplicate", lambda V, F: (V, grown(F, F[3, ::-1])), degenerate, (N_FACES,)),
        defect("repeated vertex", lambda V, F: (V, grown(F, [4, 4, 9])), degenerate, (N_FACES,)),
        defect("zero area", lambda V, F: put(V, a, V[b]), degenerate, zero_area),
        defect("unreferenced", lambda V, F: (np.vstack([V, V[:1]]), F), degenerate, (new,)),
        defect("open", lambda V, F: (V, np.delete(F, 30, axis=0)), errors.OpenSurfaceError, hole),
        defect(
            "edge of three faces",
            lambda V, F: (np.vstack([V, [[3, 3, 3]]]), grown(F, [a, b, new])),
            errors.NonManifoldError,
            tuple(sorted([a, b])),
        ),
        defect("pinched vertex", lambda V, F: glued("surface"), errors.NonManifoldError, (0,)),
        defect(
            "two components",
            lambda V, F: join((V, F), (V, F)),
            errors.ConnectivityError,
            tuple(range(N_FACES, 2 * N_FACES)),
        ),
        defect("one point", lambda V, F: (V[:1] + 0 * V, F), degenerate, tuple(range(N_FACES))),
        Defect("sphere", "torus", lambda: skin(shapes.BALL), errors.GenusError, ()),
        Defect("genus two", "torus", lambda: skin(shapes.DOUBLE), errors.GenusError, ()),
    ]


def skin(filled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boundary of a solid of cubes."""
    found = TetMesh(*shapes.cubes(filled)).surface
    return found.V, found.F


# ------------------------------------------------------------------------------- solid defects


def solid_defects() -> list[Defect]:
    """What is wrong with a solid."""
    points, tets = solid()
    center = inner_vertex()
    neighbor = int(next(i for i in tets[(tets == center).any(1)][0] if i != center))

    def determinants(place: np.ndarray) -> np.ndarray:
        moved = points.copy()
        moved[center] = place
        x = moved[tets]
        return np.linalg.det(x[:, 1:] - x[:, :1])

    outside = points[center] + [1.7, 0.1, 0.2]
    folded = tuple(np.flatnonzero(determinants(outside) < 0).tolist())
    flat = tuple(np.flatnonzero(abs(determinants(points[neighbor])) < 1e-12).tolist())

    def defect(
        name: str, change: Any, error: type[Exception], ids: Any = None, depth: str = "closed"
    ) -> Defect:
        return Defect(name, depth, changed("solid", change), error, ids)

    orientation, degenerate = errors.OrientationError, errors.DegenerateError
    new, all_tets = N["solid"], tuple(range(N_TETS))
    face = tuple(tets[0, :3].tolist())
    return [
        defect("flipped", lambda V, T: (V, flip(T, [9, 40])), orientation, (9, 40)),
        defect("mirrored", lambda V, T: (-V, T), orientation, all_tets),
        defect("inverted", lambda V, T: put(V, center, outside), orientation, folded),
        defect("duplicate", lambda V, T: (V, grown(T, T[3])), degenerate, (N_TETS,)),
        defect("repeated vertex", lambda V, T: (V, grown(T, [4, 4, 9, 2])), degenerate, (N_TETS,)),
        defect("zero volume", lambda V, T: put(V, center, V[neighbor]), degenerate, flat),
        defect("all in a plane", lambda V, T: (V * [1, 1, 0], T), degenerate, all_tets),
        defect("unreferenced", lambda V, T: (np.vstack([V, V[:1]]), T), degenerate, (new,)),
        defect(
            "face of many tets",
            lambda V, T: (
                np.vstack([V, [[9, 9, 9], [9, 8, 7]]]),
                grown(T, [*face, new], [*face, new + 1]),
            ),
            errors.NonManifoldError,
        ),
        defect("pinched vertex", lambda V, T: glued("solid"), errors.NonManifoldError, (0,)),
        Defect("edge between two cubes", "closed", two_cubes, errors.NonManifoldError, None),
        defect(
            "two components",
            lambda V, T: join((V, T), (V, T)),
            errors.ConnectivityError,
            tuple(range(N_TETS, 2 * N_TETS)),
        ),
        Defect("ball", "torus", lambda: shapes.cubes(shapes.BALL), errors.GenusError, ()),
        Defect("genus two", "torus", lambda: shapes.cubes(shapes.DOUBLE), errors.GenusError, ()),
        Defect("hollow ball", "torus", lambda: shapes.cubes(shapes.SHELL), errors.GenusError, None),
        Defect(
            "bubble",
            "torus",
            lambda: shapes.cubes(shapes.thick_ring_with_bubble()),
            errors.GenusError,
            None,
        ),
    ]


def two_cubes() -> tuple[np.ndarray, np.ndarray]:
    """Two cubes that touch along an edge."""
    filled = np.zeros((2, 2, 1), bool)
    filled[0, 0] = filled[1, 1] = True
    return shapes.cubes(filled)


DEFECTS = {
    "surface": [*array_defects("surface"), *surface_defects()],
    "solid": [*array_defects("solid"), *solid_defects()],
}
