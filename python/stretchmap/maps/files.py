"""Map files that come back."""

from __future__ import annotations

import dataclasses
import json
import os
import zipfile
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import as_points
from ..base.torus import Torus
from ..errors import FileFormatError
from ..mesh.meshes import TetMesh, TriMesh
from .history import NAN, IterationRecord
from .result import MapResult

__all__ = ["LoadedMap", "load_map"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class LoadedMap(MapResult):
    """A map read back from a file, whoever wrote it.

    Attributes
    ----------
    mesh : TetMesh or TriMesh
        The source mesh.
    torus : Torus or None
        None when the file names none.
    target : TetMesh or None
        The solid mapped to, of a registration.
    arrays : dict
        All further arrays of the file.
    meta : dict
        The scalars stored with it; empty for a file of another program.
    image, angles, history, converged, stop_reason, seconds
        As in the result that was saved.
    """

    arrays: dict[str, NDArray[Any]] = field(repr=False)
    meta: dict[str, Any] = field(repr=False)

    @property
    def title(self) -> str:
        """Kind of map, as stored."""
        return str(self.meta.get("kind", "map"))

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
    mesh = TetMesh(V, arrays.pop("T")) if "T" in arrays else TriMesh(V, arrays.pop("F"))
    radii = arrays.pop("torus", None)
    if radii is not None and radii.shape != (2,):
        raise FileFormatError(f"{path}: torus must hold R and r, it has shape {radii.shape}")
    return LoadedMap(
        mesh=mesh,
        image=image,
        torus=None if radii is None else Torus(*radii),
        target=_target(arrays),
        angles=arrays.get("angles"),
        arrays=arrays,
        meta=meta,
        history=_read_history(path, meta.get("history", [])),
        converged=bool(meta.get("converged", False)),
        stop_reason=str(meta.get("stop_reason", "read from a file")),
        seconds=meta.get("seconds", {}),
    )


def _target(arrays: dict[str, NDArray[Any]]) -> TetMesh | None:
    if "target_V" not in arrays or "target_T" not in arrays:
        return None
    return TetMesh(arrays["target_V"], arrays["target_T"])


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


# Fields of records that files of version 0.1 call otherwise.
_NAMES_OF_0_1 = {"ring_sd": "ring_std", "element_sd": "element_std"}


def _read_history(path: object, records: Any) -> tuple[IterationRecord, ...]:
    names = [f.name for f in dataclasses.fields(IterationRecord)]

    def restored(record: dict[str, Any]) -> IterationRecord:
        values = {_NAMES_OF_0_1.get(name, name): value for name, value in record.items()}
        values = {name: NAN if values[name] is None else values[name] for name in names}
        return IterationRecord(**values)

    try:
        return tuple(restored(record) for record in records)
    except (TypeError, KeyError, AttributeError) as error:
        raise FileFormatError(f"{path}: the history in meta cannot be read: {error!r}") from None
