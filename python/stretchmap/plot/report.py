"""A page about a map that stands alone: figures, certificate, pictures, nothing to be fetched."""

from __future__ import annotations

import base64
import html
import io
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..base.files import atomic_path
from ..base.options import as_path
from ..base.tables import cell
from ..certificate.checks import certify
from ..errors import StretchmapError
from ..maps.given import as_map
from ..maps.result import MapResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["write_report"]

_CAPTIONS = {
    "checkerboard": "A checkerboard on the torus, and what it is on the source.",
    "cutaway": "Source and image laid open by the same cut, plane in the image.",
    "levels": "Five shells of equal volume around the core, laid open in steps.",
    "registration": "Landmarks on source and target; rings are where the map carries them.",
    "ratios": "Ratios of the elements before and after.",
    "convergence": "How the iterations went.",
    "domain": "The boundary in the angles of the torus, with cells of the source.",
    "loops": "The shortest loops that bound inside and outside.",
}
_NESTED = ("versions", "certificate", "seconds", "torus", "certified")
_MEANING = {
    "flips": "elements turned over",
    "ring_mean": "mean of the ratios per vertex, (6.3) or (6.5); 1 is ideal",
    "ring_std": "spread of the ratios per vertex, (6.3) or (6.5)",
    "element_error_mean": "mean of |ratio - 1| per element",
    "element_std": "spread of the ratios per element",
    "element_error_std": "spread of |ratio - 1| per element",
    "ratio_min": "smallest ratio of an element; positive where none is turned over",
    "ratio_max": "largest ratio of an element",
    "total_distortion": "total distortion (6.2) or (6.4); 0 is ideal",
    "angle_mean": "distortion of angles, mean over the elements; 1 is ideal",
    "angle_max": "distortion of angles, worst element",
    "energy": "stretch energy of the map",
    "energy_bound": "least stretch energy possible",
    "iterations": "steps of all stages",
    "torus": "radii of centre circle and tube, in the unit of the mesh",
    "landmark_error": "largest distance of a landmark from its counterpart, over the target's size",
    "gauge": "how the flat tori of the two boundaries were laid on each other",
    "snapped": "largest distance of a landmark given as a point from its vertex",
    "added_vertices": "put in where the boundary alone decided about tets",
}
_STYLE = """
body { font: 15px/1.5 sans-serif; color: #222;
       max-width: 60rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2rem }
table { border-collapse: collapse } td { padding: 0.1rem 1.2rem 0.1rem 0; vertical-align: top }
td:nth-child(2) { font-variant-numeric: tabular-nums } td:nth-child(3) { color: #555 }
figure { margin: 1.5rem 0 } img { max-width: 100% } figcaption { color: #555 }
.verdict { padding: 0.6rem 1rem; border-left: 5px solid; background: #f4f4f4 }
.yes { border-color: #0072B2 } .no { border-color: #D55E00 }
"""


def write_report(result: MapResult, path: str | os.PathLike[str], source: str = "") -> None:
    """Write one self-contained HTML page about a map.

    Pictures a map has no data for (a history, a torus, a target) are left out; of one that fails
    all the same, as on the boundary of a damaged mesh, the page says why.

    Parameters
    ----------
    result : MapResult
    path : path-like
        The ``.html`` file.
    source : str
        Name of the map for the heading.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import os, tempfile
    >>> import stretchmap as sm
    >>> from stretchmap.plot.report import write_report
    >>> result = sm.conformal_map(sm.samples.torus_surface(24, 12))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "page.html")
    ...     write_report(result, path, source="a torus")
    ...     os.path.getsize(path) > 1000
    True
    """
    result, path = as_map(result), as_path(path)
    text = _page(result, source)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _page(result: MapResult, source: str) -> str:
    figures = result.to_dict()
    certificate = certify(result.mesh, result.image, result.torus)
    rows = {name: value for name, value in figures.items() if name not in _NESTED}
    if result.torus is not None:
        rows["torus"] = f"R = {result.torus.R:.6g}, r = {result.torus.r:.6g}"
    verdict, style = (
        ("Certified: the map is one to one. ", "yes")
        if certificate.certified
        else ("Not certified. ", "no")
    )
    title = f"{figures['kind']} map {source}".replace("map map", "map").strip()
    parts = [
        f'<p class="verdict {style}"><b>{verdict}</b>{html.escape(certificate.reason)}.</p>',
        *_pictures(result),
        "<h2>Figures</h2>",
        figure_table(rows),
        "<h2>Certificate</h2>",
        figure_table({**certificate.checks, **certificate.quantities}),
        "<h2>Seconds</h2>",
        figure_table(figures["seconds"]),
        "<h2>Versions</h2>",
        figure_table(figures["versions"]),
    ]
    return page(title, parts)


def page(title: str, parts: Sequence[str]) -> str:
    """A whole page from its parts."""
    parts = [f"<h1>{html.escape(title)}</h1>", *parts]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f"<title>{html.escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body>\n</html>\n"
    )


def _pictures(result: MapResult) -> list[str]:
    """Every picture there is data for."""
    from .. import plot

    parts, missing = [], []
    drawable = plot.kinds(result)
    for kind, caption in ((kind, _CAPTIONS[kind]) for kind in _CAPTIONS if kind in drawable):
        try:
            figure = plot.picture(result, kind)
        except StretchmapError as error:
            if isinstance(error, ImportError):
                raise
            missing.append(f"<li>{html.escape(caption)} {html.escape(str(error))}</li>")
            continue
        parts.append(
            f'<figure><img alt="{html.escape(caption)}" src="{embedded(figure)}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
        )
    if missing:
        parts.append(f"<p>Not drawn:</p><ul>{''.join(missing)}</ul>")
    return parts


def embedded(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=110, format="png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def figure_table(rows: Mapping[str, Any]) -> str:
    lines = (
        f"<tr><td>{html.escape(str(name).replace('_', ' '))}</td>"
        f"<td>{html.escape(cell(value))}</td><td>{html.escape(_MEANING.get(name, ''))}</td></tr>"
        for name, value in rows.items()
    )
    return f"<table>{''.join(lines)}</table>"
