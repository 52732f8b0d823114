"""Small things every output needs: tables, JSON-ready values, versions."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from .arrays import freeze


def versions() -> dict[str, str]:
    """Versions of stretchmap and of what it computes with."""
    import scipy

    from .._version import __version__

    return {
        "stretchmap": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }


def plain(value: Any) -> Any:
    """A copy made of what JSON knows: NumPy scalars and arrays converted, non-finite to None."""
    if isinstance(value, Mapping):
        return plain_dict(value)
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def plain_dict(rows: Mapping[Any, Any]) -> dict[str, Any]:
    """`plain` of every entry, by the name of its key."""
    return {str(name): plain(value) for name, value in rows.items()}


def table(rows: Mapping[str, Any]) -> str:
    """Two aligned columns, one row per entry."""
    width = max((len(name) for name in rows), default=0)
    return "\n".join(f"{name.replace('_', ' '):<{width}}  {cell(v)}" for name, v in rows.items())


def cell(value: Any) -> str:
    """A value as tables show it."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {cell(entry)}" for name, entry in value.items())
    if isinstance(value, (list, tuple)):
        return f"({', '.join(cell(entry) for entry in value)})"
    return format(value, ".6g") if isinstance(value, float) else str(value)


class HasSummary:
    """What results share: notebooks show their ``summary()``, and copies are as read-only as they
    are."""

    def summary(self) -> str:
        """A table of names and values."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        return html(self.summary())

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Of a copy or a pickle, in which NumPy makes all arrays writable."""
        self.__dict__.update(state)
        freeze(state)


def html(text: str) -> str:
    """A table of `table` as HTML: one row per line, cells parted by two spaces or more.

    Examples
    --------
    >>> html(table({"n_tets": 6}))
    '<table><tbody><tr><th>n tets</th><td>6</td></tr></tbody></table>'
    """
    rows = []
    for line in text.splitlines():
        name, *values = re.split(r"\s{2,}", line.rstrip())
        cells = "".join(f"<td>{escape(value)}</td>" for value in values)
        rows.append(f"<tr><th>{escape(name)}</th>{cells}</tr>")
    return f"<table><tbody>{''.join(rows)}</tbody></table>"
