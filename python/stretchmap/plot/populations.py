"""Pictures of a population: mean, modes, how many it takes, who is unlike the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.options import instance, whole
from ..mesh.meshes import TetMesh
from ..population.result import Population
from .painting import Array, Scene, View
from .style import BELOW, BLUE, GRAY, VERMILION, broad_view, cividis, empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["compactness", "distances", "modes", "surface_field"]

_DEVIATIONS = 2.0


def modes(population: Population, count: int = 3) -> Figure:
    """The mean between minus and plus two standard deviations of the first modes.

    The color is how far a point of the surface moves, from none to the most of any mode shown.

    Parameters
    ----------
    population : Population
    count : int
        Number of modes, at most as many as there are.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OptionError
        It is no population, or the count is not positive.
    MissingDependencyError
        matplotlib is not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.plot.populations import modes
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:3], max_rounds=1, tol=1.0)
    >>> len(modes(found, 2).axes)
    7
    """
    population = instance("population", population, Population, "stretchmap.population.fit(...)")
    count = min(whole("count", count, 1), population.model.n_modes)
    figure = empty_figure(9.6, 2.9 * count)
    grid = figure.subplots(count, 3, squeeze=False)
    mean, model = population.mean, population.model
    moved = _DEVIATIONS * np.sqrt(model.variances[:count, None])
    moved = moved * np.linalg.norm(model.modes[:count], axis=2)
    view, most = broad_view(mean.surface.V), float(moved.max())
    for k, row in enumerate(grid):
        for axes, deviations in zip(row, (-_DEVIATIONS, 0.0, _DEVIATIONS), strict=True):
            solid = population.mode(k, deviations)
            values = moved[k] / most if deviations else np.zeros(mean.n_vertices)
            _paint(axes, solid, values, view)
            what = f"mode {k + 1}, {deviations:+g} SD" if deviations else "mean"
            axes.set_title(what)
    _bar(figure, grid, 0.0, most, "way of a point from the mean\n(unit of the shapes)")
    return figure


def compactness(population: Population) -> Figure:
    """Compactness, generalization and specificity against the number of modes.

    Parameters
    ----------
    population : Population
        Of three shapes or more.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ArrayError
        Fewer shapes.
    OptionError
        It is no population.
    MissingDependencyError
        matplotlib is not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.plot.populations import compactness
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:3], max_rounds=1, tol=1.0)
    >>> [axes.get_title() for axes in compactness(found).axes]
    ['compactness', 'generalization', 'specificity']
    """
    population = instance("population", population, Population, "stretchmap.population.fit(...)")
    measures = population.measures
    figure = empty_figure(9.6, 3.0)
    panels = figure.subplots(1, 3)
    rows = {
        "compactness": 100.0 * measures.compactness,
        "generalization": measures.generalization.mean(axis=1),
        "specificity": measures.specificity.mean(axis=1),
    }
    units = ("variance explained (%)", *2 * ("mean distance\n(unit of the shapes)",))
    for axes, (title, values), unit in zip(panels, rows.items(), units, strict=True):
        axes.plot(np.arange(len(values)), values, "o-", color=BLUE, markersize=4)
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.set(title=title, xlabel="modes", ylabel=unit)
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
    return figure


def distances(population: Population) -> Figure:
    """Distance of every shape from the mean, outliers marked.

    Parameters
    ----------
    population : Population

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OptionError
        It is no population.
    MissingDependencyError
        matplotlib is not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.plot.populations import distances
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:3], max_rounds=1, tol=1.0)
    >>> distances(found).axes[0].get_ylabel()
    'distance from the mean\\n(unit of the shapes)'
    """
    population = instance("population", population, Population, "stretchmap.population.fit(...)")
    figure = empty_figure(9.6, 3.2)
    axes = figure.add_subplot()
    order = np.argsort(population.distances)
    far = set(population.outliers())
    names = [population.names[i] for i in order]
    colors = [VERMILION if name in far else GRAY for name in names]
    axes.bar(np.arange(len(names)), population.distances[order], color=colors)
    step = max(1, len(names) // 40)
    axes.set_xticks(np.arange(0, len(names), step), names[::step], rotation=90, fontsize=8)
    axes.set_ylabel("distance from the mean\n(unit of the shapes)")
    if far:
        axes.bar([0], [0], color=VERMILION, label="unlike the others")
        figure.legend(loc=BELOW)
    return figure


def surface_field(solid: TetMesh, values: Array, label: str) -> Figure:
    """A field in the tets of a solid, as seen on its boundary from two sides.

    Parameters
    ----------
    solid : TetMesh
    values : ndarray, shape (n_tets,)
        Of the tets; NaN is drawn as the least.
    label : str
        What it is, with its unit.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.

    Examples
    --------
    >>> import numpy as np
    >>> import stretchmap as sm
    >>> from stretchmap.plot.populations import surface_field
    >>> solid = sm.samples.solid_torus(600)
    >>> len(surface_field(solid, np.arange(solid.n_tets, dtype=float), "number").axes)
    3
    """
    figure = empty_figure(9.6, 4.0)
    panels = figure.subplots(1, 2)
    skin = np.asarray(values, float)[solid.boundary_tets]
    low, high = np.nanmin(skin), np.nanmax(skin)
    share = np.nan_to_num((skin - low) / (high - low if high > low else 1.0))
    view = broad_view(solid.surface.V)
    for axes, side in zip(panels, (view, view.opposite()), strict=True):
        scene = Scene(side)
        scene.add_faces(solid.surface.V[solid.surface.F], cividis(share))
        scene.draw(axes)
    _bar(figure, panels, float(low), float(high), label)
    return figure


def _paint(axes: Axes, solid: TetMesh, values: Array, view: View) -> None:
    """The surface of a solid colored by values from 0 to 1 at the solid's vertices."""
    surface = solid.surface
    skin = values[solid.boundary_vertices]
    scene = Scene(view)
    scene.add_faces(surface.V[surface.F], cividis(skin[surface.F].mean(axis=1)))
    scene.draw(axes)


def _bar(figure: Figure, axes: object, low: float, high: float, label: str) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    mappable = ScalarMappable(Normalize(low, high), "cividis")
    figure.colorbar(mappable, ax=axes, label=label, shrink=0.8)
