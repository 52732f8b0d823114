"""The one place that talks to meshio, for the formats of solids.

meshio exits the interpreter on some bad files, prints, leaves out cells a format cannot hold, and
returns arrays in the file's byte order. Here its readers are called by format and never by
guesswork, every way out of them becomes an exception, its output is caught, and cells that
stretchmap cannot use are named.
"""

from __future__ import annotations

import contextlib
import io
import logging
import mmap
import re
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, MissingDependencyError
from .arrays import MeshArrays
from .cells import Block, simplices

_log = logging.getLogger("stretchmap")
# Standard output and the filters of warnings belong to the process: who restores them last would
# restore what another thread has put there.
_one_at_a_time = threading.Lock()

# Number of cells in the text of a file.
_ANNOUNCED = {
    "vtk": rb"(?m)^CELL_TYPES[ \t]+(\d{1,18})\b",
    "vtu": rb"NumberOfCells=[\"'](\d{1,18})[\"']",
}
# What opens the list of points.
_ONCE = {"medit": rb"(?m)^[ \t]*Vertices\b", "gmsh": rb"(?m)^\$Nodes\b"}


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
    MissingDependencyError
        meshio, or what it needs for this format, is not installed.
    """
    meshio = _import(f"reading {path.suffix} files")
    with _guarded(path):
        mesh = meshio._helpers.reader_map[file_format](str(path))
    _require_all(path, file_format, sum(len(block.data) for block in mesh.cells))
    blocks = []
    for b, block in enumerate(mesh.cells):
        data = {name: _native(parts[b]) for name, parts in mesh.cell_data.items()}
        blocks.append(Block(block.type, np.asarray(block.data), data))
    point_data = {name: _native(array) for name, array in mesh.point_data.items()}
    return simplices(np.asarray(mesh.points), blocks, point_data)


def write_meshio(path: Path, mesh: MeshArrays, file_format: str) -> None:
    """Write a mesh in one of meshio's formats."""
    meshio = _import(f"writing {path.suffix} files")
    kind = "triangle" if mesh.T is None else "tetra"
    options: dict[str, Any] = {"data_format": "XML"} if file_format == "xdmf" else {}
    with _guarded(path, (OSError, MemoryError)):
        out = meshio.Mesh(
            mesh.V,
            [(kind, mesh.elements)],
            point_data={k: _plain(a) for k, a in mesh.point_data.items()},
            cell_data={k: [_plain(a)] for k, a in mesh.cell_data.items()},
        )
        meshio._helpers._writer_map[file_format](str(path), out, **options)


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
        raise FileFormatError(f"{announced} cells are announced, {found} can be understood")


def _native(array: Any) -> NDArray[Any]:
    """In the machine's byte order, not the file's."""
    found: NDArray[Any] = np.asarray(array)
    return found.astype(found.dtype.newbyteorder("="), copy=False)


def _plain(array: NDArray[Any]) -> NDArray[Any]:
    return array.astype(np.uint8) if array.dtype.kind == "b" else array


def _import(task: str) -> Any:
    try:
        import meshio
    except ImportError as error:
        raise MissingDependencyError(
            f"{task} needs meshio: pip install 'stretchmap[io]'"
        ) from error
    return meshio


@contextlib.contextmanager
def _guarded(path: Path, system: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Catch what meshio prints and every way it fails, but for what is no fault of the file."""
    output = io.StringIO()
    try:
        with (
            _one_at_a_time,
            contextlib.redirect_stdout(output),
            contextlib.redirect_stderr(output),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", message=".*could not be read to its end.*")
            yield
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            f"{path.suffix} files need {error.name}: pip install 'stretchmap[io]'"
        ) from error
    except system:
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FileFormatError(reason) from error
    finally:
        if output.getvalue().strip():
            _log.debug("meshio on %s: %s", path, output.getvalue().strip())
