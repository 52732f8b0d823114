"""What was done to a raw surface, step by step."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..base.tables import HasSummary, plain, versions
from ..mesh.meshes import TetMesh, TriMesh
from .handles import HandleCut

__all__ = ["Preparation", "Step"]


@dataclass(frozen=True)
class Step:
    """One step of a preparation.

    Attributes
    ----------
    name : str
        ``"mask"``, ``"weld"``, ``"orient"``, ``"debris"``, ``"holes"``, ``"coarsen"``,
        ``"crossings"``, ``"handles"``, ``"remesh"``, ``"fill"``.
    counts : mapping of str to number
        What was changed, by what it is; zeros where there was nothing to do.
    seconds : float
    """

    name: str
    counts: Mapping[str, float]
    seconds: float

    @property
    def changed(self) -> bool:
        """Whether there was anything to do."""
        return any(self.counts.values())


@dataclass(frozen=True, eq=False)
class Preparation(HasSummary):
    """A solid that can be mapped, and how it came about.

    Attributes
    ----------
    solid : TetMesh
        One component, no defects, boundary of the genus asked for.
    genus : int
    cuts : tuple of HandleCut
        Every surplus handle that was removed, with its length and place.
    steps : tuple of Step

    Examples
    --------
    >>> import stretchmap as sm
    >>> done = sm.prepare(sm.samples.torus_surface(24, 12), faces=1_000)
    >>> done.solid.surface.genus, done.cuts
    (1, ())
    """

    solid: TetMesh
    genus: int
    cuts: tuple[HandleCut, ...]
    steps: tuple[Step, ...] = field(repr=False)

    @property
    def surface(self) -> TriMesh:
        """Boundary of the solid."""
        return self.solid.surface

    def to_dict(self) -> dict[str, Any]:
        """Everything but the mesh, JSON-compatible."""
        out: dict[str, Any] = plain(
            {
                "n_vertices": self.solid.n_vertices,
                "n_tets": self.solid.n_tets,
                "n_faces": self.surface.n_faces,
                "genus": self.genus,
                "volume": self.solid.volume,
                "cuts": [dataclasses.asdict(cut) for cut in self.cuts],
                "steps": [dataclasses.asdict(step) for step in self.steps],
                "seconds": sum(step.seconds for step in self.steps),
                "versions": versions(),
            }
        )
        return out

    def summary(self) -> str:
        """One line per step and per cut, and the solid that came out."""
        lines = []
        for step in self.steps:
            done = ", ".join(f"{v:g} {k.replace('_', ' ')}" for k, v in step.counts.items() if v)
            lines.append(f"{step.name:<10}  {done or 'nothing to do'}")
            if step.name == "handles":
                lines += [f"{'':<10}  {cut}" for cut in self.cuts]
        solid = self.solid
        lines.append(
            f"{'solid':<10}  {solid.n_tets} tets, {solid.n_vertices} vertices, "
            f"{self.surface.n_faces} boundary faces, genus {self.genus}"
        )
        return "\n".join(lines)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the solid; raises as `stretchmap.write`."""
        from .. import io

        io.write(path, self.solid)
