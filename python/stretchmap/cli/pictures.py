"""Commands that draw: plot, report, demo."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import common
from .common import Json, MapFile, Output, Quiet
from .replacing import Written

if TYPE_CHECKING:
    from ..mesh.meshes import TetMesh


_DPI = 150.0
_DEMO = ("map.npz", "ratios.png", "torus.png")  # what it leaves in its folder


class Kind(str, Enum):
    """Values of ``--kind``, the keys of ``stretchmap.plot.KINDS``."""

    checkerboard = "checkerboard"
    cutaway = "cutaway"
    levels = "levels"
    registration = "registration"
    loops = "loops"
    domain = "domain"
    ratios = "ratios"
    convergence = "convergence"


class By(str, Enum):
    """Values of ``--by``."""

    s = "s"
    u = "u"
    v = "v"


class Color(str, Enum):
    """Values of ``--color``."""

    coordinate = "coordinate"
    ratio = "ratio"


class Sample(str, Enum):
    """Values of ``--sample``."""

    vertebra = "vertebra"
    bumpy = "bumpy"
    knot = "knot"
    torus = "torus"


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    for command in (plot, report, demo):
        app.command()(command)


def plot(
    map_file: MapFile,
    output: Output,
    kind: Annotated[Kind, typer.Option(help="What to draw.")] = Kind.ratios,
    by: Annotated[
        By | None,
        typer.Option(help="For levels: shells (s, default), sectors round the axis or the tube."),
    ] = None,
    color: Annotated[
        Color | None,
        typer.Option(help="For cutaway: place in the source (default) or volume ratio."),
    ] = None,
    dpi: Annotated[float, typer.Option(help="Dots per inch.", min=20.0, max=1200.0)] = _DPI,
) -> None:
    """Draw a picture of a map (.png, .pdf or .svg).

    checkerboard: of the torus, pulled back. cutaway: inside of source and image. levels: shells or
    sectors of equal volume. registration: source and target with landmarks. loops: handle and
    tunnel. domain: the boundary in its angles. ratios: histograms. convergence: the iterations.
    """
    from ..maps.files import load_map
    from ..plot import picture, save

    common.check_output(output, (".png", ".pdf", ".svg"))
    common.require_package("matplotlib", "drawing", "plot")
    given = {"by": by, "color": color}
    options = {name: value.value for name, value in given.items() if value is not None}
    save(picture(load_map(map_file), kind.value, **options), output, dpi)


def report(map_file: MapFile, output: Output) -> None:
    """Write a page about a map (.html).

    One file with figures, certificate and pictures; nothing is fetched.
    """
    from ..maps.files import load_map
    from ..plot.report import write_report

    common.check_output(output, (".html", ".htm"))
    common.require_package("matplotlib", "drawing", "plot")
    write_report(load_map(map_file), output, source=map_file.name)


def demo(
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="Folder for the results, made if missing."),
        Written(lambda given: [given["output"] / name for name in _DEMO]),
    ] = Path("stretchmap-demo"),
    sample: Annotated[Sample, typer.Option(help="Which solid.")] = Sample.vertebra,
    n_tets: Annotated[int, typer.Option(help="Number of tets aimed at.", min=300)] = 30_000,
    json: Json = None,
    quiet: Quiet = False,
) -> int:
    """Generate a solid, map it, draw it.

    Needs no data.
    """
    from .. import plot, samples
    from ..base.files import atomic_path
    from ..base.progress import terminal
    from ..volume.map import volume_map
    from .results import conclude

    common.require_package("matplotlib", "the demo's pictures", "plot")
    if output.exists() and not output.is_dir():
        raise NotADirectoryError(20, "is a file, not a folder", str(output))
    common.check_json(json)
    makers: dict[Sample, Callable[[int], TetMesh]] = {
        Sample.vertebra: samples.vertebra_like,
        Sample.bumpy: samples.bumpy_torus,
        Sample.knot: samples.knot_tube,
        Sample.torus: samples.solid_torus,
    }
    watch = common.Stopwatch()
    solid = makers[sample](n_tets)
    watch.lap("sample")
    with terminal(quiet) as bar:
        result = volume_map(solid, progress=bar)
    watch.lap(**result.seconds)
    histogram, torus = plot.ratios(result), plot.cutaway(result)
    watch.lap("pictures")
    output.mkdir(parents=True, exist_ok=True)
    place, *drawn = (output / name for name in _DEMO)
    common.check_output(place, (".npz",))
    pictures = dict(zip(drawn, (histogram, torus), strict=True))
    with ExitStack() as stack:  # all files or none
        for path, figure in pictures.items():
            figure.savefig(stack.enter_context(atomic_path(path)), dpi=_DPI)
        code = conclude(result, place, json, quiet, watch)
    if not quiet:
        for path in pictures:
            typer.echo(f"written to {path}")
    return code
