"""What every result shares: iteration records, the table, JSON, and map files that come back.

A map file is an ``.npz`` with ``V``, ``F`` or ``T``, ``image`` (n, 3), ``torus`` (2,) with R and r
where there is one, further named arrays, and ``meta``, a JSON text of all scalars, the history and
the versions. Every writer here writes to a temporary file first and renames it, so a failure leaves
no file behind.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.files import atomic_path
from ..base.tables import plain, table, versions
from ..base.torus import TWO_PI, Torus
from .points import CarriesPoints

if TYPE_CHECKING:
    from ..measures.elements import Distortion
    from ..mesh.meshes import TetMesh, TriMesh
from .history import IterationRecord

__all__ = ["MapResult"]


class MapResult(CarriesPoints):
    """Mixin for the frozen dataclasses that hold a map.

    The dataclass defines the attributes ``image (n, 3)``, ``torus`` (or None), ``history`` (tuple
    of :class:`IterationRecord`), ``distortion``, ``converged``, ``stop_reason``, ``seconds`` (dict
    from stage to seconds), and its source mesh as ``solid`` or ``surface``. It may define
    ``certificate`` and ``energy``, and overrides :meth:`extra_arrays` and :meth:`extra_scalars`
    for what is its own.
    """

    title = "map"

    if TYPE_CHECKING:
        image: NDArray[np.float64]
        torus: Torus | None
        history: tuple[IterationRecord, ...]
        distortion: Distortion
        converged: bool
        stop_reason: str
        seconds: Mapping[str, float]

    @property
    def mesh(self) -> TriMesh | TetMesh:
        """The source mesh; row i of ``image`` is its vertex i."""
        solid = getattr(self, "solid", None)
        return self.surface if solid is None else solid  # type: ignore[attr-defined]

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """Further arrays to be kept in a map file, by name."""
        return {}

    def extra_scalars(self) -> dict[str, Any]:
        """Further entries of the report, JSON-compatible, by name."""
        return {}

    def to_dict(self, history: bool = False) -> dict[str, Any]:
        """Everything scalar about the map, ready for JSON.

        Parameters
        ----------
        history : bool
            Add the list of iteration records.
        """
        mesh = self.mesh
        d = self.distortion
        energy = getattr(self, "energy", None)
        out: dict[str, Any] = {
            "kind": self.title,
            "n_vertices": len(mesh.V),
            "n_elements": len(elements(mesh)),
            "element": "tet" if hasattr(mesh, "T") else "face",
            "flips": d.flips,
            "ring_mean": d.ring_mean,
            "ring_std": d.ring_std,
            "element_error_mean": d.element_error_mean,
            "element_std": d.element_std,
            "element_error_std": d.element_error_std,
            "ratio_min": d.ratio_min,
            "ratio_max": d.ratio_max,
            "total_distortion": d.total_distortion,
            "angle_mean": d.angle_mean,
            "angle_max": d.angle_max,
            "energy": d.stretch_energy if energy is None else energy,
            "energy_bound": d.stretch_bound,
            "iterations": sum(1 for record in self.history if record.iteration > 0),
            "converged": self.converged,
            "stop_reason": self.stop_reason,
            "seconds": dict(self.seconds),
            "torus": None if self.torus is None else {"R": self.torus.R, "r": self.torus.r},
            "versions": versions(),
        }
        certificate = getattr(self, "certificate", None)
        if certificate is not None:
            out["certified"] = certificate.certified
            out["certificate"] = certificate.to_dict()
        out.update(self.extra_scalars())
        if history:
            out["history"] = [dataclasses.asdict(record) for record in self.history]
        return plain(out)

    def to_json(self, history: bool = False, indent: int | None = 2) -> str:
        """:meth:`to_dict` as JSON text; what is not finite becomes ``null``."""
        return json.dumps(self.to_dict(history), indent=indent, allow_nan=False)

    def summary(self) -> str:
        """A table of the map's figures."""
        rows = self.to_dict()
        seconds = rows.pop("seconds")
        torus = rows.pop("torus")
        certificate = rows.pop("certificate", None)
        rows.pop("versions")
        if torus is not None:
            rows["torus"] = f"R = {torus['R']:.6g}, r = {torus['r']:.6g}"
        if certificate is not None and not certificate["certified"]:
            rows["certified"] = f"no: {certificate['reason']}"
        for stage, value in seconds.items():
            rows[f"seconds, {stage}"] = value
        return table(rows)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map to a file.

        Parameters
        ----------
        path : path-like
            ``.npz``: everything, for :func:`load_map`. ``.vtu``, ``.vtk``: the source mesh with
            ``image`` as point data and the ratios as cell data. ``.obj`` of a surface with angles:
            the source with (u, v) in turns as texture coordinates. The other formats of
            :func:`stretchmap.write` hold no arrays and get the image itself, of a solid where they
            can hold one and of its surface where not.

        Raises
        ------
        FileFormatError
            If the suffix is not known or the format cannot hold the mesh.
        OSError
            If the file cannot be written.
        """
        from .. import io

        path = Path(path)
        suffix = path.suffix.lower()
        mesh, d = self.mesh, self.distortion
        solid = hasattr(mesh, "T")
        angles = getattr(self, "angles", None)
        if suffix == ".npz":
            self._save_npz(path)
        elif suffix in (".vtu", ".vtk", ".xdmf"):
            arrays = {
                name: array
                for name, array in self.extra_arrays().items()
                if array.shape[:1] == (len(mesh.V),) and array.ndim <= 2
            }
            arrays |= {"image": self.image, "ring_ratio": d.ring_ratios}
            io.write(path, mesh, point_data=arrays, cell_data={"ratio": d.ratios})
        elif suffix == ".obj" and not solid and angles is not None:
            io.write(path, mesh, corner_uv=corner_turns(mesh.F, angles))
        elif solid and suffix not in io.suffixes(solid=True):
            surface = mesh.surface
            io.write(path, type(surface)(self.image[mesh.boundary_vertices], surface.F))
        else:
            io.write(path, type(mesh)(self.image, elements(mesh)), cell_data={"ratio": d.ratios})

    def _save_npz(self, path: Path) -> None:
        mesh = self.mesh
        arrays = {
            "V": mesh.V,
            "T" if hasattr(mesh, "T") else "F": elements(mesh),
            "image": self.image,
            "ratios": self.distortion.ratios,
            "ring_ratios": self.distortion.ring_ratios,
            **self.extra_arrays(),
        }
        if self.torus is not None:
            arrays["torus"] = np.array([self.torus.R, self.torus.r])
        meta = json.dumps(self.to_dict(history=True), allow_nan=False)
        with atomic_path(path) as temporary, open(temporary, "wb") as file:
            np.savez(file, meta=np.array(meta), **arrays)


def corner_turns(faces: NDArray[np.int32], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3, 2) chart coordinates of the corners of each face in turns, each face in one piece."""
    turns = angles[faces] / TWO_PI
    first = turns[:, :1] % 1.0
    step = turns - turns[:, :1]
    return first + step - np.round(step)


def elements(mesh: TriMesh | TetMesh) -> NDArray[np.int32]:
    """``T`` of a tet mesh, ``F`` of a triangle mesh."""
    return mesh.T if hasattr(mesh, "T") else mesh.F
