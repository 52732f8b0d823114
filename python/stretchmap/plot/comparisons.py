"""Several maps of one mesh in one picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.options import instance
from ..certificate.comparison import Comparison
from ..mesh.meshes import TetMesh
from .style import BLACK, BLUE, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["comparison"]

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
