"""Algorithm 5.1 against two peers on the same mesh, boundary and c, in one run: ratios.

    python bench/peers/run.py [MESH ...] [--c 10] [--steps 20] [--repeat 3] [--json FILE]

MESH is a name in STRETCHMAP_MESHES/tets or a file; without any, a generated solid. Peers: NumPy
with SciPy's sparse LU; with CHOLMOD where cvxopt and pymetis are installed, analysed once; and GNU
Octave's backslash, which is CHOLMOD analysed in every step, when octave-cli is on the path. Every
implementation starts at its harmonic map and runs the same number of steps; only the steps are
timed, ours interleaved with the peers and the best of ``--repeat`` taken, since other work disturbs
all of them.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from cholmod import AVAILABLE
from scipy_vsem import by_cholmod, face_vectors, minimize

import stretchmap as sm
from stretchmap import _core, samples
from stretchmap.mesh.meshes import TetMesh
from stretchmap.volume.vsem import HARMONIC_TOL, step_tolerance

HERE = Path(__file__).resolve().parent
FOLDER = Path(os.environ.get("STRETCHMAP_MESHES", HERE.parents[2] / "shared" / "meshes")) / "tets"


def ours(V: Any, T: Any, fixed: Any, start: Any, c: float, steps: int) -> tuple[Any, float]:
    """The library's kernels, as volume_map drives them."""
    rest = _core.mesh.tet_volumes(V, T)
    stretch = _core.volume.VolumetricStretch(T, fixed.astype(np.uint8), rest, "auto")

    def energy_of(x: Any) -> float:
        return float(_core.volume.tet_stretch_energy(_core.mesh.tet_volumes(x, T), rest))

    x, _ = stretch.harmonic(V, start, HARMONIC_TOL)
    energy = energy_of(x)
    tol = step_tolerance(np.inf, energy)
    begin = time.perf_counter()
    for _ in range(steps):
        x, _ = stretch.step(x, c, tol, follow=True)
        before, energy = energy, energy_of(x)
        tol = step_tolerance(before, energy)
    return x, time.perf_counter() - begin


def octave(V: Any, T: Any, fixed: Any, start: Any, c: float, steps: int) -> tuple[Any, float]:
    """The iteration as a MATLAB user would write it."""
    with tempfile.TemporaryDirectory() as folder:
        infile, outfile = Path(folder, "in.mat"), Path(folder, "out.mat")
        held = np.flatnonzero(fixed)
        data = {"V": V, "T": T + 1.0, "B": held[:, None] + 1.0, "X": start[held]}
        scipy.io.savemat(infile, {**data, "c": c, "steps": steps})
        command = f"infile='{infile}'; outfile='{outfile}'; source('{HERE / 'vsem.m'}');"
        arguments = ["octave-cli", "--quiet", "--eval", command]
        subprocess.run(arguments, check=True, capture_output=True)
        result = scipy.io.loadmat(outfile)
    return result["Y"], float(result["seconds"].item())


def compare(solid: TetMesh, c: float, steps: int, repeat: int) -> dict[str, dict[str, float]]:
    """Seconds and energies of all implementations on one solid."""
    boundary = sm.area_map(solid.surface)
    scale = solid.volume ** (1.0 / 3.0)
    V = solid.V / scale
    start = np.zeros_like(V)
    start[solid.boundary_vertices] = boundary.image / scale
    fixed = np.zeros(len(V), bool)
    fixed[solid.boundary_vertices] = True
    runs: dict[str, Any] = {"stretchmap": ours, "SciPy": minimize}
    if AVAILABLE:
        runs["CHOLMOD"] = lambda *problem: minimize(*problem, by_cholmod())
    if shutil.which("octave-cli"):
        runs["Octave"] = octave
    results: dict[str, dict[str, float]] = {}
    _, rest = face_vectors(V, solid.T)
    for _ in range(repeat):
        for name, run in runs.items():
            x, seconds = run(V, solid.T, fixed, start, c, steps)
            _, image = face_vectors(x, solid.T)
            energy = float(1.5 * (image**2 / rest).sum())
            best = min(seconds, results.get(name, {}).get("seconds", np.inf))
            results[name] = {"seconds": best, "energy": energy, "flips": int((image <= 0).sum())}
    return results


def main(arguments: list[str] | None = None) -> int:
    """Print one table per mesh."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--c", type=float, default=10.0)
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    data = {}
    for name in options.meshes or ["generated"]:
        path = Path(name) if Path(name).exists() else FOLDER / f"{name}.npz"
        solid = samples.vertebra_like(20_000) if name == "generated" else sm.read(path)
        results = compare(solid, options.c, options.steps, options.repeat)
        base = results["stretchmap"]
        data[name] = results
        print(f"\n{name}: {len(solid.T)} tets, c = {options.c:g}, {options.steps} steps")
        print(f"{'':12}{'seconds':>10}{'ratio':>8}{'energy':>16}{'difference':>12}{'flips':>7}")
        for peer, r in results.items():
            difference = abs(r["energy"] / base["energy"] - 1.0)
            ratio = r["seconds"] / base["seconds"]
            print(
                f"{peer:12}{r['seconds']:10.3f}{ratio:8.1f}{r['energy']:16.10f}"
                f"{difference:12.1e}{r['flips']:7d}",
                flush=True,
            )
    if options.json:
        options.json.write_text(json.dumps(data, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
