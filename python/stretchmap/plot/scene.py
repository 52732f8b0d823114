"""Scenes of maps in three dimensions, by the optional package PyVista.

Every function returns a ``pyvista.Plotter`` that has not been shown: call ``show()`` to turn it
about with the mouse, `widget` for the same in a notebook, or `save` for a picture.
`stretchmap.plot` draws these and more by matplotlib alone.
"""

from __future__ import annotations

import importlib.util
import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.files import atomic_path
from ..base.options import as_path, instance, one_of
from ..errors import FileFormatError, MissingDependencyError, OptionError
from ..maps.given import as_map_of_solid
from ..maps.result import MapResult
from ..mesh.given import as_mesh
from ..mesh.meshes import TetMesh, TriMesh
from .solids import Color
from .style import principal

if TYPE_CHECKING:
    import pyvista

__all__ = ["cut", "loops", "save", "widget"]

_COLORS = {"coordinate": ("viridis", None), "ratio": ("cividis", (0.5, 1.5))}


def cut(
    result: MapResult, color: Color = "coordinate", *, off_screen: bool = True
) -> pyvista.Plotter:
    """The solid torus, cut open by a plane through its axis.

    Parameters
    ----------
    result : MapResult
        A map of a solid.
    color : {"coordinate", "ratio"}
        By the position along the longest axis of the source, or by the volume ratio of each tet.
    off_screen : bool
        Draw without a window.

    Returns
    -------
    pyvista.Plotter

    Raises
    ------
    ArrayError
        The map is one of a surface.
    OptionError
        Another color.
    MissingDependencyError
        PyVista is not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.plot import scene
    >>> plotter = scene.cut(sm.volume_map(sm.samples.solid_torus(600)))  # doctest: +SKIP
    >>> plotter.show()  # doctest: +SKIP
    """
    result, solid = as_map_of_solid(result, "a cut")
    one_of("color", color, tuple(_COLORS))
    pv = _pyvista()
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: solid.T}, result.image)
    place = principal(solid.V, solid.V)[:, 0]
    grid.point_data["coordinate"] = place
    grid.cell_data["ratio"] = result.distortion.ratios
    half = grid.clip("y", origin=(0.0, 0.0, 0.0), invert=False)
    table, limits = _COLORS[color]
    plotter = pv.Plotter(off_screen=off_screen)
    # The line break keeps the title off the numbers below it.
    title = ("place in the source" if color == "coordinate" else "volume ratio") + "\n"
    bar = {"title": title, "position_x": 0.2, "position_y": 0.01, "height": 0.11}
    clim = limits or (place.min(), place.max())
    plotter.add_mesh(half, scalars=color, cmap=table, clim=clim, ambient=0.3, scalar_bar_args=bar)
    _look(plotter)
    return plotter


def loops(mesh: TriMesh | TetMesh, *, off_screen: bool = True) -> pyvista.Plotter:
    """A surface, half transparent, with its shortest handle loops and tunnel loops.

    Parameters
    ----------
    mesh : TriMesh or TetMesh
        Of any genus, a sphere having no loops; of a solid its boundary.
    off_screen : bool
        Draw without a window.

    Returns
    -------
    pyvista.Plotter

    Raises
    ------
    MeshError
        As `homology_basis`.
    MissingDependencyError
        PyVista is not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.plot import scene
    >>> scene.loops(sm.samples.double_torus()).show()  # doctest: +SKIP
    """
    from ..homology.basis import homology_basis

    mesh = as_mesh(mesh)
    pv = _pyvista()
    solid = mesh if isinstance(mesh, TetMesh) else None
    surface = mesh.surface if isinstance(mesh, TetMesh) else mesh
    basis = homology_basis(surface, solid)
    plotter = pv.Plotter(off_screen=off_screen)
    faces = pv.PolyData.from_regular_faces(surface.V, surface.F)
    plotter.add_mesh(faces, color="#DDDDDD", opacity=0.6, smooth_shading=True)
    families = [("handle", "#D55E00", basis.handle_loops)]
    if basis.tunnel_classes is not None:
        families.append(("tunnel", "#0072B2", basis.tunnel_loops))
    for name, shade, found in families:
        look = {"color": shade, "line_width": 9, "render_lines_as_tubes": True}
        for loop in found:
            plotter.add_mesh(_ring(pv, surface.V[loop]), label=f"{name} loop", **look)
    if surface.genus:
        plotter.add_legend(bcolor="white", size=(0.2, 0.08 * len(families)))
    _look(plotter)
    return plotter


def save(plotter: pyvista.Plotter, path: str | os.PathLike[str]) -> None:
    """Write a scene as a picture (``.png``) that appears whole or not at all.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Closed afterwards.
    path : path-like

    Raises
    ------
    FileFormatError
        Another suffix.
    OptionError
        It is no scene, or one that is closed.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.plot import scene
    >>> scene.save(scene.loops(sm.samples.double_torus()), "loops.png")  # doctest: +SKIP
    """
    path = as_path(path)
    if path.suffix.lower() != ".png":
        raise FileFormatError(f"{path}: scenes are saved as .png")
    _require_scene(plotter)
    with atomic_path(path) as temporary:
        try:
            plotter.screenshot(str(temporary))
        except RuntimeError as error:
            raise OptionError(f"the scene cannot be saved, make it anew: {error}") from error
    plotter.close()


def widget(plotter: pyvista.Plotter) -> Any:
    """A scene as a notebook shows it: turned about by the mouse where that is possible.

    Parameters
    ----------
    plotter : pyvista.Plotter

    Returns
    -------
    object
        To end a cell with. A widget that needs no server where trame, trame-vtk and ipywidgets are
        installed (``pip install 'pyvista[jupyter]'``), else a picture.

    Raises
    ------
    OptionError
        It is no scene, or this is no notebook: call ``plotter.show()``.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.plot import scene
    >>> scene.widget(scene.loops(sm.samples.double_torus()))  # doctest: +SKIP
    """
    _require_scene(plotter)
    if not plotter.notebook:
        raise OptionError("widgets are for notebooks; elsewhere call show() of the scene")
    found = all(importlib.util.find_spec(name) for name in ("trame", "trame_vtk", "ipywidgets"))
    return plotter.show(jupyter_backend="html" if found else "static", return_viewer=True)


def _require_scene(plotter: Any) -> None:
    instance("plotter", plotter, _pyvista().Plotter, "from scene.cut or scene.loops")


def _ring(pv: Any, points: NDArray[np.float64]) -> Any:
    k = len(points)
    line = np.concatenate([[k + 1], np.arange(k), [0]])
    return pv.PolyData(points, lines=line)


def _look(plotter: Any) -> None:
    plotter.set_background("white")
    plotter.camera_position = "xz"
    plotter.camera.elevation = 35.0
    plotter.camera.azimuth = -20.0
    plotter.reset_camera()
    plotter.camera.zoom(1.1)


def _pyvista() -> Any:
    try:
        import pyvista
    except ImportError as error:
        raise MissingDependencyError(
            "scenes need PyVista: pip install 'stretchmap[viz]'"
        ) from error
    return pyvista
