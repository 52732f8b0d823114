"""The default certified map against one harmonic solve by CHOLMOD on the same mesh: the ratio.

    python bench/peers/harmonic.py [MESH ...] [--repeat 3] [--json FILE]

The map is timed from file to file. The harmonic solve is analysis, factorisation and three
right-hand sides of the cotangent Laplacian, without its assembly: by our own binding to CHOLMOD in
a build that has it, else by that of cvxopt, ordered by pymetis.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from cholmod import AVAILABLE
from run import FOLDER
from scipy_vsem import Assembly, by_cholmod, face_vectors

import stretchmap as sm
from stretchmap import _core, samples
from stretchmap.errors import MissingDependencyError
from stretchmap.mesh.meshes import TetMesh


def harmonic_system(solid: TetMesh) -> tuple[sp.csr_matrix, Any]:
    """Laplacian of the inner vertices and what the boundary's positions put on the right."""
    fixed = np.zeros(solid.n_vertices, bool)
    fixed[solid.boundary_vertices] = True
    assembly = Assembly(solid.T, fixed)
    g, rest = face_vectors(solid.V, solid.T)
    inner, couple = assembly(g, 1.0 / rest)
    return inner.tocsr(), -(couple @ solid.V[assembly.held])


def by_binding(A: sp.csr_matrix, B: Any) -> tuple[float, float]:
    """Seconds and relative residual; MissingDependencyError where the build has no CHOLMOD."""
    begin = time.perf_counter()
    X, _ = _core.linalg.SpdSolver(A, "cholmod").solve(B, np.zeros_like(B), 1.0)
    seconds = time.perf_counter() - begin
    return seconds, float(np.linalg.norm(A @ X - B) / np.linalg.norm(B))


def by_wheel(A: sp.csr_matrix, B: Any) -> tuple[float, float]:
    """The same by CHOLMOD from cvxopt's wheel."""
    begin = time.perf_counter()
    X = by_cholmod()(A.tocsc(), B)
    seconds = time.perf_counter() - begin
    return seconds, float(np.linalg.norm(A @ X - B) / np.linalg.norm(B))


def certified(path: Path) -> tuple[float, bool]:
    """Seconds from file to file, and whether the map is certified."""
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        result = sm.volume_map(sm.read(path))
        result.save(Path(folder, "map.npz"))
        seconds = time.perf_counter() - begin
    return seconds, result.certificate.certified


def compare(path: Path, repeat: int) -> dict[str, Any]:
    """Best times of both, taken in turn."""
    A, B = harmonic_system(sm.read(path))
    try:
        by_binding(A[:1, :1].tocsr(), B[:1])
        solve, peer = by_binding, "binding"
    except MissingDependencyError:
        if not AVAILABLE:
            sys.exit("no CHOLMOD: pip install cvxopt pymetis")
        solve, peer = by_wheel, "cvxopt"
    row: dict[str, Any] = {"peer": peer, "harmonic": np.inf, "certified_map": np.inf}
    for _ in range(repeat):
        seconds, row["residual"] = solve(A, B)
        row["harmonic"] = min(row["harmonic"], seconds)
        seconds, row["certified"] = certified(path)
        row["certified_map"] = min(row["certified_map"], seconds)
    row["ratio"] = row["certified_map"] / row["harmonic"]
    return row


def main(arguments: list[str] | None = None) -> int:
    """Print one line per mesh."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    data = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in options.meshes or ["generated"]:
            path = Path(name) if Path(name).exists() else FOLDER / f"{name}.npz"
            if name == "generated":
                path = Path(folder, "generated.npz")
                sm.write(path, samples.vertebra_like(20_000))
            row = data[name] = compare(path, options.repeat)
            print(
                f"{name}: certified map {row['certified_map']:.2f} s"
                f"{'' if row['certified'] else ' (NOT CERTIFIED)'}, one harmonic solve by CHOLMOD "
                f"({row['peer']}) {row['harmonic']:.3f} s, residual {row['residual']:.0e}, "
                f"ratio {row['ratio']:.1f}",
                flush=True,
            )
    if options.json:
        options.json.write_text(json.dumps(data, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
