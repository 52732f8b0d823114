"""Volume-preserving maps of solids with a hole onto the standard solid torus."""

from __future__ import annotations

import importlib
import os
from typing import Any

__version__ = "0.1.0"


def _load_core() -> None:
    """Load the C++ core with OpenMP threads that sleep while they wait.

    The OpenMP runtime reads its policy once, when it is loaded, and by default its threads spin:
    on a machine that has other work to do that costs several times the run time. A policy set by
    the user stands, and the environment is left as it was.
    """
    if "OMP_WAIT_POLICY" in os.environ:
        importlib.import_module(f"{__name__}._core")
        return
    os.environ["OMP_WAIT_POLICY"] = "passive"
    try:
        importlib.import_module(f"{__name__}._core")
    finally:
        del os.environ["OMP_WAIT_POLICY"]


_load_core()

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
    "threads": "_threads",
    "volume_map": "volume",
    "FlipFreeOptions": "flip_free",
    "distortion": "measures",
    "certify": "certificate",
    "certify_file": "certificate",
    "load_map": "results",
    "PointMap": "coordinates",
    "partition": "partitions",
    "register": "registration",
    "Landmarks": "landmarks",
    "read_landmarks": "landmarks",
    "hex_mesh": "resample",
    "transfer": "resample",
    "morph": "morphing",
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
