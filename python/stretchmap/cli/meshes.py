"""Commands about meshes: info, homology, prepare, tet."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import common
from .common import Compact, Input, Json, Orient, Output, Quiet
from .guard import in_words_of_the_command_line
from .replacing import Written

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Filler(str, Enum):
    """Values of ``--filler``."""

    auto = "auto"
    tetgen = "tetgen"
    ftetwild = "ftetwild"


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.command()(info)
    app.command()(homology)
    app.command()(prepare)
    app.command()(tet)


def info(
    input: Input,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> None:
    """Describe a mesh and list every defect."""
    from ..base.tables import versions
    from ..errors import MeshError
    from ..mesh.crossings import require_no_crossing
    from ..mesh.meshes import TetMesh

    common.check_json(json)
    mesh = common.read_mesh(input, orient, compact)
    diagnosis = mesh.diagnose()
    obstacle = ""
    try:
        if isinstance(mesh, TetMesh):
            size = f"volume {mesh.volume:.6g}"
            mesh.require_solid_torus()
        else:
            size = f"area {mesh.area:.6g}"
            mesh.require_genus_one()
        require_no_crossing(
            mesh.surface if isinstance(mesh, TetMesh) else mesh, "the surface", "repair it there"
        )
    except MeshError as error:
        obstacle = str(error)
    report: dict[str, Any] = {
        "kind": diagnosis.kind,
        "n_vertices": mesh.n_vertices,
        "n_elements": diagnosis.n_elements,
        "n_components": diagnosis.n_components,
        "euler": int(diagnosis.euler.sum()),
        "genus": diagnosis.genus.tolist(),
        "volume": mesh.volume,
        "bounding_box": [mesh.V.min(axis=0).tolist(), mesh.V.max(axis=0).tolist()],
        "defects": [
            {"name": d.name, "message": d.message, "ids": list(d.ids)} for d in diagnosis.defects
        ],
        "n_turned": mesh.n_turned,
        "usable": not obstacle,
        "reason": obstacle,
        "versions": versions(),
    }
    if not quiet:
        typer.echo(in_words_of_the_command_line(diagnosis.summary()))
        typer.echo(size)
        why = obstacle if obstacle and diagnosis.ok else ""
        typer.echo(f"can be mapped to the torus: {'no' if obstacle else 'yes'}{why and f', {why}'}")
    common.write_json(json, report)


def homology(
    input: Input,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="File (.npz) for loops and forms.", show_default=False),
        Written(),
    ] = None,
    json: Json = None,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> None:
    """Find handle and tunnel loops.

    Also generators; of a surface of any genus, or of a solid's boundary.
    """
    from ..base.tables import versions
    from ..homology.basis import homology_basis
    from ..mesh.meshes import TetMesh

    if output is not None:
        common.check_output(output, (".npz",))
    common.check_json(json)
    watch = common.Stopwatch()
    mesh = common.read_mesh(input, orient, compact)
    surface = common.surface_of(mesh)
    watch.lap("read")
    basis = homology_basis(surface, mesh if isinstance(mesh, TetMesh) else None)
    report = basis.to_dict()
    watch.lap("homology")
    if not quiet:
        typer.echo(basis.summary())
    report |= {"seconds": watch.seconds(), "versions": versions()}
    if output is None:
        common.write_json(json, report)
    else:
        common.write_together(output, basis.save, json, report)


def prepare(
    raw: Annotated[
        Path,
        typer.Argument(
            metavar="RAW",
            help="Surface, whatever its defects; or a voxel mask: .npy, .npz with one "
            "3-dimensional array and optionally spacing, .nii, .nii.gz.",
            show_default=False,
        ),
    ],
    output: Output,
    faces: Annotated[int, typer.Option(help="Boundary faces aimed at.")] = 8_000,
    genus: Annotated[int, typer.Option(help="Handles to be left.")] = 1,
    max_cut: Annotated[
        float,
        typer.Option(help="Longest loop to cut along, as a share of the root of the area."),
    ] = 0.25,
    spacing: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y Z", help="Of voxels, if the file names none."),
    ] = None,
    filler: Annotated[
        Filler, typer.Option(help="What fills with tets; by default what is installed.")
    ] = Filler.auto,
    json: Json = None,
    quiet: Quiet = False,
) -> None:
    """Make a solid torus from a raw surface or a voxel mask.

    Welds, orients, drops debris, closes holes, removes self-intersections, cuts surplus handles,
    remeshes, fills with tets, and says what was done.
    """
    from .. import io
    from ..base.progress import terminal
    from ..errors import MeshError
    from ..mesh.meshes import TetMesh
    from ..preparation.pipeline import prepare as prepare_surface
    from ..preparation.voxels import holds_mask, read_mask

    common.check_outputs(output, io.suffixes(solid=True), json)
    common.require_package("gpytoolbox", "remeshing", "prepare")
    given: Any
    affine = None
    if holds_mask(raw):
        given, affine = read_mask(raw)
        if spacing is not None and affine is not None:
            _require_spacing(affine, spacing, raw)
    else:
        mesh = common.read_mesh(raw)
        if isinstance(mesh, TetMesh):
            raise MeshError(f"{raw} is a solid already; prepare takes its surface")
        given = mesh
    with terminal(quiet) as bar:
        done = prepare_surface(
            given, faces=faces, genus=genus, max_cut=max_cut, progress=bar,
            spacing=spacing if spacing and affine is None else (1.0, 1.0, 1.0), affine=affine,
            filler=filler.value,
        )  # fmt: skip
    common.write_together(output, done.save, json, done.to_dict())
    if not quiet:
        typer.echo(done.summary())
        typer.echo(f"written to {output}")


def _require_spacing(
    affine: NDArray[np.float64], spacing: tuple[float, float, float], path: Path
) -> None:
    """Refuse a spacing other than that of the file.

    Raises
    ------
    OptionError
        It is another.
    """
    import numpy as np

    from ..errors import OptionError

    found = np.linalg.norm(affine[:3, :3], axis=0)
    if not np.allclose(found, spacing, rtol=1e-5):
        x, y, z = found
        raise OptionError(
            f"{path} says that voxels are {x:.6g} {y:.6g} {z:.6g} apart: leave out --spacing, and "
            "where the file is wrong correct it, or save the mask as .npy"
        )


def tet(
    input: Input,
    output: Output,
    max_volume: Annotated[
        float | None, typer.Option(help="Largest tet volume aimed at.", show_default=False)
    ] = None,
    quality: Annotated[
        float, typer.Option(help="Largest ratio of circumradius to shortest edge aimed at.")
    ] = 1.4,
    orient: Orient = False,
    compact: Compact = False,
    quiet: Quiet = False,
) -> None:
    """Fill a closed surface with tets.

    The surface is kept as it is.
    """
    from .. import io
    from ..errors import MeshError
    from ..mesh.meshes import TetMesh
    from ..samples import tetrahedralize

    common.check_output(output, io.suffixes(solid=True))
    common.require_package("tetgen", "filling a surface with tets", "mesh")
    surface = common.read_mesh(input, orient, compact)
    if isinstance(surface, TetMesh):
        raise MeshError(f"{input} is a solid already")
    surface.require_closed()
    solid = tetrahedralize(surface, max_volume, quality)
    io.write(output, solid)
    if not quiet:
        typer.echo(solid.diagnose().summary())
