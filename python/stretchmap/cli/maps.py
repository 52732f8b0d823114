"""Commands that compute or judge maps: conformal, area, volume, certify."""

from __future__ import annotations

import logging
import zipfile
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import common
from .common import Compact, Input, Json, MapFile, Orient, Output, Quiet, Threads

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..certificate.findings import Certificate
    from ..maps.files import LoadedMap
    from ..maps.result import MapResult
    from ..mesh.meshes import TetMesh

_log = logging.getLogger("stretchmap")


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


class Finish(str, Enum):
    """Values of ``--finish``."""

    ring = "ring"
    face = "face"
    none = "none"


Ratio = Annotated[
    str | None,
    typer.Option(help="R / r of the torus: conformal, search or a number.", show_default=False),
]
Phase = Annotated[
    float | None,
    typer.Option(help="Turns around the tube; searched if left out.", show_default=False),
]
MaxIter = Annotated[int | None, typer.Option(help="Most steps.", show_default=False)]


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    for command in (conformal, area, volume, fill, certify):
        app.command()(command)


def conformal(
    input: Input,
    output: Output,
    threads: Threads = None,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> None:
    """Map a surface conformally onto a torus.

    The surface, or the boundary of the solid given, has genus one.
    """
    from ..base.threads import threads as use_threads
    from ..conformal.map import conformal_map

    common.check_outputs(output, common.map_suffixes(), json, input)
    watch = common.Stopwatch()
    mesh, fields = common.read_with_fields(input, orient, compact)
    surface, fields = common.surface_with_fields(mesh, fields)
    watch.lap("read")
    with use_threads(threads):
        result = conformal_map(surface)
    watch.lap(**result.seconds)
    conclude(result.with_fields(*fields), output, json, quiet, watch)


def area(
    input: Input,
    output: Output,
    finish: Annotated[
        Finish | None,
        typer.Option(help="Finish on the faces' areas, then on the vertex rings' (default)."),
    ] = None,
    max_iter: MaxIter = None,
    tol: Annotated[
        float | None, typer.Option(help="Goal for the SD of the face ratios.", show_default=False)
    ] = None,
    ratio: Ratio = None,
    phase: Phase = None,
    threads: Threads = None,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> None:
    """Map a surface onto a torus, areas preserved.

    The surface, or the boundary of the solid given, has genus one.
    """
    from ..area.map import area_map
    from ..base.progress import terminal

    common.check_outputs(output, common.map_suffixes(), json, input)
    watch = common.Stopwatch()
    options: dict[str, Any] = {
        "finish": None if finish is None else finish.value,
        "max_iter": max_iter,
        "tol": tol,
        "ratio": parsed_ratio(ratio),
        "phase": phase,
    }
    options = {name: value for name, value in options.items() if value is not None}
    mesh, fields = common.read_with_fields(input, orient, compact)
    surface, fields = common.surface_with_fields(mesh, fields)
    watch.lap("read")
    with terminal(quiet) as bar:
        result = area_map(surface, **options, threads=threads, progress=bar)
    watch.lap(**result.seconds)
    conclude(result.with_fields(*fields), output, json, quiet, watch)


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

    common.check_outputs(output, common.map_suffixes(), json, input)
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
    watch.lap("read")
    with terminal(quiet) as bar:
        result = volume_map(
            solid, c=c, max_iter=max_iter, options=options, keep_best=keep_best, threads=threads,
            progress=bar, **route,
        )  # fmt: skip
    watch.lap(**result.seconds)
    conclude(result.with_fields(*fields), output, json, quiet, watch)
    if result.method == "certified" and not result.certificate.certified:
        _log.error("not certified: %s; best map kept in %s", result.certificate.reason, output)
        return 1
    return 0


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

    common.check_outputs(output, common.map_suffixes(), json, input)
    watch = common.Stopwatch()
    mesh, fields = common.read_with_fields(input, orient, compact)
    solid = common.require_solid(mesh, input, "fill")
    image = prescribed_image(solid, boundary)
    watch.lap("read")
    with terminal(quiet) as bar:
        result = fill_solid(
            solid, image, options=FillOptions(refine=refine), keep_best=keep_best,
            threads=threads, progress=bar,
        )  # fmt: skip
    watch.lap(**result.seconds)
    conclude(result.with_fields(*fields), output, json, quiet, watch)
    if not result.certificate.certified:
        _log.error("not certified: %s; best map kept in %s", result.certificate.reason, output)
        return 1
    return 0


def certify(
    map_file: MapFile,
    torus: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="R r", help="Radii, if the file names none.", show_default=False),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Largest distance of the boundary from the torus, over r.")
    ] = 1e-9,
    json: Json = None,
    quiet: Quiet = False,
) -> int:
    """Prove that a map is one to one.

    Whoever wrote the file; exit code 1 if it is not.
    """
    from ..base.tables import versions
    from ..base.torus import Torus
    from ..certificate.checks import certify_file

    if json is not None:
        common.check_output(json, (json.suffix.lower(),), map_file)
    certificate = certify_file(
        map_file, None if torus is None else Torus(*torus), tolerance=tolerance
    )
    common.write_json(json, {**certificate.to_dict(), "versions": versions()})
    if not quiet:
        typer.echo(certificate.summary())
    if not certificate.certified:
        _log.error("not certified: %s", certificate.reason)
        return 1
    return 0


def parsed_ratio(ratio: str | None) -> Any:
    """``--ratio`` as the library takes it: a number where it is one."""
    try:
        return None if ratio is None else float(ratio)
    except ValueError:
        return ratio


def prescribed_image(solid: TetMesh, path: Path) -> NDArray[np.float64]:
    """The rows of a boundary file in the order of the solid's boundary vertices."""
    import numpy as np

    from ..errors import ArrayError, FileFormatError

    try:
        with np.load(path, allow_pickle=False) as file:
            ids, image = file["ids"].ravel(), np.asarray(file["image"], np.float64)
    except (KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FileFormatError(
            f"{path} must be an .npz with ids (nb,) and image (nb, 3): {error}"
        ) from None
    if image.shape != (len(ids), 3):
        raise ArrayError(f"{path}: image has shape {image.shape}, ids {len(ids)} entries")
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


def conclude(
    result: MapResult, output: Path, json_path: Path | None, quiet: bool, watch: common.Stopwatch
) -> None:
    """Certify if that has not been done, write output and report, print the table."""
    from ..base.tables import table

    report = result.to_dict(history=True)
    if "certificate" not in report:
        certificate = _certified(result)
        report |= {"certified": certificate.certified, "certificate": certificate.to_dict()}
        watch.lap("certificate")
    report["reason"] = report["certificate"]["reason"]
    report["seconds"] = watch.seconds()
    common.write_together(output, result.save, json_path, report)
    if not quiet:
        nested = ("seconds", "torus", "versions", "certificate", "history")
        rows = {name: value for name, value in report.items() if name not in nested}
        if result.torus is not None:
            rows["torus"] = f"R = {result.torus.R:.6g}, r = {result.torus.r:.6g}"
        rows |= {f"seconds, {stage}": value for stage, value in report["seconds"].items()}
        typer.echo(table(rows))
        typer.echo(f"written to {output}")


def _certified(result: MapResult) -> Certificate:
    from ..certificate.checks import certify

    return certify(result.mesh, result.image, result.torus)
