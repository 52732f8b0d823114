"""What each defect is called, which exception it becomes and what helps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ..base.arrays import describe
from ..errors import (
    DegenerateError,
    MeshError,
    NonManifoldError,
    OpenSurfaceError,
    OrientationError,
)


@dataclass(frozen=True, eq=False)
class Defect:
    """One kind of fault.

    Attributes
    ----------
    name : str
        Short name: that of the field of `Diagnosis` which holds the ids.
    message : str
        One sentence: what is wrong, where, and the remedy.
    ids : tuple of int
        Elements or vertices at fault; edges and faces given by vertices are flattened.
    error : type
        The exception `require_...` raises for it.

    Examples
    --------
    >>> import stretchmap as sm
    >>> surface = sm.samples.torus_surface(12, 6)
    >>> for defect in sm.TriMesh(surface.V, surface.F[:, ::-1]).diagnose().defects:
    ...     print(defect.name, defect.error.__name__)
    inside_out OrientationError
    """

    name: str
    message: str
    ids: tuple[int, ...]
    error: type[MeshError]

    def exception(self) -> MeshError:
        """Return the exception that reports this defect."""
        return self.error(self.message, self.ids)


@dataclass(frozen=True)
class Wording:
    """How a kind of defect is put: the field of `Diagnosis`, what its ids are, the sentence."""

    name: str
    error: type[MeshError]
    what: str
    sentence: str

    def defect(self, ids: NDArray[Any]) -> Defect:
        """Return the defect with these ids."""
        message = self.sentence.format(describe(self.what, ids))
        return Defect(self.name, message, tuple(ids.ravel().tolist()), self.error)


_TURN = "pass orient=True to turn them"


def _common(kind: str, element: str, size: str) -> dict[str, Wording]:
    of_boundary = "" if kind == "surface" else "boundary "
    rows = [
        ("repeated", DegenerateError, element, "{} with a repeated vertex; remove them"),
        ("duplicates", DegenerateError, element, "{}, a second copy; remove them"),
        (
            "nonmanifold_edges",
            NonManifoldError,
            "edge",
            f"{{}} with more than two {of_boundary}faces; separate the sheets that meet there",
        ),
        (
            "nonmanifold_vertices",
            NonManifoldError,
            "vertex",
            f"{{}} not surrounded by a single fan of {element}s; duplicate the vertex, one copy "
            "per fan",
        ),
        (
            "not_orientable",
            OrientationError,
            element,
            f"{{}} cannot be oriented with their neighbours: the {kind} is not orientable; cut or "
            "remesh it there",
        ),
        (
            "degenerate",
            DegenerateError,
            element,
            f"{{}} without {size}; remove or remesh them, or scale "
            "the points if all lie so close together",
        ),
        (
            "unreferenced",
            DegenerateError,
            "vertex",
            f"{{}} used by no {element}; remove them, compact() does",
        ),
    ]
    return {row[0]: Wording(*row) for row in rows}


def _surface() -> tuple[Wording, ...]:
    common = _common("surface", "face", "area")
    return (
        common["repeated"],
        common["duplicates"],
        common["nonmanifold_edges"],
        common["nonmanifold_vertices"],
        Wording("border_edges", OpenSurfaceError, "edge", "{} on a border; close the holes"),
        common["not_orientable"],
        Wording(
            "misoriented",
            OrientationError,
            "face",
            "{} oriented against the other faces; " + _TURN,
        ),
        Wording(
            "inside_out",
            OrientationError,
            "face",
            "the surface is inside out, its normals point inward: {}; " + _TURN,
        ),
        common["degenerate"],
        common["unreferenced"],
    )


def _solid() -> tuple[Wording, ...]:
    common = _common("solid", "tet", "volume")
    return (
        common["repeated"],
        common["duplicates"],
        Wording(
            "nonmanifold_faces",
            NonManifoldError,
            "face",
            "{} shared by more than two tets; remove the surplus tets",
        ),
        common["nonmanifold_edges"],
        common["nonmanifold_vertices"],
        common["not_orientable"],
        Wording(
            "misoriented",
            OrientationError,
            "tet",
            "{} oriented against the solid, with negative volume; " + _TURN,
        ),
        Wording(
            "inverted",
            OrientationError,
            "tet",
            "{} inverted, folded over their neighbours; turning cannot help, the vertices have to "
            "be moved or the solid remeshed",
        ),
        common["degenerate"],
        common["unreferenced"],
    )


# Kind of mesh -> its defects, those that hide others first.
WORDINGS = {"surface": _surface(), "solid": _solid()}
