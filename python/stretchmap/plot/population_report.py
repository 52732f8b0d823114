"""A page about a population that stands alone: mean, modes, measures, outliers, every shape."""

from __future__ import annotations

import html
import os
from typing import TYPE_CHECKING

from ..base.files import atomic_path
from ..base.options import as_path, instance
from ..base.tables import cell
from ..population.result import Population
from .populations import compactness, distances, modes
from .report import embedded, figure_table, page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["write_population_report"]

_COLUMNS = ("name", "n_tets", "certified", "along", "distance", "volume_ratio_std", "seconds")


def write_population_report(
    population: Population, path: str | os.PathLike[str], source: str = ""
) -> None:
    """Write one self-contained HTML page about a population.

    Parameters
    ----------
    population : Population
    path : path-like
        The ``.html`` file.
    source : str
        Name for the heading.

    Raises
    ------
    OptionError
        It is no population.
    MissingDependencyError
        matplotlib is not installed.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> from stretchmap.plot.population_report import write_population_report
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:3], max_rounds=1, tol=1.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_population_report(found, os.path.join(folder, "page.html"))
    ...     os.listdir(folder)
    ['page.html']
    """
    population = instance("population", population, Population, "stretchmap.population.fit(...)")
    path = as_path(path)
    text = page(f"population {source}".strip(), _parts(population))
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _parts(population: Population) -> list[str]:
    found = population.to_dict()
    figures = {
        k: v for k, v in found.items() if k not in ("shapes", "versions", "outliers", "doubts")
    }
    sound = found["all_certified"] and found["mean_certified"]
    verdict = "All maps are certified. " if sound else "Not all maps are certified. "
    if population.skipped:
        verdict += f"Skipped: {', '.join(population.skipped)}. "
    verdict += " ".join(f"{name}: {doubt}. " for name, doubt in population.doubts.items())
    style = "yes" if sound and not population.skipped and not population.doubts else "no"
    parts = [
        f'<p class="verdict {style}"><b>{html.escape(verdict)}</b>'
        f"{html.escape(population.stop_reason)}.</p>",
        "<h2>Mean and modes</h2>",
        _picture(modes(population), "The mean, and two standard deviations of the first modes."),
    ]
    if len(population.names) > 2:
        caption = "How many modes it takes (Styner et al. 2003): variance explained, distance of "
        caption += "shapes left out, distance of random shapes from the nearest real one."
        parts += ["<h2>Measures</h2>", _picture(compactness(population), caption)]
        unlike = population.outliers()
        words = ", ".join(f"{name} ({score:.1f} robust SD)" for name, score in unlike.items())
        parts += [
            "<h2>Outliers</h2>",
            f"<p>{html.escape(words or 'None')}.</p>",
            _picture(distances(population), "Distance of every shape from the mean."),
        ]
    return [
        *parts, "<h2>Figures</h2>", figure_table(figures), "<h2>Shapes</h2>", _shapes(population),
        "<h2>Versions</h2>", figure_table(found["versions"]),
    ]  # fmt: skip


def _shapes(population: Population) -> str:
    heads = "".join(f"<th>{name.replace('_', ' ')}</th>" for name in _COLUMNS)
    lines = [f"<tr>{heads}</tr>"]
    for record in population.records:
        if record["ok"]:
            cells = [html.escape(cell(record[name])) for name in _COLUMNS]
        else:
            cells = [html.escape(record["name"]), f"skipped: {html.escape(record['error'])}"]
        lines.append(f"<tr>{''.join(f'<td>{text}</td>' for text in cells)}</tr>")
    return f"<table>{''.join(lines)}</table>"


def _picture(figure: Figure, caption: str) -> str:
    return (
        f'<figure><img alt="{html.escape(caption)}" src="{embedded(figure)}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )
