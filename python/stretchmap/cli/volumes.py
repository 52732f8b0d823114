"""Commands that map solids: volume, fill."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import common
from .common import Compact, Input, Json, Orient, Output, Quiet, Threads
from .results import Balance, MaxIter, Phase, Ratio, conclude, parsed_ratio

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..maps.files import LoadedMap
    from ..mesh.meshes import TetMesh


class Method(str, Enum):
    """Values of ``--method``."""

    certified = "certified"
    vsem = "vsem"


class Boundary(str, Enum):
    """Values of ``--boundary``."""

    glide = "glide"
    frozen = "frozen"


class Solver(str, Enum):
    """Values of ``--solver``."""

    auto = "auto"
    direct = "direct"
    multigrid = "multigrid"
    jacobi = "jacobi"
    cholmod = "cholmod"


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    for command in (volume, fill):
        app.command()(command)


def volume(
    input: Input,
    output: Output,
    method: Annotated[
        Method | None,
        typer.Option(help="certified (default) or, the default with --c, vsem (Algorithm 5.1)."),
    ] = None,
    boundary: Annotated[
        Boundary | None, typer.Option(help="Let boundary vertices glide (default) or freeze them.")
    ] = None,
    c: Annotated[
        float | None, typer.Option("--c", help="Regularisation (5.6) of vsem, dimensionless.")
    ] = None,
    balance: Balance = None,
    max_iter: MaxIter = None,
    tol: Annotated[
        float | None,
        typer.Option(help="Stop when a step lowers the energy by no more than this share."),
    ] = None,
    ratio: Ratio = None,
    phase: Phase = None,
    start: Annotated[
        Path | None, typer.Option(help="Go on from this map file of the same solid.")
    ] = None,
    vertex_exact: Annotated[
        bool, typer.Option("--vertex-exact", help="In the end make interior ring volumes exact.")
    ] = False,
    refine: Annotated[
        bool, typer.Option(help="Split interior edges and faces the boundary alone decides about.")
    ] = True,
    keep_best: Annotated[
        bool,
        typer.Option(
            "--keep-best", help="Write the best map even if it is not certified; exit code 1."
        ),
    ] = False,
    solver: Annotated[Solver, typer.Option(help="Linear solver.")] = Solver.auto,
    threads: Threads = None,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> int:
    """Map a solid onto the solid torus.

    Volumes are preserved, no tet is flipped, and the map is certified to be one to one.
    """
    from ..base.progress import terminal
    from ..maps.files import load_map
    from ..volume.map import volume_map
    from ..volume.options import VolumeOptions

    common.check_outputs(output, common.map_suffixes(), json)
    watch = common.Stopwatch()
    route: dict[str, Any] = {
        "method": None if method is None else method.value,
        "boundary": None if boundary is None else boundary.value,
    }
    options = VolumeOptions(
        ratio=parsed_ratio(ratio), phase=phase, tol=tol, vertex_exact=vertex_exact, refine=refine,
        solver=solver.value,
    )  # fmt: skip
    mesh, fields = common.read_with_fields(input, orient, compact)
    solid = common.require_solid(mesh, input, "volume")
    if start is not None:
        route["start"] = resumed(solid, load_map(start), start)
        solid = route["start"].mesh
        fields = route["start"].point_fields, route["start"].cell_fields
    fields = common.check_fields(output, solid, fields)
    watch.lap("read")
    with terminal(quiet) as bar:
        result = volume_map(
            solid, c=c, balance=balance, max_iter=max_iter, options=options, keep_best=keep_best,
            threads=threads, progress=bar, **route,
        )  # fmt: skip
    watch.lap(**result.seconds)
    return conclude(result.with_fields(*fields), output, json, quiet, watch)


def fill(
    input: Input,
    boundary: Annotated[
        Path,
        typer.Option(
            help="An .npz with ids (nb,), the boundary vertices, and image (nb, 3), where they go."
        ),
    ],
    output: Output,
    refine: Annotated[
        bool, typer.Option(help="Split interior edges and faces the boundary alone decides about.")
    ] = True,
    keep_best: Annotated[
        bool,
        typer.Option(
            "--keep-best", help="Write the best map even if it is not certified; exit code 1."
        ),
    ] = False,
    threads: Threads = None,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> int:
    """Map a solid whose boundary is prescribed.

    One to one, of any genus.
    """
    from ..base.progress import terminal
    from ..volume.fill import fill as fill_solid
    from ..volume.options import FillOptions

    common.check_outputs(output, common.map_suffixes(), json)
    watch = common.Stopwatch()
    mesh, fields = common.read_with_fields(input, orient, compact)
    solid = common.require_solid(mesh, input, "fill")
    fields = common.check_fields(output, solid, fields)
    image = prescribed_image(solid, boundary)
    watch.lap("read")
    with terminal(quiet) as bar:
        result = fill_solid(
            solid, image, options=FillOptions(refine=refine), keep_best=keep_best,
            threads=threads, progress=bar,
        )  # fmt: skip
    watch.lap(**result.seconds)
    return conclude(result.with_fields(*fields), output, json, quiet, watch)


def prescribed_image(solid: TetMesh, path: Path) -> NDArray[np.float64]:
    """The rows of a boundary file in the order of the solid's boundary vertices."""
    import numpy as np

    from ..base.arrays import as_integers, as_points
    from ..base.files import open_to_read, parsing
    from ..errors import ArrayError, FileFormatError
    from ..io.npz import read_archive

    with open_to_read(path) as file, parsing(path):
        arrays = read_archive(file)
    if not {"ids", "image"} <= arrays.keys():
        raise FileFormatError(f"{path} must be an .npz with ids (nb,) and image (nb, 3)")
    ids = as_integers(arrays["ids"].ravel(), f"ids of {path}", (None,))
    image = as_points(arrays["image"], f"image of {path}")
    if len(image) != len(ids):
        raise ArrayError(f"{path}: image has {len(image)} rows, ids {len(ids)} entries")
    order = np.argsort(ids)
    if not np.array_equal(ids[order], solid.boundary_vertices):
        raise ArrayError(
            f"{path}: ids must be the {len(solid.boundary_vertices)} boundary vertices of the "
            "solid, each once",
            np.setxor1d(ids, solid.boundary_vertices),
        )
    return np.ascontiguousarray(image[order])


def resumed(solid: TetMesh, loaded: LoadedMap, path: Path) -> LoadedMap:
    """The map to go on from.

    A map file holds the mesh that was mapped: where the input had to be refined, its refinement,
    whose first vertices are those of the input. Then that mesh is gone on with.
    """
    import numpy as np

    from ..errors import MeshError
    from ..mesh.meshes import TetMesh

    n, mesh = solid.n_vertices, loaded.mesh
    if not isinstance(mesh, TetMesh) or loaded.torus is None:
        raise MeshError(f"{path} is no map of a solid onto a solid torus with known radii")
    if not np.array_equal(mesh.V[:n], solid.V):
        raise MeshError(f"{path} is not a map of this solid: its vertices are others")
    if mesh.n_vertices == n and not np.array_equal(mesh.T, solid.T):
        raise MeshError(f"{path} is not a map of this solid: its tets are others")
    return loaded
