"""Arguments and options the commands share, and the files they read and write."""

from __future__ import annotations

import errno
import importlib.util
import json
import logging
import os
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import ArrayError, FileFormatError, MeshError, MissingDependencyError, OptionError
from .replacing import Written

if TYPE_CHECKING:
    from ..mesh.meshes import TetMesh, TriMesh

_log = logging.getLogger("stretchmap")

_MESH = "Mesh: .npz (V with F or T) .obj .off .ply .stl .msh .vtu .vtk .mesh .xdmf .vtp .glb .3mf"
_MAP = "Map file: .npz with V, F or T, and image; .vtu, .vtk, .xdmf as written for viewers."

Input = Annotated[Path, typer.Argument(metavar="INPUT", help=_MESH, show_default=False)]
MapFile = Annotated[
    Path,
    typer.Argument(
        metavar="MAP",
        help=_MAP,
        show_default=False,
    ),
]
_OUTPUT = typer.Option("-o", "--output", help="File to write.", show_default=False)
Output = Annotated[Path, _OUTPUT, Written()]
Json = Annotated[Path | None, typer.Option("--json", help="Write the figures as JSON."), Written()]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No table and no progress bar.")]
Orient = Annotated[bool, typer.Option("--orient", help="Turn elements oriented the wrong way.")]
Threads = Annotated[
    int | None,
    typer.Option(
        help="Threads to use; the result depends on it only where time runs short.",
        show_default=False,
    ),
]
Compact = Annotated[bool, typer.Option("--compact", help="Drop points that no element uses.")]


# Data of points and of cells, by name.
Fields = tuple[dict[str, Any], dict[str, Any]]


