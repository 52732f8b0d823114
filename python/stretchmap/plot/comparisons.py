"""Several maps of one mesh in one picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..base.options import instance, real
from ..certificate.comparison import Comparison
from ..errors import OptionError
from ..maps.result import MapResult
from ..mesh.meshes import TetMesh
from .style import BLACK, BLUE, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["comparison", "tradeoff"]

_RANGE = (0.0, 2.0)  # ratios beyond are counted at the ends


def comparison(found: Comparison) -> Figure:
    """Histograms of the area or volume ratios of each map, one below the other.

    Parameters
    ----------
    found : Comparison
        Of `compare`.

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
    >>> solid = sm.samples.solid_torus(600)
    >>> found = sm.compare(solid, {"as it is": solid.V, "mapped": sm.volume_map(solid)})
    >>> len(sm.plot.comparison(found).axes)
    2
    """
    instance("found", found, Comparison, "see stretchmap.compare")
    names = list(found.distortion)
    figure = empty_figure(7.0, 1.0 + 1.3 * len(names))
    bins = np.linspace(*_RANGE, 101)
    rows = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(rows, names, strict=True):
        measured = found.distortion[name]
        share = np.full(len(measured.ratios), 100.0 / len(measured.ratios))
        axes.hist(np.clip(measured.ratios, *_RANGE), bins=bins, weights=share, color=BLUE)
        axes.axvline(1.0, color=BLACK, linewidth=0.8, linestyle=":")
        axes.set_yscale("log")
        axes.set_ylabel("%")
        proven = "one to one" if found.certificate[name].certified else "not certified"
        flips = "" if measured.flips is None else f", {measured.flips} flipped"
        axes.set_title(
            f"{name}: SD {measured.element_std:.3g}{flips}, {proven}", loc="left", fontsize=10
        )
    what = "volume" if isinstance(found.mesh, TetMesh) else "area"
    rows[-1].set_xlim(*_RANGE)
    rows[-1].set_xlabel(f"{what} ratio, image over source, mean 1 (end bins hold what lies beyond)")
    return figure


def tradeoff(maps: Mapping[float, MapResult]) -> Figure:
    """What a map costs in shape for what it gains in volume: SD of the ratios by angle distortion.

    Parameters
    ----------
    maps : mapping
        Map for each value of ``balance``, see `volume_map`.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OptionError
        Fewer than two maps, or a key that is no number.
    MissingDependencyError
        matplotlib is not installed.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.bumpy_torus(600)
    >>> maps = {b: sm.volume_map(solid, balance=b) for b in (0.0, 1.0)}
    >>> len(sm.plot.tradeoff(maps).axes)
    1
    """
    if not isinstance(maps, Mapping) or len(maps) < 2:
        raise OptionError("maps must be a mapping of two or more values of balance to their maps")
    given = {real("a key of maps", balance): result for balance, result in maps.items()}
    found = {
        balance: instance("maps", given[balance], MapResult, "maps of this package")
        for balance in sorted(given)
    }
    figure = empty_figure(6.0, 4.0)
    axes = figure.subplots()
    angle = [result.distortion.angle_mean for result in found.values()]
    spread = [result.distortion.element_std for result in found.values()]
    axes.plot(angle, spread, marker="o", color=BLUE)
    for balance, x, y in zip(found, angle, spread, strict=True):
        axes.annotate(
            f"{balance:g}", (x, y), xytext=(5, 5), textcoords="offset points", color=BLACK
        )
    axes.set_yscale("log")
    axes.set_xlabel("angle distortion, mean (1: shapes kept)")
    axes.set_ylabel("SD of the size ratios")
    axes.set_title("numbers: balance, 0 shape to 1 volume", loc="left", fontsize=10)
    return figure
