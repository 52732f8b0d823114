"""The inside of a solid and of its image, laid open by plane cuts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.options import one_of, real
from ..base.torus import TWO_PI
from ..maps.given import as_map_of_solid
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh
from ..partitions.parts import Coordinate, partition
from .painting import Array, Scene, View
from .style import BELOW, along, broad_view, cividis, color_bar, empty_figure, frame, steps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Color = Literal["coordinate", "ratio"]
_TORUS = "image, the solid torus"
_BINS = 36  # directions an opening may have
_LOW, _RIGHT = 0.6, 0.5  # how far below and to the right of the viewer it is best seen


def cutaway(result: MapResult, color: Color = "coordinate", opening: float = 0.35) -> Figure:
    """Source and image side by side, laid open: tets are cut by planes of the image.

    From a solid torus a sector around the axis is taken out, and from the source what is mapped to
    it. The image of a registration is cut in two by the plane of its longest and shortest axis.

    Parameters
    ----------
    result : MapResult
        A map of a solid.
    color : {"coordinate", "ratio"}
        By the position along the longest axis of the source, or by the volume ratio of each tet.
    opening : float
        Share of the turn around the axis that is taken out, from 0 to below 1; a half cuts the
        solid torus by one plane.

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

    Examples
    --------
    >>> import stretchmap as sm
    >>> figure = sm.plot.cutaway(sm.volume_map(sm.samples.solid_torus(600)), color="ratio")
    >>> figure.axes[0].get_title()
    'source'
    """
    result, _ = as_map_of_solid(result, "a cut-away")
    one_of("color", color, ("coordinate", "ratio"))
    opening = real("opening", opening, 0.0, below=1.0)
    figure = empty_figure(9.6, 4.2)
    pieces = _Pieces.of(result)
    view = broad_view(result.mesh.V)
    if result.torus is None:
        name, other = "image", broad_view(pieces.image)
        across = frame(pieces.image)[1]
        pieces = pieces.cut((pieces.image - pieces.image.mean(axis=0)) @ across)
        kept = pieces.side * np.sign(across @ other.axes[2]) < 0
    else:
        front = _front(pieces, view)
        name, other = _TORUS, _torus_view(front)
        pieces, kept = pieces.opened(front, np.array([opening]))
    faces, tets = pieces.faces(kept)
    if color == "ratio":
        colors = cividis(result.distortion.ratios[pieces.parent[tets]] - 0.5)
    else:
        colors = along(pieces.source[faces].mean(axis=1), result.mesh.V)
    ends = (("source", pieces.source, view), (name, pieces.image, other))
    panels = _side_by_side(figure, ends, faces, colors)
    color_bar(figure, panels, result.mesh.V, ratio=color == "ratio")
    return figure


def levels(
    result: MapResult,
    fractions: int | Sequence[float] = 5,
    by: Coordinate = "s",
    opening: float = 0.4,
) -> Figure:
    """Parts between level surfaces in colors, in the source and in the solid torus (Figure 7.3).

    Nested shells are laid open in steps, so that each level surface shows between two cuts: the
    outermost shell lacks the largest sector around the axis, the innermost is whole.

    Parameters
    ----------
    result : MapResult
        Map of a solid onto the solid torus.
    fractions : int or sequence of float
        Number of parts of equal volume, or the share of each; as `partition`.
    by : {"s", "u", "v"}
        Shells around the core, sectors around the axis, sectors around the tube.
    opening : float
        Share of the turn around the axis that is taken out to show the inside, from 0 to below 1.
        Sectors around the axis are shown whole.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ArrayError
        The map is one of a surface.
    OptionError
        An option out of range, or the map has no torus.
    MissingDependencyError
        matplotlib is not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> figure = sm.plot.levels(sm.volume_map(sm.samples.solid_torus(600)), 3)
    >>> len(figure.legends[0].get_texts())
    3
    """
    one_of("by", by, ("s", "u", "v"))
    opening = real("opening", opening, 0.0, below=1.0)
    figure = empty_figure(9.6, 4.9)
    from matplotlib.patches import Patch

    parts = partition(result, fractions, by)
    pieces = _Pieces(np.hstack([parts.solid.V, parts.image]), parts.solid.T, parts.labels)
    view = broad_view(result.mesh.V)
    front = _front(pieces, view)
    openings = {
        "s": np.linspace(0.0, opening, parts.n_parts),
        "u": np.zeros(parts.n_parts),
        "v": np.full(parts.n_parts, opening),
    }[by]
    pieces, kept = pieces.opened(front, openings)
    faces, tets = pieces.faces(kept)
    shades = steps(parts.n_parts)
    ends = (("source", pieces.source, view), (_TORUS, pieces.image, _torus_view(front)))
    _side_by_side(figure, ends, faces, shades[pieces.parent[tets]])
    columns = math.ceil(parts.n_parts / math.ceil(parts.n_parts / 5))
    patches = [
        Patch(color=shade, label=f"part {i}: {100 * share:.3g} %")
        for i, (shade, share) in enumerate(zip(shades, parts.fractions, strict=True))
    ]
    legend = figure.legend(handles=patches, loc=BELOW, ncols=columns, frameon=False)
    legend.set_title("share of the volume" + (", from the core outwards" if by == "s" else ""))
    return figure


@dataclass(frozen=True)
class _Pieces:
    """Tets being cut. Columns of ``points``: source, image. ``parent`` is kept by every cut."""

    points: Array
    T: NDArray[np.int32]
    parent: NDArray[np.int32]
    side: NDArray[np.int32] | None = None  # of the last cut

    @classmethod
    def of(cls, result: MapResult) -> _Pieces:
        mesh = result.mesh
        assert isinstance(mesh, TetMesh)
        return cls(
            np.hstack([mesh.V, result.image]), mesh.T, np.arange(mesh.n_tets, dtype=np.int32)
        )

    @property
    def source(self) -> Array:
        return self.points[:, :3]

    @property
    def image(self) -> Array:
        return self.points[:, 3:]

    def cut(self, values: Array) -> _Pieces:
        places = np.ascontiguousarray((np.sign(values) + 1).astype(np.int32)[self.T])
        split = _core.partitions.split_tets(self.T, len(self.points), places, 2)
        first, second = split.cut_edges.T
        share = (values[first] / (values[first] - values[second]))[:, None]
        added = (1.0 - share) * self.points[first] + share * self.points[second]
        return _Pieces(
            points=np.concatenate([self.points, added]),
            T=split.tets,
            parent=self.parent[split.parent],
            side=2 * split.slab - 1,
        )

    def opened(self, front: float, openings: Array) -> tuple[_Pieces, NDArray[np.bool_]]:
        """Cut for sectors around the axis, and which tets are left.

        ``front`` is the middle of the sectors in radians, ``openings`` how large they are in turns:
        one for all tets, or one for each value of ``parent``.
        """
        pieces = self
        for opening in np.unique(openings[openings > 0.0]):
            for angle in (front - math.pi * opening, front + math.pi * opening):
                x, y, _ = pieces.image.T
                pieces = pieces.cut(y * math.cos(angle) - x * math.sin(angle))
        turn = (pieces.angles() - front) / TWO_PI
        wide = openings[pieces.parent] if len(openings) > 1 else openings
        return pieces, np.abs(turn - np.round(turn)) >= 0.5 * wide

    def angles(self) -> Array:
        """(k,) angle around the axis of the middle of each tet."""
        x, y, _ = self.image[self.T].mean(axis=1).T
        return np.asarray(np.arctan2(y, x))

    def faces(self, kept: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
        """Boundary faces of some of the tets, and the tet each belongs to."""
        skin = _core.mesh.TetBoundary(np.ascontiguousarray(self.T[kept]), len(self.points))
        return skin.vertices[skin.faces], np.flatnonzero(kept)[skin.tets]


def _front(pieces: _Pieces, view: View) -> float:
    """Angle around the axis of what in the source lies nearest to the viewer."""
    right, up, towards = view.axes
    height = pieces.source[pieces.T].mean(axis=1) @ (towards - _LOW * up + _RIGHT * right)
    bins = np.floor((pieces.angles() / TWO_PI % 1.0) * _BINS).astype(int) % _BINS
    count = np.bincount(bins, minlength=_BINS)
    mean = np.bincount(bins, height, minlength=_BINS) / np.maximum(count, 1)
    return TWO_PI * (int(np.argmax(np.where(count > 0, mean, -np.inf))) + 0.5) / _BINS


def _torus_view(front: float) -> View:
    """The torus with an opening at an angle turned to where both its ends are seen."""
    return View(38.0, math.degrees(front) - 35.0)


def _side_by_side(
    figure: Figure,
    ends: tuple[tuple[str, Array, View], ...],
    faces: NDArray[np.int32],
    colors: Array,
) -> NDArray[np.object_]:
    """Panels with the same faces at different points, each with title, points and view."""
    panels = figure.subplots(1, len(ends))
    for axes, (title, points, view) in zip(panels, ends, strict=True):
        scene = Scene(view)
        scene.add_faces(points[faces], colors)
        scene.draw(axes)
        axes.set_title(title, fontsize=10)
    return np.asarray(panels)