class Stopwatch:
    """Seconds by stage, in the order of the laps."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = {}
        self._start = self._lap = time.perf_counter()

    def lap(self, *stages: str, **measured: float) -> None:
        """Book the time since the last lap on a stage, or what was measured of it elsewhere."""
        now = time.perf_counter()
        self._seconds |= dict.fromkeys(stages, now - self._lap) | measured
        self._lap = now

    def seconds(self) -> dict[str, float]:
        """Seconds of every stage, and the total."""
        return {**self._seconds, "total": time.perf_counter() - self._start}


def read_mesh(path: Path, orient: bool = False, compact: bool = False) -> TriMesh | TetMesh:
    """Read a mesh and say what was repaired."""
    from .. import io

    mesh = io.read(path, orient=orient, compact=compact)
    if mesh.n_turned:
        _log.warning("%s: %d elements turned", path, mesh.n_turned)
    return mesh


def read_with_fields(path: Path, orient: bool, compact: bool) -> tuple[TriMesh | TetMesh, Fields]:
    """As `read_mesh`, and the data of its points and cells."""
    from .. import io
    from ..maps.fields import is_saved
    from ..mesh.meshes import TetMesh, TriMesh

    arrays = io.read_arrays(path)
    make = TriMesh if arrays.T is None else TetMesh
    mesh: TriMesh | TetMesh = make(arrays.V, arrays.elements, orient=orient)
    if mesh.n_turned:
        _log.warning("%s: %d elements turned", path, mesh.n_turned)
    points = arrays.point_data
    if compact:
        mesh, kept = mesh.compact()
        points = {name: array[kept] for name, array in points.items()}
    # Of what a map holds itself the new one has its own.
    saved = is_saved([*points, *arrays.cell_data, *arrays.extra])
    return mesh, (_carried(points, saved), _carried(arrays.cell_data, saved))


def _carried(data: Mapping[str, Any], saved: bool) -> dict[str, Any]:
    """Numbers, but for those of a map that was saved."""
    from ..maps.fields import OF_MAPS

    numbers = {k: a for k, a in data.items() if a.dtype.kind in "biuf" and a.ndim in (1, 2)}
    return {k: a for k, a in numbers.items() if not (saved and k in OF_MAPS)}


def surface_of(mesh: TriMesh | TetMesh) -> TriMesh:
    """A surface itself, of a solid its boundary."""
    from ..mesh.meshes import TetMesh

    if not isinstance(mesh, TetMesh):
        return mesh
    mesh.diagnose().require()
    return mesh.surface


def surface_with_fields(
    mesh: TriMesh | TetMesh, fields: Fields, path: Path
) -> tuple[TriMesh, Fields]:
    """`surface_of` with the data of its points; of a solid's tets its boundary has none, which a
    warning says."""
    from ..base.options import shown
    from ..mesh.meshes import TetMesh

    surface = surface_of(mesh)
    if not isinstance(mesh, TetMesh):
        return surface, fields
    points, cells = fields
    if cells:
        names = ", ".join(map(shown, cells))
        _log.warning("%s: the boundary is mapped, which has no tets; left out: %s", path, names)
    ids = mesh.boundary_vertices
    return surface, ({name: array[ids] for name, array in points.items()}, {})


def check_fields(output: Path, mesh: TriMesh | TetMesh, fields: Fields) -> Fields:
    """The fields a map of the mesh carries, if its file can hold them: :func:`check_output`.

    Raises
    ------
    ArrayError
        It cannot.
    """
    from ..maps.fields import carried
    from ..maps.writing import require_storable

    own = carried(mesh, None, *fields)
    try:
        require_storable(output, mesh, *own)
    except ArrayError as error:
        raise ArrayError(f"{output}: {error}") from error
    return own


def require_solid(mesh: TriMesh | TetMesh, path: Path, command: str) -> TetMesh:
    """The mesh, if it is a solid.

    Raises
    ------
    MeshError
        If it is a surface; says how to fill it.
    """
    from ..mesh.meshes import TetMesh

    if isinstance(mesh, TetMesh):
        return mesh
    raise MeshError(
        f"{path} holds a surface, '{command}' needs a solid: fill it with tets first, "
        f"stretchmap tet {path} -o {path.with_suffix('.npz').name}"
    )


def check_output(path: Path, allowed: tuple[str, ...]) -> None:
    """Refuse an output that could not be written, before anything is computed.

    Parameters
    ----------
    path : Path
        Where the output is to go.
    allowed : tuple of str
        Suffixes that will do.

    Raises
    ------
    FileFormatError
        Another suffix.
    MissingDependencyError
        The format needs a package that is not installed.
    OptionError
        It is ``-``.
    OSError
        The folder is missing or not writable, or the path is a folder.
    """
    if str(path) == "-":
        raise OptionError("nothing is written to standard output: name a file instead of '-'")
    suffix = path.suffix.lower()
    if suffix not in allowed:
        raise FileFormatError(
            f"{path}: cannot write {suffix or 'a file without suffix'} here; "
            f"choose {', '.join(allowed)}"
        )
    if suffix in (".vtu", ".vtk", ".xdmf", ".msh", ".mesh"):
        require_package("meshio", f"writing {suffix} files", "io")
    folder = path.parent
    if not folder.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(folder))
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not _writable(folder) or (path.exists() and not _writable(path)):
        raise PermissionError(errno.EACCES, "cannot be written", str(path))


def _writable(path: Path) -> bool:
    return os.access(path, os.W_OK)


def check_outputs(output: Path, allowed: tuple[str, ...], json_path: Path | None) -> None:
    """:func:`check_output` for an output and the JSON report beside it."""
    check_output(output, allowed)
    check_json(json_path)


def check_json(path: Path | None) -> None:
    """:func:`check_output` for a JSON report, if asked for; its suffix may be any."""
    if path is not None:
        check_output(path, (path.suffix.lower(),))


def map_suffixes() -> tuple[str, ...]:
    """Suffixes a map can be saved with."""
    from ..io.formats import suffixes

    return suffixes(solid=False)


def require_package(module: str, task: str, extra: str) -> None:
    """Refuse at once what would fail later for want of a package.

    Raises
    ------
    MissingDependencyError
        With the pip line.
    """
    if importlib.util.find_spec(module) is None:
        raise MissingDependencyError(f"{task} needs {module}: pip install 'stretchmap[{extra}]'")


def write_together(
    output: Path, save: Callable[[Path], None], json_path: Path | None, report: Mapping[str, Any]
) -> None:
    """Write the output and the report, both or neither."""
    from ..base.files import atomic_path

    with ExitStack() as stack:
        if json_path is not None:
            temporary = stack.enter_context(atomic_path(json_path))
            temporary.write_text(to_json(report), encoding="utf-8")
        save(output)


def to_json(report: Mapping[str, Any]) -> str:
    """JSON text of a report; what is not finite becomes null."""
    from ..base.tables import plain

    return json.dumps(plain(report), indent=2, allow_nan=False) + "\n"


def write_json(path: Path | None, report: Mapping[str, Any]) -> None:
    """Write a report, if asked for."""
    from ..base.files import atomic_path

    if path is not None:
        with atomic_path(path) as temporary:
            temporary.write_text(to_json(report), encoding="utf-8")
