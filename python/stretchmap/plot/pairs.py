"""Two solids and the map between them, with landmarks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..maps.given import as_map
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh
from .painting import Array, Scene
from .style import BELOW, BLACK, along, broad_view, empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PALE = 0.5  # share of white in the colors of the surfaces, so that landmarks stand out
_FREE = 24  # points carried to show a registration without landmarks
_APART = 0.052  # least distance of two numbers, in widths of a panel


def registration(result: MapResult) -> Figure:
    """Source and target of a registration from two sides, landmarks numbered and colored alike.

    The color is the position along the longest axis of the source, on the target that of the point
    carried there. Dots are landmarks; rings are where the map carries those of the source, so that
    a ring without a dot in it is an error. Numbers are those of the rows of landmarks, from 0 on.
    Without landmarks points far from each other are carried.

    Parameters
    ----------
    result : Registration or LoadedMap

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OptionError
        The map is no registration.
    LandmarkError
        The landmarks are not vertices of the two boundaries.
    MissingDependencyError
        matplotlib is not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> result = sm.register(sm.samples.solid_torus(600), sm.samples.bumpy_torus(1000))
    >>> [axes.get_title() for axes in sm.plot.registration(result).axes][:2]
    ['source, seen from one side', 'target, seen from one side']
    """
    result = as_map(result)
    solid, target = result.mesh, result.target
    if target is None or not isinstance(solid, TetMesh):
        raise OptionError("this picture needs a registration; the map has no target solid")
    figure = empty_figure(9.6, 8.4)
    from matplotlib.lines import Line2D

    from ..registration.landmarks import Landmarks, similarity

    image = np.asarray(result.image)
    skin, ids = solid.surface, solid.boundary_vertices
    pairs = np.asarray(result.extra_arrays().get("landmarks", np.zeros((0, 2), np.int32)))
    marks = pairs[:, 0] if len(pairs) else ids[_far_apart(skin.V, _FREE)]
    if len(pairs):
        Landmarks.of(solid, target, *pairs.T)  # refuses what a file may hold
    goals = target.V[pairs[:, 1]] if len(pairs) else image[marks]
    colors = along(solid.V, solid.V)
    faces = ids[skin.F]
    pale = _PALE + (1.0 - _PALE) * colors[faces].mean(axis=1)
    front = broad_view(solid.V)
    turned = similarity(solid.V[ids], image[ids])[0]
    for row, view in zip(figure.subplots(2, 2), (front, front.opposite()), strict=True):
        ends = (
            ("source", solid.V, solid.V[marks], None, view),
            ("target", image, goals, image[marks], view.turned(turned)),
        )
        for axes, (name, points, dots, rings, stand) in zip(row, ends, strict=True):
            scene = Scene(stand)
            scene.add_faces(points[faces], pale)
            scene.draw(axes)
            lift = 0.01 * float(np.ptp(points[:, 0]))
            seen = np.flatnonzero(scene.visible(dots, lift))
            _mark(axes, dots @ stand.axes[:2].T, colors[marks], seen)
            if rings is not None:
                at = rings[seen] @ stand.axes[:2].T
                axes.scatter(*at.T, s=70, facecolors="none", edgecolors=BLACK, linewidths=0.9)
            side = "one side" if view is front else "the other side"
            axes.set_title(f"{name}, seen from {side}", fontsize=10)
    what = "landmark" if len(pairs) else "point of the source and its image"
    dot, ring = (Line2D([], [], linestyle="", marker="o", mec=BLACK) for _ in range(2))
    dot.set(label=what, markerfacecolor="#35B779", markersize=6)
    ring.set(label="carried by the map", markerfacecolor="none", markersize=9)
    figure.legend(handles=[dot, ring], loc=BELOW, ncols=2, frameon=False)
    return figure


def _mark(axes: Axes, at: Array, colors: Array, seen: NDArray[np.intp]) -> None:
    """Dots with their numbers beside them, out of each other's way."""
    from matplotlib.patheffects import withStroke

    if not len(seen):
        return
    axes.scatter(*at[seen].T, s=26, c=colors[seen], edgecolors=BLACK, linewidths=0.8, zorder=3)
    width = float(np.diff(axes.get_xlim())[0])
    for i, place in zip(seen, _out_of_the_way(at[seen] / width) * width, strict=True):
        axes.plot(*np.stack([at[i], place]).T, color=BLACK, linewidth=0.5, zorder=2)
        number = axes.text(*place, str(i), fontsize=8, ha="center", va="center", zorder=4)
        number.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def _out_of_the_way(dots: Array) -> Array:
    """Places for the numbers of dots, in widths of the panel: near, and clear of all else."""
    away = dots - dots.mean(axis=0)
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    places = dots + 0.7 * _APART * away
    for _ in range(200):
        others = np.concatenate([places, dots])
        gap = places[:, None] - others[None]
        distance = np.linalg.norm(gap, axis=2)
        distance[np.arange(len(places)), np.arange(len(places))] = np.inf
        reach = np.where(np.arange(len(others)) < len(places), _APART, 0.7 * _APART)
        push = np.clip(reach - distance, 0.0, None) / np.maximum(distance, 1e-9)
        places = places + 0.5 * (push[:, :, None] * gap).sum(axis=1)
    return np.asarray(places)


def _far_apart(points: Array, count: int) -> NDArray[np.intp]:
    """Ids of points each of which is the farthest from those before."""
    chosen = [int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    nearest = np.full(len(points), np.inf)
    for _ in range(min(count, len(points)) - 1):
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(nearest)))
    return np.array(chosen)
