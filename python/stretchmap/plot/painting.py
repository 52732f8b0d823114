"""Drawing of surfaces by matplotlib alone: orthographic projection, light, painter's algorithm.

The pictures need no graphics hardware and no further package, so they come out the same everywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

# Light from the upper left, in front; directions in the picture's (right, up, towards the viewer).
_LIGHT = np.array([-0.45, 0.55, 0.7]) / math.sqrt(0.45**2 + 0.55**2 + 0.7**2)

# Height of every picture over its width, so that those side by side agree.
_HEIGHT = 0.85


@dataclass(frozen=True)
class View:
    """Where the viewer stands.

    Attributes
    ----------
    elevation, azimuth : float
        Degrees above the xy-plane and around the z-axis.
    frame : (3, 3) ndarray, optional
        Rotation whose rows are to be taken for the directions x, y and z.

    Examples
    --------
    >>> from stretchmap.plot.painting import View
    >>> right, up, towards = View(elevation=90.0, azimuth=-90.0).axes  # from above
    >>> right.round(12).tolist()
    [1.0, 0.0, 0.0]
    """

    elevation: float = 35.0
    azimuth: float = -60.0
    frame: Array | None = None

    @property
    def axes(self) -> Array:
        """(3, 3): rows are the directions right, up and towards the viewer."""
        e, a = math.radians(self.elevation), math.radians(self.azimuth)
        towards = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
        right = np.array([-math.sin(a), math.cos(a), 0.0])
        axes = np.stack([right, np.cross(towards, right), towards])
        return axes if self.frame is None else axes @ self.frame

    def turned(self, rotation: Array) -> View:
        """The view that shows ``points @ rotation`` as this one shows the points."""
        frame = np.eye(3) if self.frame is None else self.frame
        return View(self.elevation, self.azimuth, frame @ rotation)

    def opposite(self) -> View:
        """Looking the other way along the same line."""
        return View(-self.elevation, self.azimuth + 180.0, self.frame)


@dataclass
class Scene:
    """Triangles and lines that hide each other; collected first, drawn at once.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.plot.painting import Scene, View
    >>> from stretchmap.plot.style import empty_figure, steps
    >>> surface = sm.samples.torus_surface(24, 12)
    >>> scene = Scene(View())
    >>> scene.add_faces(surface.V[surface.F], steps(surface.n_faces))
    >>> scene.draw(empty_figure(4.0, 3.0).add_subplot())
    """

    view: View
    _polygons: list[Array] = field(default_factory=list)
    _colors: list[Array] = field(default_factory=list)
    _outlines: list[tuple[Array, Any]] = field(default_factory=list)

    def add_faces(self, corners: Array, colors: Array) -> None:
        """Add triangles; those that look away from the viewer are left out.

        Parameters
        ----------
        corners : (m, 3, 3) ndarray
            Corners of each face, counter-clockwise from outside.
        colors : (m, 3) ndarray
            Color of each face in full light, red, green, blue from 0 to 1.
        """
        x = corners @ self.view.axes.T
        normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(lengths > 0.0, lengths, 1.0)
        seen = normals[:, 2] > 0.0
        bright = 0.55 + 0.45 * np.clip(normals[seen] @ _LIGHT, 0.0, 1.0)
        self._polygons.append(x[seen])
        self._colors.append(np.clip(colors[seen] * bright[:, None], 0.0, 1.0))

    def add_loop(self, points: Array, color: Any, width: float, lift: float) -> None:
        """Add a closed polygon: a ribbon, only dotted where faces lie before it.

        Parameters
        ----------
        points : (k, 3) ndarray
        color : color of matplotlib
        width : float
            In the units of the points.
        lift : float
            How far it is drawn towards the viewer, so that its own surface does not hide it.
        """
        from matplotlib.colors import to_rgb

        start = points @ self.view.axes.T
        self._outlines.append((np.concatenate([start, start[:1]])[:, :2], color))
        end = np.roll(start, -1, axis=0)
        along = end[:, :2] - start[:, :2]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = along / np.where(length > 0.0, length, 1.0)
        side = 0.5 * width * np.stack([-along[:, 1], along[:, 0]], axis=1)
        a, b = start[:, :2] - 0.3 * width * along, end[:, :2] + 0.3 * width * along
        depth = np.tile(0.5 * (start[:, 2] + end[:, 2]) + lift, (3, 1)).T[:, :, None]
        for triangle in ((a - side, b - side, b + side), (a - side, b + side, a + side)):
            self._polygons.append(np.concatenate([np.stack(triangle, axis=1), depth], axis=2))
            self._colors.append(np.tile(to_rgb(color), (len(points), 1)))

    def visible(self, points: Array, lift: float) -> NDArray[np.bool_]:
        """Whether no face lies before a point, brought nearer to the viewer by ``lift``.

        Parameters
        ----------
        points : (n, 3) ndarray
            A few: each is compared with every face.
        lift : float

        Returns
        -------
        (n,) ndarray of bool
        """
        corners = np.concatenate(self._polygons)
        low, high = corners.min(axis=1)[:, :2], corners.max(axis=1)
        places = points @ self.view.axes.T + np.array([0.0, 0.0, lift])
        seen = np.ones(len(points), bool)
        for i, place in enumerate(places):
            near = (low <= place[:2]).all(axis=1) & (high >= place).all(axis=1)
            to = corners[near] - place
            before, after = np.roll(to, -1, axis=1), np.roll(to, -2, axis=1)
            weights = before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]
            above = (weights * to[..., 2]).sum(axis=1)
            seen[i] = not ((weights >= 0.0).all(axis=1) & (above > 0.0)).any()
        return seen

    def draw(self, axes: Axes, around: Array | None = None) -> None:
        """Paint everything, the farthest first; fit the axes to it or to other points (n, 3)."""
        from matplotlib.collections import PolyCollection

        polygons, colors = np.concatenate(self._polygons), np.concatenate(self._colors)
        order = np.argsort(polygons[:, :, 2].mean(axis=1), kind="stable")
        polygons = polygons[:, :, :2]
        axes.add_collection(
            PolyCollection(
                polygons[order],
                facecolors=colors[order],
                edgecolors=colors[order],
                linewidths=0.4,
                rasterized=True,
            )
        )
        for line, color in self._outlines:
            axes.plot(*line.T, ":", color=color, linewidth=1.2)
        shown = polygons.reshape(-1, 2) if around is None else around @ self.view.axes[:2].T
        low, high = shown.min(axis=0), shown.max(axis=0)
        width, height = high - low
        width = 1.06 * max(width, height / _HEIGHT)
        x, y = 0.5 * (low + high)
        axes.set_xlim(x - 0.5 * width, x + 0.5 * width)
        axes.set_ylim(y - 0.5 * _HEIGHT * width, y + 0.5 * _HEIGHT * width)
        axes.set_aspect("equal")
        axes.set_axis_off()


def subdivided(corners: Array, pieces: int) -> Array:
    """Cut every triangle into ``pieces**2``; values at the corners are interpolated linearly.

    Parameters
    ----------
    corners : (m, 3, d) ndarray
    pieces : int
        Pieces of each side.

    Returns
    -------
    (m * pieces**2, 3, d) ndarray
        The pieces of a triangle follow each other.

    Examples
    --------
    >>> import numpy as np
    >>> from stretchmap.plot.painting import subdivided
    >>> subdivided(np.eye(3)[None], 2).shape
    (4, 3, 3)
    """
    k = pieces
    up = [((i, j), (i + 1, j), (i, j + 1)) for i in range(k) for j in range(k - i)]
    down = [
        ((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i in range(k - 1) for j in range(k - 1 - i)
    ]
    nodes = np.array(up + down, float) / k  # (k^2, 3, 2)
    weights = np.concatenate([1.0 - nodes.sum(axis=2, keepdims=True), nodes], axis=2)
    pieces_of_each = np.einsum("pqc,mcd->mpqd", weights, corners)
    return np.asarray(pieces_of_each.reshape(-1, 3, corners.shape[2]))
