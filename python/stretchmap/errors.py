"""Exceptions. Each names the fault, carries the ids at fault and says the remedy."""

from __future__ import annotations

from collections.abc import Iterable


class StretchmapError(Exception):
    """Base of everything stretchmap raises on purpose.

    Attributes
    ----------
    ids : tuple of int
        Offending vertices, faces, tets or edges (which of them, the message says); may be empty.

    Examples
    --------
    >>> import stretchmap as sm
    >>> surface = sm.samples.torus_surface(12, 6)
    >>> try:
    ...     sm.TriMesh(surface.V, surface.F[2:]).require_closed()
    ... except sm.errors.StretchmapError as error:
    ...     print(type(error).__name__, error.ids)
    OpenSurfaceError (0, 1, 0, 6, 1, 7, 6, 7)
    """

    def __init__(self, message: str, ids: Iterable[int] = ()) -> None:
        super().__init__(message)
        self.ids: tuple[int, ...] = tuple(int(i) for i in ids)


class MeshError(StretchmapError, ValueError):
    """The input mesh cannot be used as it is."""


class ArrayError(MeshError):
    """An array has the wrong shape, rank or type."""


class KindError(ArrayError, TypeError):
    """A mesh or a map of the wrong kind was given, or one that belongs to another mesh."""


class IndexRangeError(MeshError):
    """An index points outside the vertex array."""


class NonFiniteError(MeshError):
    """A coordinate is NaN or infinite."""


class DegenerateError(MeshError):
    """Elements with repeated vertices, no area or no volume; duplicates; unreferenced vertices."""


class NonManifoldError(MeshError):
    """An edge or a vertex is not surrounded by a single fan of elements."""


class OpenSurfaceError(MeshError):
    """The surface has a border."""


class OrientationError(MeshError):
    """Faces or tets are oriented inconsistently, inside out or inverted."""


class ConnectivityError(MeshError):
    """The mesh has more than one component."""


class GenusError(MeshError):
    """The mesh is not a torus or not a solid torus."""


class SelfIntersectionError(MeshError):
    """The surface crosses itself where an embedded one is needed."""


class LandmarkError(StretchmapError, ValueError):
    """Landmarks contradict each other or do not lie on the surface."""


class FileFormatError(StretchmapError, ValueError):
    """A file cannot be read or written as asked."""


class OptionError(StretchmapError, ValueError):
    """An option is unknown or out of range."""


class MissingDependencyError(StretchmapError, ImportError):
    """An optional package is needed; the message holds the pip line."""


class SolverError(StretchmapError, RuntimeError):
    """A numerical step broke down or could not reach its goal."""


class CertificationError(SolverError):
    """The map found is not a bijection; ``ids`` are the elements at fault."""


class Cancelled(StretchmapError):
    """The caller asked to stop."""
