"""The boundary: its fundamental domain, a checkerboard pulled back, its loops."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.options import pair
from ..errors import OptionError
from ..maps.given import as_map
from ..maps.result import MapResult
from ..maps.writing import corner_turns
from ..mesh.given import as_mesh
from ..mesh.meshes import TetMesh, TriMesh
from .painting import Array, Scene, View, subdivided
from .style import (
    BLUE,
    LIGHT_GRAY,
    VERMILION,
    along,
    boundary,
    broad_view,
    color_bar,
    empty_figure,
    principal,
    torus_angles,
    viridis,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_CELLS = 1000  # either way
_FINE = 150_000  # pieces that make the outline of a checkerboard smooth


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

    Examples
    --------
    >>> import stretchmap as sm
    >>> figure = sm.plot.domain(sm.area_map(sm.samples.torus_surface(24, 12)))
    >>> figure.axes[0].get_xlabel()
    'u, around the axis (turns)'
    """
    result = as_map(result)
    figure = empty_figure(7.6, 4.6)
    from matplotlib.collections import PolyCollection

    surface, image = boundary(result)
    turns = corner_turns(surface.F, torus_angles(result, image))
    place = principal(surface.V, surface.V)
    place /= np.ptp(place[:, 0]) / 14.0
    corners = np.concatenate([place[surface.F], turns, surface.V[surface.F]], axis=2)
    points = _cut_at_cells(corners, np.arange(3))
    centers = points.mean(axis=1)
    colors = along(centers[:, 5:], surface.V)
    odd = np.floor(centers[:, :3]).sum(axis=1) % 2 == 1
    colors[odd] *= 0.72
    axes = figure.add_subplot()
    polygons = points[:, :, 3:5]
    low, high = polygons.min(axis=1), polygons.max(axis=1)
    shifts = np.array([(du, dv) for du in (-1, 0, 1) for dv in (-1, 0, 1)])
    copies = [
        (polygons[inside] + shift, colors[inside])
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
    axes.set_title("boundary in the chart of the torus, cells of the source", fontsize=10)
    color_bar(figure, axes, surface.V)
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

    Examples
    --------
    >>> import stretchmap as sm
    >>> figure = sm.plot.checkerboard(sm.area_map(sm.samples.torus_surface(24, 12)))
    >>> [axes.get_title() for axes in figure.axes][1]
    'image on the torus'
    """
    result = as_map(result)
    cells = pair("cells", cells, 2, _MOST_CELLS)
    if cells[0] % 2 or cells[1] % 2:
        raise OptionError(f"cells must be even, got {cells}")
    figure = empty_figure(9.6, 4.6)
    surface, image = boundary(result)
    turns = corner_turns(surface.F, torus_angles(result, image)) * cells
    corners = np.concatenate([turns, surface.V[surface.F], image[surface.F]], axis=2)
    points = _cut_at_cells(corners, np.arange(2))
    fields = points[:, :, :2].mean(axis=1)
    # There and back again, so that nothing jumps after a turn.
    colors = viridis(np.abs(2.0 * (fields[:, 0] / cells[0] % 1.0) - 1.0) * 0.8)
    colors[np.floor(fields).sum(axis=1) % 2 == 1] = 0.95
    panels = figure.subplots(1, 2)
    shown = (
        ("source, the checkerboard pulled back", points[:, :, 2:5], broad_view(surface.V)),
        ("image on the torus", points[:, :, 5:8], View(45.0, -60.0)),
    )
    for axes, (title, faces, view) in zip(panels, shown, strict=True):
        scene = Scene(view)
        scene.add_faces(faces, colors)
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

    Examples
    --------
    >>> import stretchmap as sm
    >>> figure = sm.plot.loops(sm.samples.double_torus(1))
    >>> [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    ['handle loop, bounds inside', 'tunnel loop, bounds outside']
    """
    mesh = as_mesh(result.mesh if isinstance(result, MapResult) else result, "result")
    figure = empty_figure(6.4, 4.8)
    from matplotlib.lines import Line2D

    from ..homology.basis import homology_basis

    solid = mesh if isinstance(mesh, TetMesh) else None
    surface = mesh.surface if isinstance(mesh, TetMesh) else mesh
    basis = homology_basis(surface, solid)
    size = float(np.ptp(surface.V, axis=0).max())
    axes = figure.add_subplot()
    scene = Scene(broad_view(surface.V))
    scene.add_faces(surface.V[surface.F], np.tile(LIGHT_GRAY, (surface.n_faces, 1)))
    families = [("handle loop, bounds inside", VERMILION, basis.handle_loops)]
    if basis.tunnel_classes is not None:
        families.append(("tunnel loop, bounds outside", BLUE, basis.tunnel_loops))
    for _, color, found in families:
        for loop in found:
            scene.add_loop(surface.V[loop], color, 0.014 * size, 0.02 * size)
    scene.draw(axes)
    lines = [Line2D([], [], color=color, lw=3, label=name) for name, color, _ in families]
    below = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0)}
    axes.legend(handles=lines, ncols=2, frameon=False, **below)
    return figure


def _cut_at_cells(corners: Array, columns: NDArray[np.intp]) -> Array:
    """Triangles cut small where they cross from one cell of the integer lattice to another.

    ``corners`` is (m, 3, d); the ``columns`` among the d are the coordinates that have cells.
    """
    cell = np.floor(corners[:, :, columns])
    crossing = (cell != cell[:, :1]).any(axis=(1, 2))
    pieces = int(np.clip(np.ceil(np.sqrt(_FINE / max(crossing.sum(), 1))), 1, 12))
    return np.concatenate([corners[~crossing], subdivided(corners[crossing], pieces)])
