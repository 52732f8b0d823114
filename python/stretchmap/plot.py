"""Pictures of maps. Every function returns a matplotlib Figure; none shows it.

Colours are those of viridis, cividis and Okabe and Ito, told apart by colour-blind eyes and in grey
print. All functions take any map: a result of `volume_map`, `area_map` or `conformal_map`, or one
read by `load_map`.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._painting import Array, Scene, View, subdivided
from .errors import ArrayError, FileFormatError, MissingDependencyError, OptionError
from .mesh import TetMesh, TriMesh
from .results import MapResult, corner_turns
from .torus import TWO_PI

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "KINDS",
    "checkerboard",
    "convergence",
    "cutaway",
    "domain",
    "loops",
    "picture",
    "ratios",
    "save",
]

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8C8C8C"
_LIGHT_GREY = np.array([0.86, 0.86, 0.86])


def _figure(width: float, height: float) -> Figure:
    """An empty figure that belongs to no window."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            "pictures need matplotlib: pip install 'stretchmap[plot]'"
        ) from error
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def ratios(result: MapResult) -> Figure:
    """Histograms of the area or volume ratios, before and after, on one axis.

    Before means the conformal map of a surface, and for a solid the harmonic map with the same
    boundary, where the paper's iteration starts.

    Parameters
    ----------
    result : MapResult

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    """
    after = result.distortion.ratios
    before, name = _ratios_before(result)
    what = "volume" if isinstance(result.mesh, TetMesh) else "area"
    figure = _figure(7.0, 4.2)
    axes = figure.add_subplot()
    everything = np.concatenate([before, after])
    low, high = np.quantile(everything, [0.002, 0.998])
    low, high = min(low, 0.9), max(high, 1.1)
    bins = np.linspace(low, high, 121)
    for values, label, colour in ((before, name, ORANGE), (after, "final map", BLUE)):
        axes.hist(
            np.clip(values, low, high),
            bins=bins,
            weights=np.full(len(values), 100.0 / len(values)),
            histtype="stepfilled",
            color=colour,
            alpha=0.35,
            edgecolor="none",
        )
        axes.hist(
            np.clip(values, low, high),
            bins=bins,
            weights=np.full(len(values), 100.0 / len(values)),
            histtype="step",
            color=colour,
            linewidth=1.6,
            label=f"{label}: SD {values.std():.3g}, {int((values <= 0.0).sum())} flipped",
        )
    axes.axvline(1.0, color=BLACK, linewidth=0.8, linestyle=":")
    axes.set_xlim(low, high)
    axes.set_yscale("log")
    axes.set_xlabel(
        f"share of the total {what}, image over source (the end bins hold all that lies beyond)"
    )
    axes.set_ylabel(f"{'tets' if what == 'volume' else 'faces'} per bin (%)")
    axes.legend(frameon=False)
    return figure


def convergence(result: MapResult) -> Figure:
    """Energy, spread of the ratios and flips against the iteration, stage after stage.

    Parameters
    ----------
    result : MapResult

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OptionError
        The map has no history, as one that is solved for at once or comes from elsewhere.
    MissingDependencyError
        matplotlib is not installed.
    """
    history = result.history
    if not history:
        raise OptionError("this map has no history of iterations to be drawn")
    figure = _figure(7.0, 6.4)
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    stages = list(dict.fromkeys(record.stage for record in history))
    position = np.arange(len(history))
    energy = np.array([record.energy for record in history])
    flips = np.array([record.flips for record in history], float)
    for stage, colour in zip(stages, _cycle(len(stages)), strict=True):
        at = np.array([record.stage == stage for record in history])
        values = energy[at]
        scale = values[np.isfinite(values)][:1]
        if len(scale) and scale[0] > 0.0:
            top.plot(position[at], values / scale, "o-", ms=3, color=colour, label=stage)
        bottom.plot(position[at][flips[at] >= 0], flips[at][flips[at] >= 0], "o-", ms=3,
                    color=colour)  # fmt: skip
    for name, label, style in (
        ("element_sd", "elements", "o-"), ("ring_sd", "vertex rings", "s--"),
    ):  # fmt: skip
        values = np.array([getattr(record, name) for record in history])
        if np.isfinite(values).any():
            middle.plot(position, values, style, ms=3, color=BLACK if style == "o-" else GREY,
                        label=label)  # fmt: skip
    top.set_yscale("log")
    top.set_ylabel("energy over that at\nthe start of the stage")
    middle.set_yscale("log")
    middle.set_ylabel("SD of the ratios")
    bottom.set_yscale("symlog", linthresh=1.0)
    bottom.set_ylim(bottom=0.0, top=max(1.0, 2.0 * flips.max(initial=0.0)))
    bottom.set_ylabel("flipped elements")
    bottom.set_xlabel("iteration, all stages counted on")
    bottom.xaxis.get_major_locator().set_params(integer=True)
    for axes in (top, middle):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.align_ylabels()
    return figure


