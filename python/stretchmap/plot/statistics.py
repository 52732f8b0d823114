"""Histograms of the ratios, and the course of the iterations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import OptionError
from ..maps.given import as_map
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh
from .painting import Array
from .style import BLACK, BLUE, GRAY, ORANGE, empty_figure, steps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKERS = "os^Dv*"


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

    Examples
    --------
    >>> import stretchmap as sm
    >>> figure = sm.plot.ratios(sm.area_map(sm.samples.torus_surface(24, 12)))
    >>> figure.axes[0].get_ylabel()
    'faces per bin (%)'
    """
    result = as_map(result)
    figure = empty_figure(7.0, 4.2)
    after = result.distortion.ratios
    before, name = ratios_before(result)
    what = "volume" if isinstance(result.mesh, TetMesh) else "area"
    axes = figure.add_subplot()
    low, high = np.quantile(np.concatenate([before, after]), [0.002, 0.998])
    low, high = min(low, 0.9), max(high, 1.1)
    bins = np.linspace(low, high, 121)
    for values, label, color in ((before, name, ORANGE), (after, "final map", BLUE)):
        clipped = np.clip(values, low, high)
        share = np.full(len(values), 100.0 / len(values))
        percent, _ = np.histogram(clipped, bins, weights=share)
        axes.stairs(percent, bins, fill=True, color=color, alpha=0.35)
        text = f"{label}: SD {values.std():.3g}, {int((values <= 0.0).sum())} flipped"
        axes.stairs(percent, bins, color=color, linewidth=1.6, label=text)
    axes.axvline(1.0, color=BLACK, linewidth=0.8, linestyle=":")
    axes.set_xlim(low, high)
    axes.set_yscale("log")
    axes.set_xlabel(
        f"{what} ratio, image over source, mean 1 (dimensionless; end bins hold what lies beyond)"
    )
    axes.set_ylabel(f"{'tets' if what == 'volume' else 'faces'} per bin (%)")
    axes.set_ylim(top=4.0 * axes.get_ylim()[1])  # room for the legend
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

    Examples
    --------
    >>> import stretchmap as sm
    >>> figure = sm.plot.convergence(sm.area_map(sm.samples.torus_surface(24, 12)))
    >>> len(figure.axes)
    3
    """
    history = as_map(result).history
    if not history:
        raise OptionError("this map has no history of iterations to be drawn")
    figure = empty_figure(7.4, 6.4)
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    stages = list(dict.fromkeys(record.stage for record in history))
    position = np.arange(len(history))
    energy = np.array([record.energy for record in history])
    flips = np.array([record.flips for record in history], float)
    for number, (stage, color) in enumerate(zip(stages, steps(len(stages)), strict=True)):
        at = np.array([record.stage == stage for record in history])
        look = {"marker": _MARKERS[number % len(_MARKERS)], "ms": 4, "color": color}
        values = energy[at]
        scale = values[np.isfinite(values)][:1]
        if len(scale) and scale[0] > 0.0:
            top.plot(position[at], values / scale, label=stage, **look)
        counted = at & (flips >= 0)
        bottom.plot(position[counted], flips[counted], **look)
    spreads = (
        ("element_std", "elements", "o-", BLACK),
        ("ring_std", "vertex rings", "s--", GRAY),
    )
    for name, label, style, color in spreads:
        values = np.array([getattr(record, name) for record in history])
        if np.isfinite(values).any():
            middle.plot(position, values, style, ms=3, color=color, label=label)
    top.set_yscale("log")
    top.set_ylabel("energy over that at\nthe start of the stage\n(dimensionless)")
    middle.set_yscale("log")
    middle.set_ylabel("SD of the ratios\n(dimensionless)")
    bottom.set_yscale("symlog", linthresh=1.0)
    bottom.set_ylim(bottom=0.0, top=max(1.0, 2.0 * flips.max(initial=0.0)))
    bottom.set_ylabel("flipped elements\n(number)")
    bottom.set_xlabel("iteration, all stages counted on")
    bottom.xaxis.get_major_locator().set_params(integer=True)
    for axes in (top, middle):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.align_ylabels()
    return figure


def ratios_before(result: MapResult) -> tuple[Array, str]:
    """Ratios of the map one would have without preserving anything, and its name."""
    from .. import _core
    from ..conformal.map import conformal_map
    from ..volume.vsem import minimize_volumetric_stretch

    mesh = result.mesh
    if not isinstance(mesh, TetMesh):
        return conformal_map(mesh).distortion.ratios, "conformal map"
    fixed = np.zeros(mesh.n_vertices, np.uint8)
    fixed[mesh.boundary_vertices] = 1
    run = minimize_volumetric_stretch(
        mesh.V, mesh.T, fixed, np.array(result.image), c=0.0, max_iter=0, tol=0.0
    )
    volumes = _core.mesh.tet_volumes(run.image, mesh.T)
    rest = mesh.tet_volumes
    return volumes / volumes.sum() * rest.sum() / rest, "harmonic map"
