"""Pictures of the gallery: the figures an example makes, which pyplot knows nothing of."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def figures(block: object, variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Save every figure that an example has made since its last block."""
    shown = variables.setdefault("figures_shown", [])
    paths = []
    for value in variables["example_globals"].values():
        if isinstance(value, Figure) and all(value is not other for other in shown):
            shown.append(value)
            paths.append(next(variables["image_path_iterator"]))
            value.savefig(paths[-1], dpi=100)
    return figure_rst(paths, gallery["src_dir"])


def _get_sg_image_scraper() -> Any:
    return figures
