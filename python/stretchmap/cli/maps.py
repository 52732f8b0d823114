"""Commands that map surfaces or judge maps: conformal, area, certify."""

from __future__ import annotations

import logging
from enum import Enum
from typing import Annotated, Any

import typer

from . import common
from .common import Compact, Input, Json, MapFile, Orient, Output, Quiet, Threads
from .results import Balance, MaxIter, Phase, Ratio, conclude, parsed_ratio

_log = logging.getLogger("stretchmap")


class Finish(str, Enum):
    """Values of ``--finish``."""

    ring = "ring"
    face = "face"
    none = "none"


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    for command in (conformal, area, certify):
        app.command()(command)


def conformal(
    input: Input,
    output: Output,
    threads: Threads = None,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> int:
    """Map a surface conformally onto a torus.

    The surface, or the boundary of the solid given, has genus one; exit code 1 if the map is not
    certified.
    """
    from ..base.threads import threads as use_threads
    from ..conformal.map import conformal_map

    common.check_outputs(output, common.map_suffixes(), json)
    watch = common.Stopwatch()
    mesh, fields = common.read_with_fields(input, orient, compact)
    surface, fields = common.surface_with_fields(mesh, fields, input)
    fields = common.check_fields(output, surface, fields)
    watch.lap("read")
    with use_threads(threads):
        result = conformal_map(surface)
    watch.lap(**result.seconds)
    return conclude(result.with_fields(*fields), output, json, quiet, watch)


def area(
    input: Input,
    output: Output,
    finish: Annotated[
        Finish | None,
        typer.Option(help="Finish on the faces' areas, then on the vertex rings' (default)."),
    ] = None,
    balance: Balance = None,
    max_iter: MaxIter = None,
    tol: Annotated[
        float | None, typer.Option(help="Goal for the SD of the face ratios.", show_default=False)
    ] = None,
    ratio: Ratio = None,
    phase: Phase = None,
    refine: Annotated[
        bool, typer.Option(help="Halve edges that span too much of the torus for flat faces.")
    ] = True,
    threads: Threads = None,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> int:
    """Map a surface onto a torus, areas preserved.

    The surface, or the boundary of the solid given, has genus one; exit code 1 if the map is not
    certified.
    """
    from ..area.map import area_map
    from ..base.progress import terminal

    common.check_outputs(output, common.map_suffixes(), json)
    watch = common.Stopwatch()
    options: dict[str, Any] = {
        "finish": None if finish is None else finish.value,
        "balance": balance,
        "max_iter": max_iter,
        "tol": tol,
        "ratio": parsed_ratio(ratio),
        "phase": phase,
    }
    options = {name: value for name, value in options.items() if value is not None}
    mesh, fields = common.read_with_fields(input, orient, compact)
    surface, fields = common.surface_with_fields(mesh, fields, input)
    fields = common.check_fields(output, surface, fields)
    watch.lap("read")
    with terminal(quiet) as bar:
        result = area_map(surface, **options, refine=refine, threads=threads, progress=bar)
    watch.lap(**result.seconds)
    return conclude(result.with_fields(*fields), output, json, quiet, watch)


def certify(
    map_file: MapFile,
    torus: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="R r", help="Radii, in place of those of the file.", show_default=False
        ),
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

    common.check_json(json)
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
