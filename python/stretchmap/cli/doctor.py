"""The command doctor: what a bug report says about the machine, and whether maps work on it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from typing import Any

import typer

from . import common
from .common import Json, Quiet

# extra -> packages it brings, by the name under which they are installed.
_EXTRAS = {
    "cli": ("typer", "rich"),
    "io": ("meshio", "h5py"),
    "prepare": ("gpytoolbox", "scikit-image", "pytetwild", "pyvista"),
    "mesh": ("tetgen", "scikit-image"),
    "nifti": ("nibabel",),
    "interop": ("pyvista", "trimesh", "meshio"),
    "plot": ("matplotlib",),
    "viz": ("pyvista",),
    "fem": ("scikit-fem", "meshio"),
    "cluster": ("distributed", "threadpoolctl"),
}


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.command()(doctor)


def doctor(json: Json = None, quiet: Quiet = False) -> None:
    """Print versions and packages, and test a map."""
    from ..base.tables import plain, table, versions

    common.check_json(json)
    report: dict[str, Any] = {
        **versions(),
        "platform": platform.platform(),
        "machine": platform.machine(),
        "compiler of Python": platform.python_compiler(),
        "BLAS of NumPy": _blas(),
        "processors": os.cpu_count(),
        "threads": _threads(),
        "OpenMP": "not used: the core has threads of its own",
        **{f"extra {extra}": _installed(packages) for extra, packages in _EXTRAS.items()},
        "self-test": _self_test(),
    }
    if not quiet:
        typer.echo(table(plain(report)))
    common.write_json(json, report)
    if not report["self-test"].startswith("passed"):
        raise typer.Exit(1)


def _blas() -> str:
    import numpy as np

    try:
        found = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    except (TypeError, KeyError):  # NumPy before 1.26 only prints it
        return "unknown"
    return f"{found.get('name', 'unknown')} {found.get('version', '')}".strip()


def _threads() -> str:
    from .. import _core

    asked = os.environ.get("OMP_NUM_THREADS")
    return f"{_core.base.thread_count()}" + (f" (OMP_NUM_THREADS={asked})" if asked else "")


def _installed(packages: tuple[str, ...]) -> str:
    found = []
    for package in packages:
        try:
            found.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            found.append(f"{package} not installed")
    return ", ".join(found)


def _self_test() -> str:
    """Map a small solid with one thread and with all: certified, and the same bits."""
    import numpy as np

    from ..errors import StretchmapError
    from ..samples import solid_torus
    from ..volume.map import volume_map

    clock = time.perf_counter()
    solid = solid_torus(1500)
    try:
        one, all_threads = volume_map(solid, threads=1), volume_map(solid)
    except StretchmapError as error:
        return f"failed: {type(error).__name__}: {error}"
    if not np.array_equal(one.image, all_threads.image):
        return "failed: the map depends on the number of threads"
    least, seconds = one.distortion.ratio_min, time.perf_counter() - clock
    return f"passed: two certified maps alike, smallest volume ratio {least:.2f}, {seconds:.1f} s"
