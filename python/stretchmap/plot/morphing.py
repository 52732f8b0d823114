"""Linear homotopy between a solid and its image, as numbered frames or an animated picture."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from .. import _core, io
from ..base.arrays import read_only
from ..base.files import atomic_path
from ..base.options import as_path, flag, whole
from ..base.tables import HasSummary, plain_dict, table
from ..errors import FileFormatError, OptionError
from ..maps.given import as_map_of_solid
from ..mesh.exchange import Cells
from ..mesh.meshes import TetMesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..maps.result import MapResult

__all__ = ["Morph", "frame_files", "morph"]

_MOST_FRAMES = 10_000
_COLLECTION = """<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1">
  <Collection>
{}
  </Collection>
</VTKFile>
"""


@dataclass(frozen=True, eq=False)
class Morph(HasSummary):
    """The straight way of every vertex from source to image.

    Attributes
    ----------
    solid : TetMesh
        The source.
    image : ndarray, shape (n, 3)
        Turned, shifted and scaled onto the source as well as a similarity can, if asked for.
    times : ndarray, shape (f,)
        From 0 (source) to 1 (image).
    flips : ndarray of int, shape (f,)
        Tets that are not positive in each frame. Both ends may be free of them and the way between
        not: nothing protects a linear homotopy.
    fields : Cells
        The source with the fields of the map, which every frame of a ``.pvd`` carries.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> way = sm.morph(sm.volume_map(solid), frames=5)
    >>> bool((way.frame(0) == solid.V).all()), way.times.tolist()
    (True, [0.0, 0.25, 0.5, 0.75, 1.0])
    """

    solid: TetMesh
    image: NDArray[np.float64]
    times: NDArray[np.float64]
    flips: NDArray[np.intp]
    fields: Cells = field(repr=False)

    def __repr__(self) -> str:
        return f"Morph({len(self.times)} frames of {self.solid!r})"

    def frame(self, i: int) -> NDArray[np.float64]:
        """(n, 3) vertices of frame i.

        Raises
        ------
        OptionError
            There is no such frame.
        """
        t = self.times[whole("the number of a frame", i, 0, len(self.times) - 1)]
        return np.asarray((1.0 - t) * self.solid.V + t * self.image)

    def to_dict(self) -> dict[str, Any]:
        """The figures, JSON-compatible."""
        return plain_dict({"frames": len(self.times), "most_flips": int(self.flips.max())})

    def summary(self) -> str:
        """A table of the figures."""
        return table(self.to_dict())

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write ``.pvd`` with one ``.vtu`` per frame beside it, or an animated ``.gif``.

        Returns
        -------
        list of Path
            Every file written.

        Raises
        ------
        FileFormatError
            Another suffix.
        MissingDependencyError
            meshio (frames) or matplotlib and pillow (picture) are not installed.
        OSError
            If a file cannot be written.
        """
        path = as_path(path)
        suffix = path.suffix.lower()
        if suffix == ".pvd":
            return self._save_frames(path)
        if suffix == ".gif":
            return self._save_picture(path)
        raise FileFormatError(f"{path}: a morph is written as .pvd or .gif")

    def _save_frames(self, path: Path) -> list[Path]:
        frames = frame_files(path, len(self.times))
        lines = [
            f'    <DataSet timestep="{t:.6g}" file={quoteattr(frame.name)}/>'
            for t, frame in zip(self.times, frames, strict=True)
        ]
        text = _COLLECTION.format("\n".join(lines))
        # The frames appear together, once all files are written, and what names them last.
        beside = path.absolute().parent
        with (
            atomic_path(path) as temporary,
            tempfile.TemporaryDirectory(prefix=".stretchmap-", dir=beside) as place,
        ):
            temporary.write_text(text, encoding="utf-8")
            for i, frame in enumerate(frames):
                solid = TetMesh(self.frame(i), self.solid.T)
                io.write(
                    Path(place, frame.name), solid, self.fields.point_data, self.fields.cell_data
                )
            for frame in frames:
                os.replace(Path(place, frame.name), frame)
        return [*frames, path]

    def picture(self, count: int = 4) -> Figure:
        """Some frames side by side, from the first to the last.

        Colors run along the source, and stay with their places.

        Parameters
        ----------
        count : int
            Number of frames shown, from 2 to as many as there are.

        Raises
        ------
        OptionError
            There are not so many frames.
        MissingDependencyError
            matplotlib is not installed.

        Examples
        --------
        >>> import stretchmap as sm
        >>> way = sm.morph(sm.volume_map(sm.samples.solid_torus(600)), frames=5)
        >>> [axes.get_title() for axes in way.picture(3).axes]
        ['t = 0.00', 't = 0.50', 't = 1.00']
        """
        from .style import empty_figure

        count = whole("count", count, 2, len(self.times))
        figure = empty_figure(3.0 * count, 3.4)
        shown = np.linspace(0, len(self.times) - 1, count).round().astype(int)
        for axes, i in zip(np.ravel(figure.subplots(1, count)), shown, strict=True):
            self._draw(axes, int(i))
        return figure

    def _draw(self, axes: Axes, i: int) -> None:
        from .painting import Scene
        from .style import along, broad_view

        ids, faces = self.solid.boundary_vertices, self.solid.surface.F
        start = self.solid.V[ids]
        scene = Scene(broad_view(start))
        scene.add_faces(self.frame(i)[ids][faces], along(start[faces].mean(axis=1), start))
        scene.draw(axes, np.concatenate([start, self.image[ids]]))
        axes.set_title(f"t = {self.times[i]:.2f}", fontsize=10)

    def _save_picture(self, path: Path) -> list[Path]:
        from .style import empty_figure

        figure = empty_figure(5.0, 4.6)
        from matplotlib.animation import FuncAnimation, PillowWriter

        axes = figure.add_subplot()

        def draw(i: int) -> list[Any]:
            axes.clear()
            self._draw(axes, i)
            return [axes.title]

        # There and back, so that the end meets the beginning.
        order = [*range(len(self.times)), *range(len(self.times) - 2, 0, -1)]
        animation = FuncAnimation(figure, draw, frames=order)
        with atomic_path(path) as temporary:
            animation.save(temporary, writer=PillowWriter(fps=12))
        return [path]


