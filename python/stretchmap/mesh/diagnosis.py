"""What is wrong with a mesh: every defect, with the ids at fault and the remedy."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import describe, read_only
from ..base.tables import HasSummary
from ..errors import ConnectivityError, GenusError
from .defects import WORDINGS, Defect

__all__ = ["Defect", "Diagnosis", "diagnose_solid", "diagnose_surface"]

Ids = NDArray[np.int32]


def _none(*shape: int) -> Ids:
    return read_only(np.empty(shape, np.int32))


@dataclass(frozen=True, eq=False)
class Diagnosis(HasSummary):
    """Every defect of the elements. ``defects`` lists those found, ``summary()`` words them.

    Not looked for are faces that cross, in a surface or in the boundary of a solid: these are
    `TriMesh.crossing_faces`.

    Elements are faces of a surface and tets of a solid. Elements that repeat a vertex and second
    copies are reported and then left out of all else, so that one fault is listed once.

    Attributes
    ----------
    kind : {"surface", "solid"}
    n_vertices, n_elements : int
    repeated : (a,) ndarray of int32
        Elements that use a vertex twice.
    duplicates : (a,) ndarray of int32
        Later copies of an element with the same vertices.
    degenerate : (a,) ndarray of int32
        Elements without area or volume: twice the area is at most ``max(1e-12 L, 16 eps C) L``, six
        times the volume at most ``max(1e-12 L, 16 eps C) L**2``, with L the longest edge of the
        element, C the largest absolute coordinate of the mesh and eps the rounding unit.
    misoriented : (a,) ndarray of int32
        Elements that run against their neighbours: faces against the majority, tets against the
        orientation in which their component has positive volume. ``orient=True`` turns them.
    inverted : (a,) ndarray of int32
        Tets that agree with their neighbours and are negative all the same: the solid is folded.
    inside_out : (a,) ndarray of int32
        Faces of closed components that enclose a negative volume.
    not_orientable : (a,) ndarray of int32
        Elements where no turning helps.
    nonmanifold_faces : (a, 3) ndarray of int32
        Vertices of faces shared by more than two tets.
    nonmanifold_edges : (a, 2) ndarray of int32
        Vertices of edges with more than two faces (of the surface, or of the solid's boundary).
    nonmanifold_vertices : (a,) ndarray of int32
        Vertices whose elements do not surround them as one fan (one ball or half-ball in a solid);
        in a solid without those that lie on an edge or face already listed.
    border_edges : (a, 2) ndarray of int32
        Vertices of edges with a single face; surfaces only.
    unreferenced : (a,) ndarray of int32
        Vertices no element uses.
    component : (n_elements,) ndarray of int32
        Component of each element, -1 where left out.
    euler : (c,) ndarray of int32
        Euler characteristic of each component.
    genus : (b,) ndarray of int32
        Genus of each component of the surface, or of each component of the solid's boundary; -1
        where it has a border, is not manifold or not orientable.
    cavity_vertices : (a,) ndarray of int32
        Vertices on all components of a solid's boundary but the one with the most faces.
    coincident : (a,) ndarray of int32
        Vertices exactly where one of a lower id is, which have to be welded if they are meant to be
        one. Looked for only where there are several components or the genus is not 1.
    welding_helps : bool
        Edges or vertices that are not manifold would be with these welded.

    Examples
    --------
    >>> import stretchmap as sm
    >>> surface = sm.samples.torus_surface(12, 6)
    >>> holed = sm.TriMesh(surface.V, surface.F[1:])
    >>> found = holed.diagnose()
    >>> found.ok, len(found.border_edges)
    (False, 3)
    >>> print(found.summary().splitlines()[-1])
    - 3 edges ((0, 6), (0, 7), (6, 7)) on a border; close the holes
    """

    kind: str
    n_vertices: int
    n_elements: int
    repeated: Ids
    duplicates: Ids
    degenerate: Ids
    misoriented: Ids
    not_orientable: Ids
    nonmanifold_edges: Ids
    nonmanifold_vertices: Ids
    unreferenced: Ids
    component: Ids
    euler: Ids
    genus: Ids
    inverted: Ids = field(default_factory=lambda: _none(0))
    inside_out: Ids = field(default_factory=lambda: _none(0))
    nonmanifold_faces: Ids = field(default_factory=lambda: _none(0, 3))
    border_edges: Ids = field(default_factory=lambda: _none(0, 2))
    cavity_vertices: Ids = field(default_factory=lambda: _none(0))
    coincident: Ids = field(default_factory=lambda: _none(0))
    welding_helps: bool = False

    def __repr__(self) -> str:
        found = _count(len(self.defects), "defect") if self.defects else "no defects"
        return f"Diagnosis({self.kind}, {self._genus_text()}, {found})"

    @property
    def n_components(self) -> int:
        """Number of components (elements that share a vertex belong together)."""
        return len(self.euler)

    @property
    def element(self) -> str:
        """What an element is called: ``"face"`` or ``"tet"``."""
        return "face" if self.kind == "surface" else "tet"

    @property
    def defects(self) -> tuple[Defect, ...]:
        """Every defect found, those that hide others first; the genus is not a defect."""
        return tuple(self._defects())

    @property
    def ok(self) -> bool:
        """True when there is no defect."""
        return not self.defects

    def summary(self) -> str:
        """Return a few lines of text: sizes, topology and one line per defect."""
        lines = [
            f"{self.kind}: {self.n_vertices} vertices, {self.n_elements} {self.element}s, "
            f"{_count(self.n_components, 'component')}, "
            f"Euler characteristic {int(self.euler.sum())}, {self._genus_text()}"
        ]
        lines += [f"- {defect.message}" for defect in self.defects]
        if self.ok:
            lines.append(f"no defects{self._welding()}")
        return "\n".join(lines)

    def require(self, names: Iterable[str] | None = None) -> None:
        """Raise the first defect, of those named or of all.

        Parameters
        ----------
        names : iterable of str, optional
            Names of the fields that count; all by default.

        Raises
        ------
        MeshError
            The subclass that belongs to the defect, with its ids. One that says what else is wrong
            when there is more than one defect.
        """
        wanted = None if names is None else set(names)
        found = [d for d in self.defects if wanted is None or d.name in wanted]
        if not found:
            return
        first = found[0]
        message = first.message
        if len(found) > 1:
            others = ", ".join(d.name.replace("_", " ") for d in found[1:])
            message += f" (also found: {others}; diagnose() lists everything)"
        raise first.error(message, first.ids)

    def require_torus(self) -> None:
        """Raise unless the surface, or the boundary of the solid, is one torus.

        Raises
        ------
        GenusError
            Another genus, or several boundary components, or, for a solid, an Euler characteristic
            other than zero.
        """
        genus = self.genus.tolist()
        if self.kind == "surface":
            if genus != [1]:
                raise GenusError(
                    f"the surface has {self._genus_text()}; a torus, genus 1, is needed"
                    + _genus_hint(genus)
                    + self._welding()
                )
            return
        if len(genus) > 1:
            raise GenusError(
                f"the boundary of the solid has {len(genus)} components of genus "
                f"{', '.join(map(str, genus))}: a solid torus has none but its outer skin; fill "
                f"the cavities ({describe('vertex', self.cavity_vertices)}){self._welding()}",
                self.cavity_vertices,
            )
        if genus != [1]:
            raise GenusError(
                f"the boundary of the solid has {self._genus_text()}; a solid torus, whose "
                "boundary has genus 1, is needed" + _genus_hint(genus) + self._welding()
            )
        if int(self.euler.sum()) != 0:
            raise GenusError(
                f"the solid has Euler characteristic {int(self.euler.sum())}; a solid torus has 0"
            )

    def _genus_text(self) -> str:
        if not len(self.genus) or (self.genus < 0).any():
            return "no genus (not closed, manifold and orientable)"
        return "genus " + _listed(self.genus)

    def _welding(self) -> str:
        """What to do first where vertices that seem to be one are several."""
        if not len(self.coincident):
            return ""
        return f"; {describe('vertex', self.coincident)} exactly where others are: weld them first"

    def _defects(self) -> Iterable[Defect]:
        for wording in WORDINGS[self.kind]:
            ids = getattr(self, wording.name)
            if len(ids):
                defect = wording.defect(ids)
                if wording.name == "border_edges":
                    defect = replace(defect, message=defect.message + self._welding())
                elif wording.name.startswith("nonmanifold") and self.welding_helps:
                    fault = defect.message.partition("; ")[0]
                    defect = replace(defect, message=fault + self._welding())
                yield defect
        if self.n_components > 1:
            yield self._disconnected()

    def _disconnected(self) -> Defect:
        kept = self.component[self.component >= 0]
        sizes = np.bincount(kept)
        others = np.flatnonzero((self.component >= 0) & (self.component != sizes.argmax()))
        counts = _listed(sizes)
        return Defect(
            "component",
            f"the {self.kind} has {len(sizes)} components of {counts} {self.element}s; keep one "
            f"of them (all but the largest: {describe(self.element, others)}){self._welding()}",
            tuple(others.tolist()),
            ConnectivityError,
        )


def diagnose_surface(V: NDArray[np.float64], F: NDArray[np.int32]) -> Diagnosis:
    """Diagnose a surface given by validated arrays, see `TriMesh.diagnose`."""
    found = _core.mesh.SurfaceDiagnosis(V, F)
    diagnosis = Diagnosis(
        kind="surface",
        n_vertices=len(V),
        n_elements=len(F),
        inside_out=found.inside_out,
        border_edges=found.border_edges,
        genus=found.genus,
        **_common(found),
    )
    return _with_coincident(diagnosis, V, F)


def diagnose_solid(V: NDArray[np.float64], T: NDArray[np.int32]) -> Diagnosis:
    """Diagnose a solid given by validated arrays, see `TetMesh.diagnose`."""
    found = _core.mesh.SolidDiagnosis(V, T)
    parts = found.boundary_component
    cavity = parts != np.bincount(parts[parts >= 0], minlength=1).argmax()
    diagnosis = Diagnosis(
        kind="solid",
        n_vertices=len(V),
        n_elements=len(T),
        inverted=found.inverted,
        nonmanifold_faces=found.nonmanifold_faces,
        genus=found.boundary_genus,
        cavity_vertices=read_only(np.unique(found.boundary_faces[cavity])),
        **_common(found),
    )
    return _with_coincident(diagnosis, V, T)


def _common(found: _core.mesh.SurfaceDiagnosis | _core.mesh.SolidDiagnosis) -> dict[str, Any]:
    return {
        "repeated": found.repeated,
        "duplicates": found.duplicates,
        "degenerate": found.degenerate,
        "misoriented": found.misoriented,
        "not_orientable": found.conflicts,
        "nonmanifold_edges": found.nonmanifold_edges,
        "nonmanifold_vertices": found.nonmanifold_vertices,
        "unreferenced": found.unreferenced,
        "component": found.component,
        "euler": found.euler,
    }


def _with_coincident(found: Diagnosis, V: NDArray[np.float64], elements: Ids) -> Diagnosis:
    if found.n_components == 1 and found.genus.tolist() == [1]:
        return found
    order = np.lexsort(V.T)
    same = (V[order[1:]] == V[order[:-1]]).all(axis=1)
    ids = np.sort(order[1:][same]).astype(np.int32)
    helps = False
    if len(ids) and _not_manifold(found):
        first = np.empty(len(V), np.int32)  # of all that are where each is, the lowest
        first[order] = order[np.maximum.accumulate(np.where(np.r_[True, ~same], range(len(V)), 0))]
        solid = found.kind == "solid"
        core = _core.mesh.SolidDiagnosis if solid else _core.mesh.SurfaceDiagnosis
        helps = _not_manifold(core(V, first[elements])) < _not_manifold(found)
    return replace(found, coincident=read_only(ids), welding_helps=helps)


def _not_manifold(
    found: Diagnosis | _core.mesh.SurfaceDiagnosis | _core.mesh.SolidDiagnosis,
) -> int:
    """Number of edges and vertices that are not manifold."""
    return len(found.nonmanifold_edges) + len(found.nonmanifold_vertices)


def _listed(numbers: NDArray[Any]) -> str:
    return ", ".join(map(str, numbers[:5].tolist())) + (", ..." if len(numbers) > 5 else "")


def _count(n: int, what: str) -> str:
    return f"{n} {what}" + ("" if n == 1 else "s")


def _genus_hint(genus: list[int]) -> str:
    if genus == [0]:
        return "; this one is a ball or sphere, it has no hole"
    if len(genus) == 1 and genus[0] > 1:
        return f"; this one has {genus[0]} handles, close all but one"
    return ""