def domain(result: MapResult) -> Figure:
    """The fundamental domain: the boundary in (u, v), with a checkerboard of the source.

    Shade is the position along the longest axis of the source, light and dark the cells of a
    lattice of cubes in the source.

    Parameters
    ----------
    result : MapResult

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OptionError
        The map names no torus.
    MissingDependencyError
        matplotlib is not installed.
    """
    from matplotlib.collections import PolyCollection

    surface, image = _boundary(result)
    turns = corner_turns(surface.F, _angles(result, image))
    pieces = _pieces(surface)
    points = np.concatenate([surface.V[surface.F], turns], axis=2)
    points = subdivided(points, pieces)
    place = _principal(surface.V, points[:, :, :3].mean(axis=1))
    colours = _viridis(place[:, 0], surface.V, 0)
    size = np.ptp(_principal(surface.V, surface.V)[:, 0]) / 14.0
    odd = np.floor(place / size).sum(axis=1) % 2 == 1
    colours[odd] *= 0.72
    figure = _figure(7.4, 4.6)
    axes = figure.add_subplot()
    polygons, shades = points[:, :, 3:], colours
    low, high = polygons.min(axis=1), polygons.max(axis=1)
    shifts = np.array([(du, dv) for du in (-1, 0, 1) for dv in (-1, 0, 1)])
    copies = [
        (polygons[inside] + shift, shades[inside])
        for shift in shifts
        for inside in [((high + shift > 0.0) & (low + shift < 1.0)).all(axis=1)]
    ]
    axes.add_collection(
        PolyCollection(
            np.concatenate([p for p, _ in copies]),
            facecolors=np.concatenate([s for _, s in copies]),
            linewidths=0.0,
            antialiaseds=False,
            rasterized=True,
        )
    )
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_xlabel("u, around the axis (turns)")
    axes.set_ylabel("v, around the tube (turns)")
    axes.set_title("boundary in the chart of the torus", fontsize=10)
    _colour_bar(figure, axes, surface.V)
    return figure


def checkerboard(result: MapResult, cells: tuple[int, int] = (24, 8)) -> Figure:
    """Source and torus side by side, with the checkerboard of the torus pulled back.

    Parameters
    ----------
    result : MapResult
    cells : (int, int)
        Fields around the axis and around the tube, both even.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OptionError
        The map names no torus, or the numbers are not positive and even.
    MissingDependencyError
        matplotlib is not installed.
    """
    if any(number < 2 or number % 2 for number in cells):
        raise OptionError(f"cells must be positive and even, got {cells}")
    surface, image = _boundary(result)
    turns = corner_turns(surface.F, _angles(result, image))
    pieces = _pieces(surface)
    fine = subdivided(turns, pieces).mean(axis=1)
    fields = np.floor(fine * cells).astype(int)
    colours = _cyclic(fine[:, 0])
    colours[fields.sum(axis=1) % 2 == 1] = 0.95
    figure = _figure(9.6, 4.6)
    panels = figure.subplots(1, 2)
    titles = ("source, the checkerboard pulled back", "image on the torus")
    views = (_view(surface.V), View(45.0, -60.0))
    for axes, points, view, title in zip(panels, (surface.V, image), views, titles, strict=True):
        scene = Scene(view)
        scene.add_faces(subdivided(points[surface.F], pieces), colours)
        scene.draw(axes)
        axes.set_title(title, fontsize=10)
    return figure


