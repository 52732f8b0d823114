"""Small things every output needs: tables, JSON-ready values, versions, files that appear whole."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from typing import Any

import numpy as np


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
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


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
