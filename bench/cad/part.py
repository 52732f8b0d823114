"""A part with a hole from CAD to hexahedra: Gmsh makes and fills it, the rest is ours.

Gmsh is under the GPL and no dependency: pip install gmsh.

Run: python bench/cad/part.py [FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import gmsh
import numpy as np

import stretchmap as sm


def bracket(path: Path, size: float) -> None:
    """A plate with rounded edges, a boss, and a hole through both."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        cad = gmsh.model.occ
        plate = cad.addBox(-3.0, -1.5, 0.0, 6.0, 3.0, 1.0)
        boss = cad.addCylinder(0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 1.3)
        hole = cad.addCylinder(0.0, 0.0, -1.0, 0.0, 0.0, 4.0, 0.7)
        (_, body), *_ = cad.cut(cad.fuse([(3, plate)], [(3, boss)])[0], [(3, hole)])[0]
        cad.synchronize()
        gmsh.model.addPhysicalGroup(3, [body], name="steel")
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", default=".", type=Path)
    parser.add_argument("--size", type=float, default=0.3, help="largest edge")
    parser.add_argument("--hexahedra", type=int, default=5000)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    path = given.folder / "bracket.msh"
    bracket(path, given.size)
    solid = sm.read_solid(path)
    result = sm.volume_map(solid, balance=0.5)
    print(f"{solid.n_tets} tets, certified {result.certificate.certified}")
    for fractions, by in (((6, 2), "us"), ((8, 3), "us"), ((4, 4, 3), "uvs")):
        parts = sm.partition(result, fractions, tuple(by))
        print(f"{fractions} by {by}: largest error {np.abs(parts.errors).max():.1e}, uncorrected "
              f"{np.abs(parts.uncorrected_errors).max():.1e}")  # fmt: skip
    grid = sm.hex_mesh(result, n_hexahedra=given.hexahedra)
    print(grid.summary())
    for suffix in (".vtu", ".inp", ".bdf", ".msh"):
        grid.save(given.folder / f"bracket_hexahedra{suffix}")


if __name__ == "__main__":
    main()