def loops(result: MapResult | TriMesh | TetMesh) -> Figure:
    """The surface with its shortest handle loops and tunnel loops.

    Parameters
    ----------
    result : MapResult, TriMesh or TetMesh
        A map (its source is drawn) or a mesh, of any genus.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MeshError
        As `homology_basis`.
    MissingDependencyError
        matplotlib is not installed.
    """
    from matplotlib.lines import Line2D

    from .homology import homology_basis

    mesh = result.mesh if isinstance(result, MapResult) else result
    solid = mesh if isinstance(mesh, TetMesh) else None
    surface = mesh.surface if solid is not None else mesh
    basis = homology_basis(surface, solid)
    size = float(np.ptp(surface.V, axis=0).max())
    figure = _figure(6.4, 4.8)
    axes = figure.add_subplot()
    scene = Scene(_view(surface.V))
    scene.add_faces(surface.V[surface.F], np.tile(_LIGHT_GREY, (surface.n_faces, 1)))
    families = [("handle loop, bounds inside", VERMILION, basis.handle_loops)]
    if basis.tunnel_classes is not None:
        families.append(("tunnel loop, bounds outside", BLUE, basis.tunnel_loops))
    for _, colour, found in families:
        for loop in found:
            scene.add_loop(surface.V[loop], colour, 0.014 * size, 0.02 * size)
    scene.draw(axes)
    axes.legend(
        handles=[Line2D([], [], color=colour, lw=3, label=name) for name, colour, _ in families],
        loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2, frameon=False,
    )  # fmt: skip
    return figure


def cutaway(result: MapResult, colour: str = "coordinate", opening: float = 0.35) -> Figure:
    """Source and solid torus side by side, the same tets taken out of both.

    Parameters
    ----------
    result : MapResult
        A map of a solid.
    colour : {"coordinate", "ratio"}
        By the position along the longest axis of the source, or by the volume ratio of each tet.
    opening : float
        Share of the turn around the axis that is taken out, from 0 to below 1.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ArrayError
        The map is one of a surface.
    OptionError
        An option out of range.
    MissingDependencyError
        matplotlib is not installed.
    """
    if not isinstance(result.mesh, TetMesh):
        raise ArrayError("a cut-away needs the map of a solid, this is one of a surface")
    if colour not in ("coordinate", "ratio") or not 0.0 <= opening < 1.0:
        raise OptionError("colour must be 'coordinate' or 'ratio' and 0 <= opening < 1")
    solid, image = result.mesh, np.asarray(result.image)
    centre = image[solid.T].mean(axis=1)
    view = View(38.0, -60.0)
    # The opening faces the viewer.
    turn = np.arctan2(centre[:, 1], centre[:, 0]) / TWO_PI - (view.azimuth + 35.0) / 360.0
    kept = np.abs(turn - np.round(turn)) >= 0.5 * opening
    part = TetMesh(image, solid.T[kept])
    faces = part.boundary_vertices[part.surface.F]
    if colour == "ratio":
        values = result.distortion.ratios[kept][part.boundary_tets]
        colours = _cividis((values - 0.5) / 1.0)
    else:
        place = _principal(solid.V, solid.V[faces].mean(axis=1))[:, 0]
        colours = _viridis(place, solid.V, 0)
    figure = _figure(9.6, 4.8)
    panels = figure.subplots(1, 2)
    titles = (("source", solid.V, _view(solid.V)), ("image, the solid torus", image, view))
    for axes, (title, points, stand) in zip(panels, titles, strict=True):
        scene = Scene(stand)
        scene.add_faces(points[faces], colours)
        scene.draw(axes)
        axes.set_title(title, fontsize=10)
    _colour_bar(figure, panels, solid.V, ratio=colour == "ratio")
    return figure


KINDS: dict[str, Callable[[MapResult], Figure]] = {
    "ratios": ratios,
    "convergence": convergence,
    "domain": domain,
    "checkerboard": checkerboard,
    "loops": loops,
    "cutaway": cutaway,
}


def picture(result: MapResult, kind: str) -> Figure:
    """Picture of a map by name.

    Parameters
    ----------
    result : MapResult
    kind : str
        A key of ``KINDS``.

    Raises
    ------
    OptionError
        Unknown kind.
    """
    if kind not in KINDS:
        raise OptionError(f"unknown kind of picture {kind!r}; known are {', '.join(KINDS)}")
    return KINDS[kind](result)


