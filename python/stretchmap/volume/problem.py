"""Source and image of a solid on one scale."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.torus import Torus
from ..errors import DegenerateError, OrientationError
from ..maps.history import IterationRecord
from ..mesh.meshes import TriMesh
from ..mesh.overconstrained import overconstrained_elements
from ..mesh.refinement import Refinement, refine_overconstrained
from .anisotropy import unstretching
from .model import SolidModel
from .options import FillOptions

if TYPE_CHECKING:
    from ..mesh.meshes import TetMesh

__all__ = ["Outcome", "VolumeProblem"]


@dataclass(frozen=True, eq=False)
class VolumeProblem:
    """Source and image, scaled so that what the boundary image encloses has volume 1.

    Attributes
    ----------
    solid : TetMesh
        The input, or its refinement.
    refinement : Refinement or None
        That made the solid; None: it must not be refined.
    V, x : ndarray, shape (n, 3)
        Source, a stretch common to all tets undone (see `unstretching`), and image here; inner
        rows of ``x`` count only if it is ``warm``.
    center : ndarray, shape (3,)
    length : float
        A point p here is ``p * length + center`` in the image asked for.
    warm : bool
        Whether ``x`` is a whole map.
    torus : Torus or None
        What the boundary lies on here, if it may glide; centered at the origin.
    ground : TriMesh or None
        The same if that is a mesh.
    scale : ndarray, shape (n,), or None
    begun : bool
        Whether inner rows of ``x`` and the scale are those the optimization begins with.
    held, pinned : ndarray of intp
        As in `SolidModel`.
    """

    solid: TetMesh
    refinement: Refinement | None
    V: NDArray[np.float64]
    x: NDArray[np.float64]
    center: NDArray[np.float64]
    length: float
    warm: bool
    torus: Torus | None = None
    scale: NDArray[np.float64] | None = None
    begun: bool = False
    held: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))
    ground: TriMesh | None = None
    pinned: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))

    @classmethod
    def of(
        cls,
        solid: TetMesh,
        image: NDArray[np.float64],
        *,
        torus: Torus | None = None,
        ground: TriMesh | None = None,
        pinned: NDArray[np.int32] | None = None,
        refine: bool | None = True,
        warm: bool = False,
        unstretch: bool = True,
    ) -> VolumeProblem:
        """Of an image of the boundary vertices (nb, 3), or of all vertices (n, 3) to go on from.

        Parameters
        ----------
        solid : TetMesh
        image : ndarray
        torus : Torus, optional
            What the boundary image lies on.
        ground : TriMesh, optional
            The same if that is a mesh.
        pinned : ndarray of int32, optional
            Boundary vertices that do not glide on it.
        refine : bool or None
            Whether overconstrained elements are split or refused; None: neither.
        warm : bool
            Whether the image is of all vertices. Their number does not tell, where none is inside.
        unstretch : bool
            Whether a stretch common to all tets is undone, see `unstretching`.

        Raises
        ------
        DegenerateError
            ``refine=False`` and some interior edge or face cannot be repaired; ``ids`` are tets.
        OrientationError
            The boundary image is inside out.
        """
        refinement = None
        rounding = unstretching(solid.V, solid.T) if unstretch else None
        if refine:
            seen = None if rounding is None else np.ascontiguousarray(solid.V @ rounding)
            refinement = refine_overconstrained(solid, seen)
        elif refine is not None:
            _refuse_overconstrained(solid)
        mesh = solid if refinement is None else refinement.solid
        ids = solid.boundary_vertices
        boundary = image[ids] if warm else image
        enclosed = float(_core.mesh.enclosed_volume(boundary, solid.surface.F))
        if not enclosed > 0.0:
            remedy = "mirror it, or reverse the order of its faces"
            if torus is not None:
                remedy = (
                    "mirror it or, if the torus is too thin for so few faces, ask for a smaller R/r"
                )
            raise OrientationError(
                f"the boundary image is inside out, or encloses no volume: {remedy}"
            )
        length = enclosed ** (1.0 / 3.0)
        center = np.zeros(3) if torus is not None else boundary.mean(axis=0)
        x = np.zeros((mesh.n_vertices, 3))
        if warm:
            x = image if refinement is None else refinement.prolong(image)
        else:
            x[ids] = image
        V = (mesh.V - mesh.V.mean(axis=0)) / solid.volume ** (1.0 / 3.0)
        return cls(
            solid=mesh,
            refinement=refinement,
            V=np.ascontiguousarray(V if rounding is None else V @ rounding),
            x=np.ascontiguousarray((x - center) / length),
            center=center,
            length=length,
            warm=warm,
            torus=None if torus is None else torus.scaled(1.0 / length),
            ground=None if ground is None else TriMesh((ground.V - center) / length, ground.F),
            pinned=np.empty(0, np.intp) if pinned is None else pinned.astype(np.intp),
        )

    @property
    def n_given_tets(self) -> int:
        """Tets of the solid before any were split."""
        return self.solid.n_tets if self.refinement is None else self.refinement.n_given_tets

    def halved(self, edges: NDArray[np.int32]) -> VolumeProblem:
        """With interior edges (e, 2) of the solid halved, the longest first; in the image, too."""
        assert self.refinement is not None
        passes = len(self.refinement.halved)
        refinement = self.refinement.halve(edges[_core.mesh.longest_first(self.V, edges)])
        fields = {"V": self.V, "x": self.x}
        if self.scale is not None:
            fields["scale"] = self.scale
        for ends in refinement.halved[passes:]:
            fields = {k: np.concatenate([at, at[ends].mean(axis=1)]) for k, at in fields.items()}
        return dataclasses.replace(
            self,
            solid=refinement.solid,
            refinement=refinement,
            **fields,  # type: ignore[arg-type]
        )

    def model(self, options: FillOptions) -> SolidModel:
        """What the stages work on."""
        ids = self.solid.boundary_vertices
        return SolidModel(
            V=self.V,
            T=self.solid.T,
            boundary=ids,
            faces=ids[self.solid.surface.F],
            options=options,
            torus=self.torus,
            scale=self.scale,
            held=self.held,
            ground=self.ground,
            pinned=self.pinned,
        )


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a volume optimization ends with, on the scale of the problem.

    Attributes
    ----------
    problem : VolumeProblem
        With the solid refined where that was needed, and ``x`` the image.
    history : tuple of IterationRecord
    converged : bool
    stop_reason : str
    seconds : dict
        By stage.
    vertex_exact : bool
    glided : bool
        Whether the boundary did on a mesh.
    stuck : str
        How many tets could not be untangled, in words that the stop reason ends with; empty if all
        were.
    """

    problem: VolumeProblem
    history: tuple[IterationRecord, ...]
    converged: bool
    stop_reason: str
    seconds: dict[str, float]
    vertex_exact: bool = False
    glided: bool = False
    stuck: str = ""


def _refuse_overconstrained(solid: TetMesh) -> None:
    found = overconstrained_elements(solid)
    if len(found):
        raise DegenerateError(
            f"{len(found.edges)} interior edges and {len(found.faces)} interior faces have all "
            "their vertices on the boundary, so the boundary map alone decides about the tets at "
            "them; allow their refinement (refine=True)",
            found.tets,
        )