def frame_files(path: Path, frames: int) -> list[Path]:
    """Files of the frames of a morph beside its ``.pvd``; a picture has none.

    Parameters
    ----------
    path : Path
    frames : int
        Their number; beyond what a morph can have there are no more.
    """
    if path.suffix.lower() != ".pvd":
        return []
    return [path.with_name(f"{path.stem}_{i:03d}.vtu") for i in range(min(frames, _MOST_FRAMES))]


def morph(result: MapResult, frames: int = 21, *, align: bool = True) -> Morph:
    """Linear homotopy ``(1 - t) x + t f(x)`` from a solid to its image.

    Parameters
    ----------
    result : Registration, VolumeMap or LoadedMap
        Map of a solid.
    frames : int
        Number of frames, both ends included, from 2 to 10,000.
    align : bool
        Turn, shift and scale the image onto the source first (least squares, no reflection); else
        the solid travels and turns on its way.

    Returns
    -------
    Morph

    Raises
    ------
    OptionError
        Too few or too many frames, or an image that is a single point.
    KindError
        It is no map, or the map of a surface.

    Examples
    --------
    >>> import stretchmap as sm
    >>> way = sm.morph(sm.volume_map(sm.samples.bumpy_torus(1000)), frames=3)
    >>> way.flips.shape
    (3,)
    """
    result, solid = as_map_of_solid(result, "a morph")
    frames, align = whole("frames", frames, 2, _MOST_FRAMES), flag("align", align)
    image = np.asarray(result.image)
    if not np.ptp(image, axis=0).any():
        raise OptionError("the image is a single point")
    if align:
        from ..registration.landmarks import similarity

        rotation, scale, shift = similarity(image, solid.V)
        image = scale * image @ rotation + shift
    times = np.linspace(0.0, 1.0, frames)
    flips = [
        int((~(_core.mesh.tet_volumes((1.0 - t) * solid.V + t * image, solid.T) > 0.0)).sum())
        for t in times
    ]
    fields = result.as_cells()
    return Morph(solid, read_only(image), read_only(times), read_only(np.array(flips)), fields)
