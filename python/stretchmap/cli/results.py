"""What the commands that compute maps share: options of the torus, and how they end."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import common

if TYPE_CHECKING:
    from ..certificate.findings import Certificate
    from ..maps.result import MapResult

_log = logging.getLogger("stretchmap")

Ratio = Annotated[
    str | None,
    typer.Option(help="R / r of the torus: conformal, search or a number.", show_default=False),
]
Phase = Annotated[
    float | None,
    typer.Option(help="Turns around the tube; searched if left out.", show_default=False),
]
Balance = Annotated[
    float | None,
    typer.Option(help="From 0, pieces keep their shape, to 1 (default), their size."),
]
MaxIter = Annotated[int | None, typer.Option(help="Most steps.", show_default=False)]


def parsed_ratio(ratio: str | None) -> Any:
    """``--ratio`` as the library takes it: a number where it is one."""
    try:
        return None if ratio is None else float(ratio)
    except ValueError:
        return ratio


def conclude(
    result: MapResult, output: Path, json_path: Path | None, quiet: bool, watch: common.Stopwatch
) -> int:
    """Certify if that has not been done, write output and report, print the table.

    Returns
    -------
    int
        Exit code: 1 if the map is not certified.
    """
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
    if report["certified"]:
        return 0
    _log.error("not certified: %s; map kept in %s", report["reason"], output)
    return 1


def _certified(result: MapResult) -> Certificate:
    from ..certificate.checks import certify

    return certify(result.mesh, result.image, result.torus)
