"""Figures that notebooks draw, without pyplot having been imported."""

from __future__ import annotations

import io

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

__all__ = ["Picture"]

_DPI = 100


class Picture(Figure):  # type: ignore[misc]  # a Figure is Any to mypy, which skips the types of matplotlib
    """A figure that belongs to no window and shows itself in a notebook."""

    def __init__(self, width: float, height: float) -> None:
        super().__init__(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(self)

    def _repr_png_(self) -> bytes:
        png = io.BytesIO()
        self.savefig(png, format="png", dpi=_DPI)
        return png.getvalue()
