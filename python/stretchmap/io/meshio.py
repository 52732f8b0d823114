"""The one place that talks to meshio, for the formats of solids.

meshio exits the interpreter on some bad files, prints, leaves out cells a format cannot hold, and
returns arrays in the file's byte order. Here its readers are called by format and never by
guesswork, every way out of them becomes an exception, what they print goes to the log, and cells
that stretchmap cannot use are named. Nothing of the process is changed meanwhile: other threads
print, warn and read files as ever.
"""

from __future__ import annotations

import contextlib
import logging
import mmap
import re
import threading
import warnings
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, MissingDependencyError
from ..mesh.cells import Block, simplices, vertex_ids
from .arrays import MeshArrays
from .storable import GMSH_TAGS

_log = logging.getLogger("stretchmap")
# Whether meshio works for us, and not for the user, in the thread at hand.
_ours: ContextVar[bool] = ContextVar("ours", default=False)
# NumPy 2.4 raises where the text of a file ends too early; before it only warned.
_NUMPY_RAISES = np.lib.NumpyVersion(np.__version__) >= "2.4.0"
_filters = threading.Lock()  # of warnings: there is one list of them for all threads

# Number of cells in the text of a file.
_ANNOUNCED = {
    "vtk": rb"(?m)^CELL_TYPES[ \t]+(\d{1,18})\b",
    "vtu": rb"NumberOfCells=[\"'](\d{1,18})[\"']",
}
# What a file should be, where meshio gives up on it without a reason.
_FORMATS = {
    "gmsh": "in Gmsh's format",
    "medit": "in Medit's text format",
    "vtk": "in VTK's legacy format",
    "vtu": "an unstructured grid in VTK's XML format",
    "xdmf": "in the format XDMF",
}
# Characters of names that VTK does not encode in its .vtk files.
_PRINTED = "".join(chr(code) for code in range(33, 127) if chr(code) not in '"%')
# What opens the list of points.
_ONCE = {"medit": rb"(?m)^[ \t]*Vertices\b", "gmsh": rb"(?m)^\$Nodes\b"}


class UnknownCellsError(FileFormatError):
    """meshio has passed over cells, whose types it does not know or which are not there."""


def read_meshio(path: Path, file_format: str) -> MeshArrays:
    """Read a file in one of meshio's formats.

    Parameters
    ----------
    path : Path
    file_format : str
        meshio's name of the format.

    Returns
    -------
    MeshArrays
        ``T`` when there are tets, ``F`` when there are triangles.

    Raises
    ------
    FileFormatError
        The file cannot be parsed or holds other cells.
    UnknownCellsError
        It announces more cells than meshio has found.
    MissingDependencyError
        meshio, or what it needs for this format, is not installed.
    """
    meshio = _import(f"reading {path.suffix} files")
    with _guarded(path, f"it is damaged, or not {_FORMATS[file_format]} as meshio reads it"):
        mesh = meshio._helpers.reader_map[file_format](str(path))
    _require_all(path, file_format, sum(len(block.data) for block in mesh.cells))
    read_as = unquote if file_format == "vtk" else str
    blocks = []
    for b, block in enumerate(mesh.cells):
        data = {read_as(name): _native(parts[b]) for name, parts in mesh.cell_data.items()}
        blocks.append(Block(block.type, vertex_ids(block.type, block.data), data))
    point_data = {read_as(name): _native(array) for name, array in mesh.point_data.items()}
    return MeshArrays.of(simplices(np.asarray(mesh.points), blocks, point_data))


