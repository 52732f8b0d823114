"""Volume-preserving maps of solids with a hole onto the standard solid torus."""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

# name -> module; loaded on first use so that `import stretchmap` stays fast.
_EXPORTS = {
    "TriMesh": "mesh",
    "TetMesh": "mesh",
    "read": "io",
    "write": "io",
    "Torus": "torus",
    "homology_basis": "homology",
    "harmonic_forms": "forms",
    "holomorphic_forms": "forms",
    "conformal_map": "conformal",
    "area_map": "area",
    "volume_map": "volume",
    "distortion": "measures",
    "certify": "certificate",
    "certify_file": "certificate",
    "load_map": "results",
}
_MODULES = {"errors", "samples", "plot"}

__all__ = ["__version__", *_EXPORTS, *sorted(_MODULES)]


def __getattr__(name: str) -> Any:
    if name in _EXPORTS:
        value = getattr(importlib.import_module(f"{__name__}.{_EXPORTS[name]}"), name)
        globals()[name] = value
        return value
    if name in _MODULES:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
