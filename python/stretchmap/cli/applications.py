"""Commands that use maps: coordinates, register, partition, resample, morph."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import MeshError, OptionError
from . import common
from .common import Compact, Input, Json, MapFile, Orient, Output, Quiet, Threads
from .replacing import Written
from .results import conclude

if TYPE_CHECKING:
    from ..maps.files import LoadedMap
    from ..mesh.meshes import TetMesh

_WITHIN = 0.1  # as that of read_landmarks, which takes long to import

_log = logging.getLogger("stretchmap")


class Spread(str, Enum):
    """Values of ``--landmark-map``."""

    smooth = "smooth"
    affine = "affine"


Target = Annotated[
    Path, typer.Argument(metavar="TARGET", help="Mesh of the target.", show_default=False)
]


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.command("register")(register_solids)
    for command in (coordinates, partition, resample, morph):
        app.command()(command)


def register_solids(
    input: Input,
    target: Target,
    output: Output,
    landmarks: Annotated[
        Path | None,
        typer.Option(
            help="CSV: two vertex ids or six coordinates (source, target) per row.",
            show_default=False,
        ),
    ] = None,
    within: Annotated[
        float,
        typer.Option(help="Farthest a landmark may be off, as a share of the solid's diagonal."),
    ] = _WITHIN,
    landmark_map: Annotated[
        Spread, typer.Option("--landmark-map", help="How landmarks are reached on the surface.")
    ] = Spread.smooth,
    keep_best: Annotated[
        bool,
        typer.Option("--keep-best", help="Write the map even if it is not certified; exit code 1."),
    ] = False,
    threads: Threads = None,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> int:
    """Map one solid onto another by landmarks.

    Both are solid tori. Volumes keep their shares, no tet is flipped, and the map is certified.
    """
    from ..base.progress import terminal
    from ..registration.landmarks import read_landmarks
    from ..registration.map import register as register_meshes

    common.check_outputs(output, common.map_suffixes(), json)
    watch = common.Stopwatch()
    source, fields = _solid_torus(input, orient, compact)
    fields = common.check_fields(output, source, fields)
    goal, _ = _solid_torus(target, orient, compact)
    marks = None if landmarks is None else read_landmarks(landmarks, source, goal, within=within)
    watch.lap("read")
    with terminal(quiet) as bar:
        result = register_meshes(
            source,
            goal,
            marks,
            landmark_map=landmark_map.value,
            keep_best=keep_best,
            threads=threads,
            progress=bar,
        )
    watch.lap("compute")
    return conclude(result.with_fields(*fields), output, json, quiet, watch)


def coordinates(
    map_file: MapFile,
    output: Output,
    points: Annotated[
        Path | None,
        typer.Option(
            help="CSV: x, y, z per row; the solid's vertices if left out.", show_default=False
        ),
    ] = None,
    inverse: Annotated[
        bool, typer.Option("--inverse", help="The points lie in the image, carry them back.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Carry points through a map (.csv).

    Each row holds a point of the source, its image, and u, v (radians) and s where the map has a
    torus. A point outside the mesh has nan for what is not known.
    """
    import numpy as np

    from ..base.files import atomic_path
    from ..io.numbers import read_numbers

    common.check_output(output, (".csv",))
    result = _solid_map(map_file, "coordinates")
    ends = [result.mesh.V, result.image]
    if points is not None:
        given = read_numbers(points, {3: "x, y, z"})
        ends = [result.inverse(given), given] if inverse else [given, result.forward(given)]
    elif inverse:
        raise OptionError("--inverse carries points of the image back: give them by --points")
    names = ["x", "y", "z", "image_x", "image_y", "image_z"]
    if result.torus is not None:
        names += ["u", "v", "s"]
        known = np.isfinite(ends[0]).all(axis=1) & np.isfinite(ends[1]).all(axis=1)
        angles = np.full_like(ends[1], np.nan)
        angles[known] = np.stack(result.torus.coordinates(ends[1][known]), axis=-1)
        ends.append(angles)
    rows = np.hstack(ends)
    outside = int(np.isnan(rows[:, :6]).any(axis=1).sum())
    if outside:
        where = "image" if inverse else "source"
        _log.warning("%d of %d points lie outside the %s", outside, len(rows), where)
    with atomic_path(output) as temporary:
        np.savetxt(temporary, rows, "%.17g", ",", header=",".join(names), comments="")
    if not quiet:
        typer.echo(f"{len(rows)} points, {outside} outside, written to {output}")