def write_meshio(path: Path, mesh: MeshArrays, file_format: str) -> None:
    """Write a mesh, with data that the format can hold, in one of meshio's formats."""
    meshio = _import(f"writing {path.suffix} files")
    kind = "triangle" if mesh.T is None else "tetra"
    options: dict[str, Any] = {"data_format": "XML"} if file_format == "xdmf" else {}
    cell_data = mesh.cell_data
    if file_format == "gmsh" and not cell_data.keys().isdisjoint(GMSH_TAGS):
        # Of version 4.1 meshio writes regions only where each has points of its own.
        file_format, cell_data = "gmsh22", _with_both_tags(cell_data)
    with _guarded(path, "meshio fails without a reason", (OSError, MemoryError)):
        out = meshio.Mesh(
            mesh.V,
            [(kind, mesh.elements)],
            point_data={_written(file_format, k): a for k, a in mesh.point_data.items()},
            cell_data={_written(file_format, k): [a] for k, a in cell_data.items()},
        )
        meshio._helpers._writer_map[file_format](str(path), out, **options)


def _with_both_tags(cell_data: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The physical groups for the entities where these are not given, and the other way round:
    Gmsh takes the elements of an entity together."""
    tags = [cell_data[name].reshape(-1) for name in GMSH_TAGS if name in cell_data]
    return {**cell_data, **dict(zip(GMSH_TAGS, (tags[0], tags[-1]), strict=True))}


def _written(file_format: str, name: str) -> str:
    """A name as it stands in a file, where meshio does not see to that."""
    if file_format == "vtu":
        return escape(name, {'"': "&quot;"}).encode("ascii", "xmlcharrefreplace").decode()
    if file_format == "vtk":  # as VTK does
        return "%4DETADATA" if name == "METADATA" else quote(name, _PRINTED)
    return name


def _require_all(path: Path, file_format: str, found: int) -> None:
    """Raise where cells are missing, since meshio passes over those of a type it does not know, or
    where points come twice, of which it takes the last."""
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        once = _ONCE.get(file_format)
        if once is not None and len(re.findall(once, data)) > 1:
            raise FileFormatError("it holds two lists of points")
        pattern = _ANNOUNCED.get(file_format)
        if pattern is None:
            return
        announced = sum(int(count) for count in re.findall(pattern, data))
    if announced != found:
        raise UnknownCellsError(f"{announced} cells are announced, {found} can be understood")


def _native(array: Any) -> NDArray[Any]:
    """In the machine's byte order, not the file's."""
    found: NDArray[Any] = np.asarray(array)
    return found.astype(found.dtype.newbyteorder("="), copy=False)


def _import(task: str) -> Any:
    try:
        import meshio
    except ImportError as error:
        raise MissingDependencyError(
            f"{task} needs meshio: pip install 'stretchmap[io]'"
        ) from error
    common = meshio._common
    if not isinstance(common.Console, _Console):
        common.Console = _Console(common.Console)
    return meshio


class _Console:
    """What meshio prints by: the log where it works for us, else what it has printed by so far."""

    def __init__(self, other: Any) -> None:
        self._other = other

    def __call__(self, *args: Any, **options: Any) -> Any:
        return _Log() if _ours.get() else self._other(*args, **options)


class _Log:
    def print(self, text: str, **_: Any) -> None:
        _log.debug("meshio: %s", re.sub(r"\[/?[a-z]+\]", "", text))


@contextlib.contextmanager
def _guarded(path: Path, unsaid: str, system: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Log what meshio prints; catch every way it fails, but for what is no fault of the file. Where
    it does not say why, or by a byte alone, the reason is ``unsaid``."""
    mark = _ours.set(True)
    try:
        with np.errstate(all="ignore"), _to_the_end():
            yield
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            f"{path.suffix} files need {error.name}: pip install 'stretchmap[io]'"
        ) from error
    except system:
        raise
    except (Exception, SystemExit) as error:
        silent = isinstance(error, (SystemExit, UnicodeDecodeError))
        reason = "" if silent else " ".join(str(error).split())
        raise FileFormatError(reason or unsaid) from error
    finally:
        _ours.reset(mark)


@contextlib.contextmanager
def _to_the_end() -> Iterator[None]:
    """Have NumPy raise where the text of a file ends too early."""
    if _NUMPY_RAISES:
        yield
        return
    with _filters, warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*could not be read to its end.*")
        yield
