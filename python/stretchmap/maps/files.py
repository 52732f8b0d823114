"""Map files that come back."""

from __future__ import annotations

import json
import os
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import as_points, as_reals
from ..base.files import open_to_read, parsing
from ..base.options import as_path
from ..base.torus import Torus
from ..errors import FileFormatError, MeshError, OptionError
from ..io.npz import read_archive
from ..io.reading import read_arrays
from ..mesh.meshes import TetMesh, TriMesh
from .fields import OF_MAPS, carried
from .meta import read_history, read_meta
from .result import MapResult

__all__ = ["LoadedMap", "load_map"]

_VIEWERS = (".vtu", ".vtk", ".xdmf")


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
    image, angles, history, converged, stop_reason, seconds, point_fields, cell_fields
        As in the result that was saved.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> result = sm.area_map(sm.samples.torus_surface(24, 12))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     result.save(os.path.join(folder, "map.npz"))
    ...     loaded = sm.load_map(os.path.join(folder, "map.npz"))
    >>> loaded.title, loaded.torus == result.torus, sorted(loaded.arrays)
    ('area', True, ['angles', 'forms', 'ratios', 'ring_ratios'])
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
        An ``.npz`` with ``V (n, 3)``, ``F`` or ``T``, and ``image (n, 3)``; or ``.vtu``, ``.vtk``
        or ``.xdmf`` with point data ``image`` and, where it is a map to a torus, ``torus``. Those
        say whether it converged, and hold no history, stop reason or seconds.

    Returns
    -------
    LoadedMap

    Raises
    ------
    FileFormatError
        If the file is none of these.
    MissingDependencyError
        If it is for viewers and meshio is not installed.
    MeshError
        If the mesh in it is invalid, or the image not finite.
    OSError
        If it cannot be opened.

    Examples
    --------
    A file of another program:

    >>> import os, tempfile
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "map.npz")
    ...     np.savez(path, V=solid.V, T=solid.T, image=2.0 * solid.V)
    ...     loaded = sm.load_map(path)
    >>> loaded.distortion.flips, loaded.torus is None
    (0, True)
    """
    path = as_path(path)
    viewer = path.suffix.lower() in _VIEWERS
    arrays = _of_viewer(path) if viewer else _of_archive(path)
    with parsing(path):
        if "V" in arrays and "image" not in arrays and ("F" in arrays or "T" in arrays):
            raise FileFormatError("it holds a mesh and no image of it: it has to be mapped first")
        if not {"V", "image"} <= arrays.keys() or ("F" in arrays) == ("T" in arrays):
            raise FileFormatError(
                f"V, image and either F or T are needed, it has {', '.join(arrays) or 'nothing'}"
            )
        meta = read_meta(arrays.pop("meta", None))
        history = read_history(meta)
        V, image = arrays.pop("V"), as_points(arrays.pop("image"), "image")
        if image.shape != V.shape:
            raise FileFormatError(f"image has shape {image.shape}, V {V.shape}")
        mesh = TetMesh(V, arrays.pop("T")) if "T" in arrays else TriMesh(V, arrays.pop("F"))
        torus = _torus(arrays.pop("torus", None))
        angles = arrays.get("angles")
        if angles is not None:
            angles = arrays["angles"] = as_reals(angles, "angles", (len(V), 2))
        target = _target(arrays)
        points, cells = _fields(arrays, "point:"), _fields(arrays, "cell:")
        points, cells = carried(mesh, None, points, cells)
    return LoadedMap(
        mesh=mesh,
        image=image,
        torus=torus,
        target=target,
        angles=angles,
        arrays=arrays,
        meta=meta,
        history=history,
        converged=meta.get("converged", False),
        stop_reason=meta.get("stop_reason", "the file does not say"),
        seconds=meta.get("seconds", {}),
        point_fields=points,
        cell_fields=cells,
    )


def _of_archive(path: Path) -> dict[str, NDArray[Any]]:
    with open_to_read(path) as file, parsing(path):
        if path.suffix.lower() != ".npz" and not zipfile.is_zipfile(file):
            raise FileFormatError(
                f"it is no .npz archive, and of other files only {', '.join(_VIEWERS)} hold both "
                "ends of a map; save it as one of these"
            )
        return read_archive(file)


def _of_viewer(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a map saved for viewers, as those of an archive."""
    found = read_arrays(path)
    arrays = {"V": found.V, "F" if found.T is None else "T": found.elements}
    for data, prefix in ((found.point_data, "point:"), (found.cell_data, "cell:")):
        for name, array in data.items():
            if name in ("image", "parent_tet"):
                arrays[name] = array
            elif name == "angles" and array.ndim == 2:  # .vtk adds a column of zeros
                arrays[name] = array[:, :2]
            elif name == "torus":
                if array.ndim != 2 or (array != array[0]).any():
                    with parsing(path):
                        raise FileFormatError("the radii of the torus differ from row to row")
                arrays[name] = array[0, :2]
            elif name == "converged":
                arrays["meta"] = np.array(json.dumps({name: bool(array.all())}))
            elif name not in OF_MAPS:
                arrays[prefix + name] = array
    return arrays


def _fields(arrays: dict[str, NDArray[Any]], prefix: str) -> dict[str, NDArray[Any]]:
    names = [name for name in arrays if name.startswith(prefix)]
    return {name[len(prefix) :]: arrays.pop(name) for name in names}


def _target(arrays: dict[str, NDArray[Any]]) -> TetMesh | None:
    if "target_V" not in arrays or "target_T" not in arrays:
        return None
    return TetMesh(arrays["target_V"], arrays["target_T"])


def _torus(radii: NDArray[Any] | None) -> Torus | None:
    if radii is None:
        return None
    try:
        return Torus(*as_reals(radii, "torus", (2,)))
    except (MeshError, OptionError) as error:
        raise FileFormatError(str(error)) from None