def partition(
    map_file: MapFile,
    output: Output,
    by: Annotated[
        str, typer.Option(help="s (shells), u or v (sectors), or several for a grid: u,s.")
    ] = "s",
    fractions: Annotated[
        str,
        typer.Option(
            help="Number of equal parts or their shares, 0.2,0.3,0.5; one entry per coordinate, "
            "separated by colons."
        ),
    ] = "5",
    start: Annotated[
        float, typer.Option(help="Angle where the first sector begins, of u or v.")
    ] = 0.0,
    correct: Annotated[bool, typer.Option(help="Move the levels until volumes are exact.")] = True,
    json: Json = None,
    quiet: Quiet = False,
) -> None:
    """Cut a mapped solid into parts by volume."""
    from ..io.formats import suffixes
    from ..partitions.parts import partition as cut

    common.check_outputs(output, suffixes(solid=True), json)
    loaded = _solid_map(map_file, "partition")
    axes: Any = [name.strip() for name in by.split(",")]  # checked there
    shares = [_shares(entry) for entry in fractions.split(":")]
    if len(axes) == 1 and len(shares) == 1:
        parts = cut(loaded, shares[0], axes[0], start=start, correct=correct)
    else:
        parts = cut(loaded, shares, axes, start=start, correct=correct)
    common.write_together(output, parts.save, json, parts.to_dict())
    if not quiet:
        typer.echo(parts.summary())
        typer.echo(f"written to {output}")


def resample(
    map_file: MapFile,
    output: Output,
    n_hexahedra: Annotated[
        int | None, typer.Option(help="About so many hexahedra [default: 5000].")
    ] = None,
    target_size: Annotated[
        float | None, typer.Option(help="Instead: side of a cube of their mean volume.")
    ] = None,
    sections: Annotated[int | None, typer.Option(help="Hexahedra round the axis.")] = None,
    block: Annotated[
        int | None, typer.Option(help="Hexahedra along a side of the middle block.")
    ] = None,
    rings: Annotated[int | None, typer.Option(help="Layers between block and boundary.")] = None,
    optimize: Annotated[
        bool,
        typer.Option(
            help="Optimize the hexahedra's shape and the boundary's fit, or write the grid as it "
            "was pulled back; exit code 1 if hexahedra are not valid."
        ),
    ] = True,
    json: Json = None,
    quiet: Quiet = False,
) -> int:
    """Mesh a mapped solid with hexahedra.

    The mesh is structured; exit code 1 if a hexahedron is not proven to be valid.
    """
    from ..base.progress import terminal
    from ..resample.hex_files import HEX_SUFFIXES
    from ..resample.hexes import hex_mesh

    common.check_outputs(output, HEX_SUFFIXES, json)
    result = _solid_map(map_file, "resample")
    with terminal(quiet) as bar:
        mesh = hex_mesh(
            result,
            n_hexahedra=n_hexahedra,
            target_size=target_size,
            sections=sections,
            block=block,
            rings=rings,
            optimize=optimize,
            progress=bar,
        )
    common.write_together(output, mesh.save, json, mesh.to_dict())
    if not quiet:
        typer.echo(mesh.summary())
        typer.echo(f"written to {output}")
    if mesh.n_invalid:
        _log.error("%d hexahedra are not valid; grid kept in %s", mesh.n_invalid, output)
        return 1
    return 0


def morph(
    map_file: MapFile,
    output: Annotated[Output, Written(_frames)],
    frames: Annotated[int, typer.Option(help="Number of frames, both ends included.")] = 21,
    quiet: Quiet = False,
) -> None:
    """Morph the source into its image.

    Every vertex goes the straight way: .pvd with a .vtu per frame, or an animated .gif.
    """
    from ..plot.morphing import morph as homotopy

    common.check_output(output, (".pvd", ".gif"))
    result = homotopy(_solid_map(map_file, "morph"), frames)
    written = result.save(output)
    if not quiet:
        typer.echo(result.summary())
        beside = f" with {len(written) - 1} frames beside it" if len(written) > 1 else ""
        typer.echo(f"written to {output}{beside}")


def _frames(given: Mapping[str, Any]) -> list[Path]:
    from ..plot.morphing import frame_files

    return frame_files(given["output"], given["frames"])


def _solid_torus(path: Path, orient: bool, compact: bool) -> tuple[TetMesh, common.Fields]:
    """One of two meshes with its data; what is wrong with it is told with its name."""
    found, fields = common.read_with_fields(path, orient, compact)
    mesh = common.require_solid(found, path, "register")
    try:
        mesh.require_solid_torus()
    except MeshError as error:
        raise type(error)(f"{path}: {error}", error.ids) from None
    return mesh, fields


def _solid_map(path: Path, command: str) -> LoadedMap:
    from ..maps.files import load_map
    from ..mesh.meshes import TetMesh

    loaded = load_map(path)
    if not isinstance(loaded.mesh, TetMesh):
        raise MeshError(f"{path} holds the map of a surface, '{command}' needs that of a solid")
    return loaded


def _shares(entry: str) -> int | list[float]:
    try:
        values = [float(value) for value in entry.split(",")]
    except ValueError:
        raise OptionError(f"--fractions must hold numbers, got {entry!r}") from None
    if not all(map(math.isfinite, values)):
        raise OptionError(f"--fractions must hold finite numbers, got {entry!r}")
    if len(values) == 1:
        if values[0] != int(values[0]):
            raise OptionError(f"--fractions takes a whole number of parts, or shares, got {entry}")
        return int(values[0])
    return values