def save(figure: Figure, path: str | os.PathLike[str], dpi: float = 150.0) -> None:
    """Write a figure to a file that appears whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : path-like
        ``.png``, ``.pdf`` or ``.svg``.
    dpi : float
        Dots per inch.

    Raises
    ------
    FileFormatError
        Another suffix.
    OSError
        The file cannot be written.
    """
    from .results import atomic_path

    path = Path(path)
    if path.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise FileFormatError(f"{path}: pictures are .png, .pdf or .svg")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi)


def _ratios_before(result: MapResult) -> tuple[Array, str]:
    """Ratios of the map one would have without preserving anything, and its name."""
    from . import _core
    from .conformal import conformal_map
    from .vsem import minimise_volumetric_stretch

    mesh = result.mesh
    if not isinstance(mesh, TetMesh):
        return conformal_map(mesh).distortion.ratios, "conformal map"
    fixed = np.zeros(mesh.n_vertices, np.uint8)
    fixed[mesh.boundary_vertices] = 1
    run = minimise_volumetric_stretch(
        mesh.V, mesh.T, fixed, np.array(result.image), c=0.0, max_iter=0, tol=0.0
    )
    volumes = _core.signed_tet_volumes(run.image, mesh.T)
    rest = mesh.tet_volumes
    return volumes / volumes.sum() * rest.sum() / rest, "harmonic map"


def _boundary(result: MapResult) -> tuple[TriMesh, Array]:
    """Boundary surface of the source and the images of its vertices."""
    mesh, image = result.mesh, np.asarray(result.image)
    if isinstance(mesh, TetMesh):
        return mesh.surface, image[mesh.boundary_vertices]
    return mesh, image


def _angles(result: MapResult, image: Array) -> Array:
    """(n, 2) angles of boundary images."""
    if result.torus is None:
        raise OptionError("the map names no torus, so it has no (u, v)")
    u, v, _ = result.torus.coordinates(image)
    return np.stack([u, v], axis=1)


def _pieces(surface: TriMesh, goal: int = 100_000) -> int:
    """Pieces of each side that make a surface smooth enough for a checkerboard."""
    return int(np.clip(np.ceil(np.sqrt(goal / surface.n_faces)), 1, 8))


def _frame(points: Array) -> tuple[Array, Array]:
    """Centre and principal axes (rows, longest first), signs fixed."""
    centre = points.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov((points - centre).T))
    axes = axes[:, ::-1].T
    signs = np.sign(axes[np.arange(3), np.abs(axes).argmax(axis=1)])
    return centre, axes * signs[:, None]


def _principal(reference: Array, points: Array) -> Array:
    centre, axes = _frame(reference)
    return (points - centre) @ axes.T


def _view(points: Array) -> View:
    """From where the broad side of a shape is seen, its longest axis running across."""
    frame = _frame(points)[1]
    frame[1] *= np.linalg.det(frame)  # a rotation, no reflection
    return View(45.0, -70.0, frame)


def _viridis(place: Array, reference: Array, axis: int) -> Array:
    from matplotlib import colormaps

    span = _principal(reference, reference)[:, axis]
    low, high = span.min(), span.max()
    return np.array(colormaps["viridis"]((place - low) / (high - low))[:, :3])


def _cividis(values: Array) -> Array:
    from matplotlib import colormaps

    return np.array(colormaps["cividis"](np.clip(values, 0.0, 1.0))[:, :3])


def _cyclic(turns: Array) -> Array:
    """Viridis there and back again, so that nothing jumps after a turn."""
    from matplotlib import colormaps

    return np.array(colormaps["viridis"](np.abs(2.0 * (turns % 1.0) - 1.0) * 0.8)[:, :3])


def _cycle(count: int) -> list[str]:
    palette = [ORANGE, BLUE, VERMILION, GREEN, PURPLE, SKY, GREY, BLACK]
    return [palette[i % len(palette)] for i in range(count)]


def _colour_bar(figure: Figure, axes: Axes | NDArray[Any], V: Array, ratio: bool = False) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    span = _principal(V, V)[:, 0]
    norm = Normalize(0.5, 1.5) if ratio else Normalize(span.min(), span.max())
    label = "volume ratio" if ratio else "position along the longest axis of the source"
    panels = axes if isinstance(axes, np.ndarray) else [axes]
    mappable = ScalarMappable(norm, "cividis" if ratio else "viridis")
    extend = "both" if ratio else "neither"
    figure.colorbar(mappable, ax=panels, label=label, shrink=0.85, extend=extend)
