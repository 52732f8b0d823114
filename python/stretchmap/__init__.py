"""Volume-preserving maps of solids with a hole onto the standard solid torus."""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING

from ._version import __version__ as __version__

if hasattr(os, "register_at_fork"):
    # A forked process computes with one thread: those of its parent are not there any more.
    _base = importlib.import_module(f"{__name__}._core").base
    os.register_at_fork(after_in_child=_base.keep_to_one_thread)

# What type checkers see; at run time `_EXPORTS` loads the same names on first use, so that
# `import stretchmap` stays fast.
if TYPE_CHECKING:
    from . import energies as energies
    from . import errors as errors
    from . import io as io
    from . import plot as plot
    from . import population as population
    from . import samples as samples
    from .area.map import area_map as area_map
    from .area.result import AreaMap as AreaMap
    from .base.progress import Progress as Progress
    from .base.progress import progress_bar as progress_bar
    from .base.threads import threads as threads
    from .base.torus import Torus as Torus
    from .certificate.checks import certify as certify
    from .certificate.checks import certify_file as certify_file
    from .certificate.comparison import Comparison as Comparison
    from .certificate.comparison import compare as compare
    from .certificate.findings import Certificate as Certificate
    from .conformal.map import ConformalMap as ConformalMap
    from .conformal.map import conformal_map as conformal_map
    from .forms.harmonic import HarmonicForms as HarmonicForms
    from .forms.holomorphic import HolomorphicForms as HolomorphicForms
    from .homology.basis import homology_basis as homology_basis
    from .homology.loops import HomologyBasis as HomologyBasis
    from .homology.representatives import harmonic_forms as harmonic_forms
    from .homology.representatives import holomorphic_forms as holomorphic_forms
    from .io.reading import read as read
    from .io.reading import read_solid as read_solid
    from .io.reading import read_surface as read_surface
    from .io.writing import write as write
    from .maps.files import LoadedMap as LoadedMap
    from .maps.files import load_map as load_map
    from .maps.history import IterationRecord as IterationRecord
    from .maps.points import Located as Located
    from .maps.points import PointMap as PointMap
    from .maps.result import MapResult as MapResult
    from .measures.elements import Distortion as Distortion
    from .measures.elements import distortion as distortion
    from .mesh.diagnosis import Diagnosis as Diagnosis
    from .mesh.foreign import from_meshio as from_meshio
    from .mesh.foreign import from_pyvista as from_pyvista
    from .mesh.foreign import from_trimesh as from_trimesh
    from .mesh.solids import TetMesh as TetMesh
    from .mesh.surfaces import TriMesh as TriMesh
    from .mesh.tetrahedralize import tetrahedralize as tetrahedralize
    from .partitions.parts import Partition as Partition
    from .partitions.parts import partition as partition
    from .plot.morphing import Morph as Morph
    from .plot.morphing import morph as morph
    from .preparation.handles import HandleCut as HandleCut
    from .preparation.pipeline import prepare as prepare
    from .preparation.report import Preparation as Preparation
    from .registration.landmarks import Landmarks as Landmarks
    from .registration.landmarks import read_landmarks as read_landmarks
    from .registration.map import register as register
    from .registration.quality import inverse_consistency as inverse_consistency
    from .registration.result import Registration as Registration
    from .resample.fields import transfer as transfer
    from .resample.hex_result import HexMesh as HexMesh
    from .resample.hexes import hex_mesh as hex_mesh
    from .volume.fill import FillMap as FillMap
    from .volume.fill import fill as fill
    from .volume.map import volume_map as volume_map
    from .volume.options import FillOptions as FillOptions
    from .volume.options import VolumeOptions as VolumeOptions
    from .volume.origin import Origin as Origin
    from .volume.origin import origin_of as origin_of
    from .volume.own import Optimizer as Optimizer
    from .volume.result import VolumeMap as VolumeMap

_EXPORTS = {
    "Torus": "base.torus",
    "Progress": "base.progress",
    "progress_bar": "base.progress",
    "threads": "base.threads",
    "TetMesh": "mesh.solids",
    "TriMesh": "mesh.surfaces",
    "Diagnosis": "mesh.diagnosis",
    "from_meshio": "mesh.foreign",
    "from_pyvista": "mesh.foreign",
    "from_trimesh": "mesh.foreign",
    "tetrahedralize": "mesh.tetrahedralize",
    "read": "io.reading",
    "read_solid": "io.reading",
    "read_surface": "io.reading",
    "write": "io.writing",
    "HarmonicForms": "forms.harmonic",
    "HolomorphicForms": "forms.holomorphic",
    "Distortion": "measures.elements",
    "distortion": "measures.elements",
    "HomologyBasis": "homology.loops",
    "homology_basis": "homology.basis",
    "harmonic_forms": "homology.representatives",
    "holomorphic_forms": "homology.representatives",
    "IterationRecord": "maps.history",
    "LoadedMap": "maps.files",
    "load_map": "maps.files",
    "MapResult": "maps.result",
    "Located": "maps.points",
    "PointMap": "maps.points",
    "ConformalMap": "conformal.map",
    "conformal_map": "conformal.map",
    "HandleCut": "preparation.handles",
    "Preparation": "preparation.report",
    "prepare": "preparation.pipeline",
    "Certificate": "certificate.findings",
    "certify": "certificate.checks",
    "certify_file": "certificate.checks",
    "Comparison": "certificate.comparison",
    "compare": "certificate.comparison",
    "Partition": "partitions.parts",
    "partition": "partitions.parts",
    "AreaMap": "area.result",
    "area_map": "area.map",
    "FillMap": "volume.fill",
    "FillOptions": "volume.options",
    "fill": "volume.fill",
    "VolumeMap": "volume.result",
    "Origin": "volume.origin",
    "origin_of": "volume.origin",
    "VolumeOptions": "volume.options",
    "volume_map": "volume.map",
    "Optimizer": "volume.own",
    "Landmarks": "registration.landmarks",
    "read_landmarks": "registration.landmarks",
    "Registration": "registration.result",
    "register": "registration.map",
    "inverse_consistency": "registration.quality",
    "HexMesh": "resample.hex_result",
    "hex_mesh": "resample.hexes",
    "transfer": "resample.fields",
    "Morph": "plot.morphing",
    "morph": "plot.morphing",
}
_ROOMS = ("energies", "errors", "io", "plot", "population", "samples")

__all__ = ["__version__", *_EXPORTS, *_ROOMS]


if not TYPE_CHECKING:  # else a checker would take any name for one of the package

    def __getattr__(name):
        """Load a public name on first use."""
        if name in _EXPORTS:
            value = getattr(importlib.import_module(f"{__name__}.{_EXPORTS[name]}"), name)
            globals()[name] = value
            return value
        if name in _ROOMS:
            return importlib.import_module(f"{__name__}.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
