"""The command for many solids: population."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from enum import Enum
from json import loads
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from zipfile import BadZipFile

import typer

from . import common
from .common import Json, Quiet
from .replacing import Written

if TYPE_CHECKING:
    from ..population.result import Population

_log = logging.getLogger("stretchmap")

_RESULTS = ("population.npz", "mean.npz", "report.html")


class Along(str, Enum):
    """Values of ``--along``."""

    smooth = "smooth"
    area = "area"


def _run_files(given: Mapping[str, Any]) -> list[Path]:
    """What a run writes into its folder, and folders that are its own."""
    folder = given["output"]
    names = ["run.json", "maps", "images", "records", *_RESULTS]
    names += [f"template-{number}.npz" for number in range(min(given["max_rounds"], 1000))]
    return [folder / name for name in names]


def register(app: typer.Typer) -> None:
    """Add the command of this module."""
    app.command()(population)


def population(
    solids: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Meshes of tets.", show_default=False)
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="Run folder; begun runs go on.", show_default=False),
        Written(_run_files),
    ],
    template: Annotated[
        Path | None,
        typer.Option(help="Name of a shape, or a mesh, to start from.", show_default=False),
    ] = None,
    landmarks: Annotated[
        Path | None,
        typer.Option(help="Folder of NAME.csv: x, y, z per row.", show_default=False),
    ] = None,
    executor: Annotated[
        str, typer.Option(help="serial, processes, processes:N or dask://host:port.")
    ] = "serial",
    along: Annotated[
        Along, typer.Option(help="What decides where points go along the surface.")
    ] = Along.smooth,
    scale: Annotated[bool, typer.Option(help="Take out size.")] = True,
    max_rounds: Annotated[int, typer.Option(help="Most rounds of the template.")] = 6,
    tol: Annotated[float, typer.Option(help="Movement of the template at rest, over its size.")] = (
        1e-3
    ),
    json: Json = None,
    quiet: Quiet = False,
) -> int:
    """Mean and modes of a folder of solids.

    Writes a map and a record of every shape, population.npz, mean.npz and report.html into the
    run folder. Exit code 1 if shapes were skipped or the template is not at rest.
    """
    from ..base.progress import terminal
    from ..io.writing import write
    from ..plot.population_report import write_population_report
    from ..population.run import fit

    common.require_package("matplotlib", "the report", "plot")
    common.check_json(json)
    with terminal(quiet) as bar:
        found = fit(
            solids,
            None if template is None else str(template),
            landmarks,
            folder=output,
            executor=executor,
            along=along.value,
            scale=scale,
            max_rounds=max_rounds,
            tol=tol,
            progress=bar,
        )
    shapes, mean, page = (output / name for name in _RESULTS)
    _warn_of_coarser(shapes, found)
    found.save(shapes)
    write(mean, found.mean)
    write_population_report(found, page, str(solids.name))
    common.write_json(json, found.to_dict())
    if not quiet:
        typer.echo(found.summary())
        _list_shapes(found)
        typer.echo(f"written to {output}")
    for name in found.skipped:
        _log.error("%s was skipped", name)
    return 1 if found.skipped or not found.converged else 0


def _warn_of_coarser(path: Path, found: Population) -> None:
    """Say so where the result of more rounds with the same shapes is replaced.

    A folder is that of its shapes and settings: of two such results the one of more rounds is the
    same run carried on.
    """
    import numpy as np

    try:
        with np.load(path) as data:
            before = loads(str(data["meta"]))
        names = tuple(record["name"] for record in before["shapes"] if record["ok"])
        rounds, moved = int(before["rounds"]), float(before["moved"][-1])
    except (OSError, ValueError, LookupError, TypeError, BadZipFile):
        return  # there is none, or none that can be read
    if names == found.names and rounds > len(found.moved):
        _log.warning(
            "%s held the result of %d rounds, the last of which moved the template by %.2g, and is "
            "replaced by that of %d, by %.2g; all maps are kept: a smaller --tol or more "
            "--max-rounds brings the finer one back",
            path, rounds, moved, len(found.moved), found.moved[-1],
        )  # fmt: skip


def _list_shapes(found: Population) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None)
    for column in ("shape", "tets", "certified", "along", "distance / size", "seconds"):
        table.add_column(column)
    for record in found.records:
        if not record["ok"]:
            table.add_row(record["name"], "skipped", record["error"])
            continue
        distance = "-" if record["distance"] is None else f"{record['distance']:.5f}"
        certified = "yes" if record["certified"] else "no"
        table.add_row(
            record["name"], str(record["n_tets"]), certified, record["along"], distance,
            f"{record['seconds']:.1f}",
        )  # fmt: skip
    Console().print(table)
