"""What every result shares: iteration records, the table, JSON, and map files that come back.

A map file is an ``.npz`` with ``V``, ``F`` or ``T``, ``image`` (n, 3), ``torus`` (2,) with R and r
where there is one, further named arrays, and ``meta``, a JSON text of all scalars, the history and
the versions. Every writer here writes to a temporary file first and renames it, so a failure leaves
no file behind.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._arrays import as_points
from ._output import atomic_path, plain, table, versions
from .coordinates import CarriesPoints
from .errors import FileFormatError
from .torus import TWO_PI, Torus

if TYPE_CHECKING:
    from .measures import Distortion
    from .mesh import TetMesh, TriMesh

__all__ = [
    "IterationRecord",
    "LoadedMap",
    "MapResult",
    "atomic_path",
    "load_map",
    "plain",
    "table",
    "versions",
]

NAN = math.nan


@dataclass(frozen=True)
class IterationRecord:
    """One step of an iteration; what a method does not compute stays NaN (``flips`` -1).

    Attributes
    ----------
    stage : str
        ``"sem"``, ``"newton"``, ``"vsem"``, ``"untangle"``, ...
    iteration : int
        Counted from 0 (the start) within the stage.
    energy : float
        Value of what the stage minimises.
    step : float
        Length of the step or of the line search.
    residual : float
        Gradient norm or whatever the stage stops on.
    flips : int
        Number of elements with the wrong sign.
    ring_sd, element_sd : float
        Standard deviation of the per-vertex ratios (6.3)/(6.5) and of the per-element ratios.
    seconds : float
        Since the start of the stage.
    """

    stage: str
    iteration: int
    energy: float = NAN
    step: float = NAN
    residual: float = NAN
    flips: int = -1
    ring_sd: float = NAN
    element_sd: float = NAN
    seconds: float = NAN


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
            "ring_sd": d.ring_sd,
            "element_mad": d.element_mad,
            "element_sd": d.element_sd,
            "element_abs_sd": d.element_abs_sd,
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
        from . import io

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


@dataclass(frozen=True, eq=False)
class LoadedMap(MapResult):
    """A map read back from a file, whoever wrote it.

    Attributes
    ----------
    solid, surface : TetMesh or TriMesh, or None
        The source mesh; one of them is None.
    image : ndarray, shape (n, 3)
    torus : Torus or None
        None when the file names none.
    arrays : dict
        All further arrays of the file.
    meta : dict
        The scalars stored with it; empty for a file of another program.
    history, converged, stop_reason, seconds
        As in the result that was saved.
    """

    solid: TetMesh | None
    surface: TriMesh | None
    image: NDArray[np.float64]
    torus: Torus | None
    arrays: dict[str, NDArray[Any]] = field(repr=False)
    meta: dict[str, Any] = field(repr=False)
    history: tuple[IterationRecord, ...] = field(repr=False)
    converged: bool
    stop_reason: str
    seconds: Mapping[str, float]

    @property
    def title(self) -> str:  # type: ignore[override]
        """Kind of map, as stored."""
        return str(self.meta.get("kind", "map"))

    @property
    def distortion(self) -> Distortion:  # type: ignore[override]
        """Measured anew from the mesh and the image."""
        from .measures import distortion

        angles = self.arrays.get("angles")
        torus = self.torus if angles is None else None
        return distortion(self.mesh, self.image, torus=torus, angles=angles)

    @cached_property
    def target(self) -> TetMesh | None:
        """The solid mapped to; None if the file holds no registration."""
        from .mesh import TetMesh

        if "target_V" not in self.arrays or "target_T" not in self.arrays:
            return None
        return TetMesh(self.arrays["target_V"], self.arrays["target_T"])

    def to_dict(self, history: bool = False) -> dict[str, Any]:
        """As `MapResult.to_dict`, with what else the file says, but for its certificate."""
        found = super().to_dict(history)
        known = (*found, "history", "certified", "certificate")
        return found | {name: value for name, value in self.meta.items() if name not in known}

    def extra_arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays the file held beyond the common ones."""
        return {k: a for k, a in self.arrays.items() if k not in ("ratios", "ring_ratios")}


def load_map(path: str | os.PathLike[str]) -> LoadedMap:
    """Read a map file written by :meth:`MapResult.save` or by somebody else.

    Parameters
    ----------
    path : path-like
        An ``.npz`` with ``V (n, 3)``, ``F`` or ``T``, and ``image (n, 3)``.

    Raises
    ------
    FileFormatError
        If the file is not such an ``.npz``.
    MeshError
        If the mesh in it is invalid, or the image not finite.
    OSError
        If it cannot be opened.
    """
    from .mesh import TetMesh, TriMesh

    with open(path, "rb") as stream:
        if not zipfile.is_zipfile(stream):
            raise FileFormatError(f"{path} is not a readable .npz file")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"{path} is not a readable .npz file: {error}") from None
    if "V" in arrays and "image" not in arrays and ("F" in arrays or "T" in arrays):
        raise FileFormatError(f"{path} holds a mesh and no image of it: it has to be mapped first")
    missing = [key for key in ("V", "image") if key not in arrays]
    if missing or ("F" in arrays) == ("T" in arrays):
        raise FileFormatError(f"{path} must hold V, image and either F or T; it has {list(arrays)}")
    meta = _read_meta(path, arrays.pop("meta", None))
    V, image = arrays.pop("V"), as_points(arrays.pop("image"), "image")
    if image.shape != V.shape:
        raise FileFormatError(f"{path}: image has shape {image.shape}, V {V.shape}")
    solid = TetMesh(V, arrays.pop("T")) if "T" in arrays else None
    surface = TriMesh(V, arrays.pop("F")) if "F" in arrays else None
    radii = arrays.pop("torus", None)
    if radii is not None and radii.shape != (2,):
        raise FileFormatError(f"{path}: torus must hold R and r, it has shape {radii.shape}")
    return LoadedMap(
        solid=solid,
        surface=surface,
        image=image,
        torus=None if radii is None else Torus(*radii),
        arrays=arrays,
        meta=meta,
        history=_read_history(path, meta.get("history", [])),
        converged=bool(meta.get("converged", False)),
        stop_reason=str(meta.get("stop_reason", "read from a file")),
        seconds=meta.get("seconds", {}),
    )


def _read_meta(path: object, meta: NDArray[Any] | None) -> dict[str, Any]:
    if meta is None:
        return {}
    try:
        value = json.loads(str(meta))
    except ValueError as error:
        raise FileFormatError(f"{path}: meta is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise FileFormatError(f"{path}: meta is not a JSON object")
    return value


def _read_history(path: object, records: Any) -> tuple[IterationRecord, ...]:
    names = [f.name for f in dataclasses.fields(IterationRecord)]
    try:
        return tuple(
            IterationRecord(**{k: NAN if record[k] is None else record[k] for k in names})
            for record in records
        )
    except (TypeError, KeyError, AttributeError) as error:
        raise FileFormatError(f"{path}: the history in meta cannot be read: {error!r}") from None


def corner_turns(faces: NDArray[np.int32], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3, 2) chart coordinates of the corners of each face in turns, each face in one piece."""
    turns = angles[faces] / TWO_PI
    first = turns[:, :1] % 1.0
    step = turns - turns[:, :1]
    return first + step - np.round(step)


def elements(mesh: TriMesh | TetMesh) -> NDArray[np.int32]:
    """``T`` of a tet mesh, ``F`` of a triangle mesh."""
    return mesh.T if hasattr(mesh, "T") else mesh.F
