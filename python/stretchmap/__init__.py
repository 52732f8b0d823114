"""Volume-preserving maps of solids with a hole onto the standard solid torus."""

from __future__ import annotations

import importlib
import os
from typing import Any

from ._version import __version__


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
    "TriMesh": "mesh.meshes",
    "TetMesh": "mesh.meshes",
    "read": "io",
    "write": "io",
    "Torus": "base.torus",
    "homology_basis": "homology.basis",
    "harmonic_forms": "homology.representatives",
    "holomorphic_forms": "homology.representatives",
    "conformal_map": "conformal.map",
    "area_map": "area.map",
    "threads": "base.threads",
    "volume_map": "volume.map",
    "FlipFreeOptions": "volume.options",
    "distortion": "measures.elements",
    "certify": "certificate.checks",
    "certify_file": "certificate.checks",
    "compare": "certificate.comparison",
    "Comparison": "certificate.comparison",
    "load_map": "maps.files",
    "PointMap": "maps.points",
    "partition": "partitions.parts",
    "register": "registration.map",
    "Landmarks": "registration.landmarks",
    "read_landmarks": "registration.landmarks",
    "hex_mesh": "resample.hexes",
    "transfer": "resample.fields",
    "morph": "plot.morphing",
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
