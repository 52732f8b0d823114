"""Filling a closed surface with tets by the optional package tetgen."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.arrays import describe
from ..base.child import run_script
from ..base.options import memory, real
from ..errors import GenusError, MissingDependencyError, SolverError
from .crossings import require_no_crossing
from .flat_tets import opened
from .given import as_surface
from .meshes import TetMesh, TriMesh

__all__ = ["tetrahedralize"]

# Defects for which no filling could be one, whatever tetgen says about them.
_IN_THE_WAY = (
    "repeated", "duplicates", "nonmanifold_edges", "nonmanifold_vertices", "border_edges",
    "not_orientable", "misoriented", "degenerate",
)  # fmt: skip
# Tets per volume asked for, and what each takes while tetgen works.
_TETS_PER_VOLUME, _BYTES_PER_TET = 2.0, 300.0


def tetrahedralize(
    surface: TriMesh, max_volume: float | None = None, quality: float = 1.4
) -> TetMesh:
    """Fill a closed surface with tets, the surface kept exactly as it is.

    Parameters
    ----------
    surface : TriMesh
        Closed, without self-intersections, faces outward, every vertex used. Its vertices are the
        first of the result, in the same order; its faces are the boundary faces.
    max_volume : float, optional
        Largest tet volume aimed at; without it the size follows the surface.
    quality : float
        Largest ratio of circumradius to shortest edge aimed at, above 1. Near the surface both
        aims may be missed, since the surface is not refined.

    Returns
    -------
    TetMesh

    Raises
    ------
    MissingDependencyError
        If the ``tetgen`` package is not installed.
    OptionError
        If ``max_volume`` or ``quality`` is out of range, or there is no memory for that many tets.
    MeshError
        If the surface has a border, is not manifold or not orientable, or has a face without area
        or twice, see `TriMesh.diagnose`.
    GenusError
        If a part of it lies inside another, as that round a cavity does; ``ids`` are its faces.
    SelfIntersectionError
        If the surface crosses itself; ``ids`` are pairs of faces.
    SolverError
        If the surface cannot be filled otherwise, or was changed.

    Notes
    -----
    A constrained Delaunay mesh, refined inside until its tets have the quality asked for (Si 2015,
    TetGen); edges and faces of the surface are recovered and never split. What that leaves without
    volume on flat parts of the surface is split from inside.

    Examples
    --------
    >>> import stretchmap as sm
    >>> surface = sm.samples.torus_surface(12, 6)
    >>> solid = sm.tetrahedralize(surface)  # doctest: +SKIP
    """
    surface, quality = as_surface(surface), real("quality", quality, above=1.0)
    if max_volume is not None:
        max_volume = real("max_volume", max_volume, above=0.0)
    if importlib.util.find_spec("tetgen") is None:
        raise MissingDependencyError(
            "filling a surface with tets needs tetgen: pip install 'stretchmap[mesh]'"
        )
    surface.diagnose().require(_IN_THE_WAY)
    options: dict[str, Any] = {"minratio": quality, "steinerleft": -1}  # as many as it takes
    if max_volume is not None:
        tets = _TETS_PER_VOLUME * abs(surface.volume) / max_volume
        memory(f"about {tets:.3g} tets of that volume", _BYTES_PER_TET * tets)
        options |= {"fixedvolume": True, "maxvolume": max_volume}
    try:
        solid = TetMesh(*_run_tetgen(surface, options), orient=True)
        _require_same_surface(solid, surface)
        solid = opened(solid)
    except SolverError:
        require_no_crossing(  # the reason, as a rule
            surface, "the surface", "repair it there, or let stretchmap prepare do so"
        )
        raise
    return solid


def _require_same_surface(solid: TetMesh, surface: TriMesh) -> None:
    n, ids = len(surface.V), solid.boundary_vertices
    unused = np.setdiff1d(np.arange(n), surface.F)
    if len(unused):
        raise SolverError(
            f"no face uses {describe('vertex', unused)}; surface.compact() drops what is not used",
            unused.tolist(),
        )
    if not np.array_equal(solid.V[:n], surface.V):
        raise SolverError("filling the surface with tets moved its vertices")
    added = solid.V[ids[ids >= n]]
    if len(added):
        faces = np.unique(_core.maps.SurfaceTree(surface.V, surface.F).closest(added)[1])
        raise SolverError(
            f"tetgen does not fill the surface without a new vertex on {describe('face', faces)}: "
            "stretchmap.prepare remeshes it, and so fills it; or remesh it there",
            faces.tolist(),
        )
    missing = np.setdiff1d(np.arange(n), ids)
    if len(missing):
        _require_no_part_inside(surface, missing)
        raise SolverError(
            f"filling the surface with tets left {describe('vertex', missing)} off the boundary",
            missing.tolist(),
        )
    rows = np.sort(np.vstack([ids[solid.surface.F], surface.F]), axis=1)
    label = np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
    n_found = len(solid.surface.F)
    lost = np.flatnonzero(~np.isin(label[n_found:], label[:n_found]))
    if len(lost) or n_found != len(surface.F):
        raise SolverError(
            f"filling the surface with tets replaced {describe('face', lost)} of it", lost.tolist()
        )


def _require_no_part_inside(surface: TriMesh, missing: NDArray[np.integer[Any]]) -> None:
    """Say so where the vertices that are left off are those of whole components."""
    component = surface.diagnose().component
    kept = component[~np.isin(surface.F, missing).all(axis=1)]
    inside = np.flatnonzero(~np.isin(component, kept))
    if len(inside):
        raise GenusError(
            f"a part of the surface, {describe('face', inside)}, lies inside another; cavities are "
            "filled, and no solid with one can be mapped: leave those faces out, compact() drops "
            "their vertices",
            inside.tolist(),
        )


def _run_tetgen(
    surface: TriMesh, options: dict[str, Any]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Points and tets; in a process of its own, since tetgen aborts the process on bad input."""
    script = (
        "import json, sys, numpy, tetgen\n"
        "data = numpy.load('surface.npz')\n"
        "filled = tetgen.TetGen(data['V'], data['F']).tetrahedralize(\n"
        "    nobisect=True, quality=True, order=1, quiet=True, **json.loads(sys.argv[1]))\n"
        "numpy.savez('solid.npz', V=filled[0], T=filled[1])\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder, "surface.npz"), V=surface.V, F=surface.F)
        run = run_script(script, options, folder)
        if run.returncode != 0:
            raise SolverError(
                "the surface cannot be filled with tets "
                f"({(run.stderr.strip().splitlines() or ['tetgen gave up'])[-1]})"
            )
        with np.load(Path(folder, "solid.npz")) as solid:
            return solid["V"], solid["T"]
