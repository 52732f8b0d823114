"""A homology basis and its shortest loops (paper section 3.1).

The *meridian* of a torus bounds a disk inside the solid, the *longitude* runs the long way round.
Which is which is a matter of linking numbers, or of the solid when it is given, never of length.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_integers, read_only
from ..base.tables import HasSummary, table
from ..errors import ArrayError, GenusError, SelfIntersectionError
from ..forms.harmonic import HarmonicForms
from .generators import Generators
from .integer import integer_inverse
from .shortest_basis import searched, short_loops, shortest_walk, walk_below
from .walks import save_loops

__all__ = ["HomologyBasis"]

_MOST_TURNS = 100  # the search for a shortest loop walks round as often as the class says


@dataclass(frozen=True, eq=False)
class HomologyBasis(Generators, HasSummary):
    """Generators of the first homology of a closed surface and what the embedding says of them.

    A loop is an array of vertex ids, the first not repeated at the end. A class is an integer row
    of coefficients over ``generators``. Loops other than the generators are found on first use.

    Attributes
    ----------
    surface : TriMesh
    genus : int
    generators : tuple of ndarray
        2g simple loops, a basis of H1 over the integers.
    dual_forms : ndarray, shape (2g, e), int32
        Closed integer 1-forms; form i has period exactly ``i == j`` over generator j, (3.1).
    intersection : ndarray, shape (2g, 2g), int64
        Intersection numbers of the generators.
    linking : ndarray, shape (2g, 2g), int64, or None
        Entry (i, j): linking number of generator i with generator j lifted outward. None when the
        surface crosses itself (possible only if the solid was given).
    handle_classes : ndarray, shape (g, 2g), int64
        Basis of the classes that bound inside, of least extremal length first.
    tunnel_classes : ndarray, shape (g, 2g), int64, or None
        Basis of the classes that bound outside; tunnel i meets handle i once and no other. None
        where ``linking`` is.
    harmonic : HarmonicForms
        Harmonic representatives of ``dual_forms`` in cotangent weights.

    Examples
    --------
    >>> import stretchmap as sm
    >>> basis = sm.homology_basis(sm.samples.torus_surface(24, 12))
    >>> basis.genus, len(basis.meridian), len(basis.longitude)
    (1, 12, 24)
    >>> basis.intersection.tolist() in ([[0, 1], [-1, 0]], [[0, -1], [1, 0]])
    True
    """

    linking: NDArray[np.int64] | None
    handle_classes: NDArray[np.int64]
    tunnel_classes: NDArray[np.int64] | None
    harmonic: HarmonicForms = field(repr=False)
    _torus_classes: NDArray[np.int64] | None = None

    def __repr__(self) -> str:
        return f"HomologyBasis(genus {self.genus}, {len(self.generators)} generators)"

    @property
    def torus_classes(self) -> NDArray[np.int64]:
        """(2, 2) classes of longitude and meridian over ``generators``; the longitude least skew.

        Raises
        ------
        GenusError
            The genus is not one.
        """
        if self._torus_classes is None:
            raise GenusError(
                f"a torus map needs a surface of genus 1, this one has genus {self.genus}; loops "
                "and holomorphic forms work for any genus"
            )
        return self._torus_classes

    @cached_property
    def torus_matrix(self) -> NDArray[np.int64]:
        """(2, 2), ``torus_forms = torus_matrix @ dual_forms``; raises as `torus_classes`."""
        return integer_inverse(self.torus_classes.T)

    @cached_property
    def torus_forms(self) -> NDArray[np.int32]:
        """(2, e) forms dual to longitude and meridian, their wedge product one in all.

        Raises as `torus_classes`.
        """
        return read_only((self.torus_matrix @ self.dual_forms).astype(np.int32))

    @cached_property
    def handle_loops(self) -> tuple[NDArray[np.int32], ...]:
        """Shortest loop of edges in each handle class: g loops that bound inside.

        Where the genus is too large for the mesh to search for these, 16 for some hundred faces,
        they are short loops in a basis over the integers of what bounds inside: that of
        `handle_classes` with some of them exchanged for shorter ones, see `classes`. Then each is
        the shortest of its class and no longer than that of the class it stands for, with one
        exception: where the shortest cycle of a class is in pieces of which none can stand for it,
        the loop joins these, and may be longer than the shortest.
        """
        return short_loops(self, self.handle_classes, ())

    @cached_property
    def tunnel_loops(self) -> tuple[NDArray[np.int32], ...]:
        """Shortest loop of edges in each tunnel class: g loops that bound outside.

        Where the genus is large for the mesh, in a basis of these, as for `handle_loops`.

        Raises
        ------
        SelfIntersectionError
            The surface crosses itself; there is no outside.
        """
        if self.tunnel_classes is None:
            raise SelfIntersectionError(
                "the surface crosses itself: which loops bound outside it is not defined"
            )
        return short_loops(self, self.tunnel_classes, self.handle_loops)

    @property
    def meridian(self) -> NDArray[np.int32]:
        """Shortest loop of the meridian's class.

        Raises
        ------
        GenusError
            The genus is not one.
        """
        self.require_torus()
        return self.handle_loops[0]

    @cached_property
    def longitude(self) -> NDArray[np.int32]:
        """Shortest loop of the longitude's class.

        Raises
        ------
        GenusError
            The genus is not one.
        """
        tunnel = self.tunnel_classes
        if tunnel is not None and np.array_equal(self.torus_classes[:1], tunnel):
            return self.tunnel_loops[0]
        return searched(self, self.torus_classes[0], self.handle_loops)

    def shortest_loop(self, coefficients: ArrayLike) -> NDArray[np.int32]:
        """Shortest loop of edges in a homology class.

        Parameters
        ----------
        coefficients : (2g,) array_like of int
            The class over ``generators``, not zero; none beyond 100 either way, since the loop goes
            round that often and the time to find it grows faster still. It grows exponentially with
            the genus, too, if the shortest cycle of the class is in several pieces.

        Returns
        -------
        (k,) ndarray of int32
            Vertex ids. The loop is exactly shortest, but it is a walk: in a class that no simple
            loop represents it meets itself.

        Raises
        ------
        ArrayError
            The class is zero, has the wrong length or no integers.
        IndexRangeError
            A coefficient beyond 100; ``ids`` are their places.
        """
        shape = (2 * self.genus,)
        target = as_integers(coefficients, "coefficients", shape, -_MOST_TURNS, _MOST_TURNS)
        if not target.any():
            raise ArrayError(f"a class is {2 * self.genus} integers, not all zero")
        return shortest_walk(self, target)

    def loop_below(self, coefficients: NDArray[np.int64], limit: float) -> NDArray[np.int32] | None:
        """Shortest loop of a class if it is shorter than a limit; quick where the limit is small.

        Parameters
        ----------
        coefficients : (2g,) array of int
            As for `shortest_loop`.
        limit : float
            In units of ``V``.

        Returns
        -------
        (k,) ndarray of int32, or None
        """
        return walk_below(self, np.asarray(coefficients), limit)

    def require_torus(self) -> None:
        """Raise `GenusError` unless the genus is one."""
        _ = self.torus_classes

    def to_dict(self) -> dict[str, Any]:
        """Genus and loop lengths, JSON-compatible."""
        rows: dict[str, Any] = {
            "genus": self.genus,
            "n_vertices": self.surface.n_vertices,
            "n_faces": self.surface.n_faces,
            "handle_lengths": [self.length(loop) for loop in self.handle_loops],
        }
        if self.tunnel_classes is not None:
            rows["tunnel_lengths"] = [self.length(loop) for loop in self.tunnel_loops]
        if self.genus == 1:
            rows["meridian_length"] = self.length(self.meridian)
            rows["longitude_length"] = self.length(self.longitude)
        return rows

    def summary(self) -> str:
        """A table of genus and loop lengths."""
        rows = self.to_dict()
        for name in ("handle_lengths", "tunnel_lengths"):
            if name in rows:
                rows[name] = ", ".join(f"{x:.6g}" for x in rows[name])
        return table(rows)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write loops and forms to an ``.npz`` file.

        Parameters
        ----------
        path : path-like
            Gets ``V``, ``F``, ``edges``, ``dual_forms``, the loops ``generator_0``, ...,
            ``handle_0``, ..., ``tunnel_0``, ... and, for genus one, ``meridian``, ``longitude`` and
            ``torus_forms``.

        Raises
        ------
        FileFormatError
            Another suffix.
        OSError
            If the file cannot be written.
        """
        tunnels = () if self.tunnel_classes is None else self.tunnel_loops
        families = {"generator": self.generators, "handle": self.handle_loops, "tunnel": tunnels}
        loops = {f"{name}_{i}": l for name, some in families.items() for i, l in enumerate(some)}
        arrays: dict[str, NDArray[Any]] = {"dual_forms": self.dual_forms, **loops}
        if self.genus == 1:
            arrays.update(meridian=self.meridian, longitude=self.longitude)
            arrays["torus_forms"] = self.torus_forms
        save_loops(path, self.surface, arrays)
