"""What the pictures have in common: an empty figure, colors, views, the boundary of a map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingDependencyError, OptionError
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh, TriMesh
from .painting import Array, View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BELOW = "outside lower center"  # of a figure, for legends
BLACK, GRAY = "#000000", "#8C8C8C"
ORANGE, BLUE, VERMILION = "#E69F00", "#0072B2", "#D55E00"
LIGHT_GRAY = np.array([0.86, 0.86, 0.86])


def empty_figure(width: float, height: float) -> Figure:
    """An empty figure, in inches, that belongs to no window.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    """
    try:
        from .figure import Picture
    except ImportError as error:
        raise MissingDependencyError(
            "pictures need matplotlib: pip install 'stretchmap[plot]'"
        ) from error
    return Picture(width, height)


def boundary(result: MapResult) -> tuple[TriMesh, Array]:
    """Boundary surface of the source and the images of its vertices."""
    mesh, image = result.mesh, np.asarray(result.image)
    if isinstance(mesh, TetMesh):
        return mesh.surface, image[mesh.boundary_vertices]
    return mesh, image


def torus_angles(result: MapResult, image: Array) -> Array:
    """(n, 2) angles of boundary images.

    Raises
    ------
    OptionError
        The map names no torus.
    """
    if result.torus is None:
        raise OptionError("the map names no torus, so it has no (u, v)")
    u, v, _ = result.torus.coordinates(image)
    return np.stack([u, v], axis=1)


def frame(points: Array) -> Array:
    """(3, 3) principal axes (rows, longest first), signs fixed."""
    _, axes = np.linalg.eigh(np.cov((points - points.mean(axis=0)).T))
    axes = axes[:, ::-1].T
    signs = np.sign(axes[np.arange(3), np.abs(axes).argmax(axis=1)])
    return np.asarray(axes * signs[:, None])


def principal(reference: Array, points: Array) -> Array:
    """Coordinates of points along the principal axes of others."""
    return np.asarray((points - reference.mean(axis=0)) @ frame(reference).T)


def broad_view(points: Array) -> View:
    """From where the broad side of a shape is seen, its longest axis running across."""
    axes = frame(points)
    axes[1] *= np.linalg.det(axes)  # a rotation, no reflection
    return View(45.0, -70.0, axes)


def viridis(values: Array) -> Array:
    """(n, 3) colors of values from 0 to 1."""
    return _from_table("viridis", values)


def cividis(values: Array) -> Array:
    """(n, 3) colors of values from 0 to 1."""
    return _from_table("cividis", values)


def along(place: Array, reference: Array) -> Array:
    """Viridis by the position of points along the longest axis of others."""
    span = principal(reference, reference)[:, 0]
    return viridis((principal(reference, place)[:, 0] - span.min()) / np.ptp(span))


def steps(count: int) -> Array:
    """Colors of a few things in a row, from dark to light."""
    return viridis(np.linspace(0.0, 0.95, count))


def color_bar(
    figure: Figure, axes: Axes | Sequence[Axes] | NDArray[Any], V: Array, ratio: bool = False
) -> None:
    """Bar for the colors of `along` or, with ``ratio``, of cividis from 0.5 to 1.5."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    span = principal(V, V)[:, 0]
    norm = Normalize(0.5, 1.5) if ratio else Normalize(span.min(), span.max())
    label = (
        "volume ratio, image over source (dimensionless)"
        if ratio
        else "position along the longest axis of the source\n(unit of the mesh)"
    )
    mappable = ScalarMappable(norm, "cividis" if ratio else "viridis")
    figure.colorbar(
        mappable, ax=axes, label=label, shrink=0.85, extend="both" if ratio else "neither"
    )


def _from_table(name: str, values: Array) -> Array:
    from matplotlib import colormaps

    return np.array(colormaps[name](np.clip(values, 0.0, 1.0))[:, :3])
