"""
A Gmsh part
===========

From a mesh of Gmsh with physical groups to coordinates, parts of equal volume and hexahedra in
files for a finite element program.
"""

# %%
# Gmsh makes such a part from a few lines, saved as ``part.geo`` and meshed by
# ``gmsh -3 part.geo -o part.msh``:
#
# .. code-block:: c
#
#    SetFactory("OpenCASCADE");
#    Torus(1) = {0, 0, 0, 2, 0.6};
#    Box(2) = {1.2, -0.4, -0.8, 1.6, 0.8, 1.6};
#    BooleanUnion{ Volume{1}; Delete; }{ Volume{2}; Delete; }
#    Physical Volume("steel") = Volume{:};
#    Mesh.MeshSizeMax = 0.25;
#
# Here a sample of ours takes its place, written in Gmsh's own format with two physical groups.

import tempfile
from pathlib import Path

import meshio
import numpy as np

import stretchmap as sm
from stretchmap import io, plot

folder = Path(tempfile.mkdtemp())
sample = sm.samples.bumpy_torus(4_000)
group = 1 + (sample.V[sample.T].mean(axis=1)[:, 0] > 0.0).astype(np.int32)
cells, data = [("tetra", sample.T)], {"gmsh:physical": [group], "gmsh:geometrical": [group]}
meshio.write(folder / "part.msh", meshio.Mesh(sample.V, cells, cell_data=data), "gmsh22")

# %%
# ``read_arrays`` returns what is in the file, fields and groups included; ``read_solid`` the mesh
# alone. Tets that are numbered the other way round are turned if asked for.

arrays = io.read_arrays(folder / "part.msh")
part = sm.TetMesh(arrays.V, arrays.T, orient=True)
print(part, "groups:", np.unique(arrays.cell_data["gmsh:physical"]))
part.require_solid_torus()

# %%
# The map, with the groups on board: every file written from now on has them.

result = sm.volume_map(part).with_fields(cell_data=arrays.cell_data)
print(result.summary())
assert result.certificate.certified
angles = result.plot("cutaway")
angles

# %%
# Coordinates of every vertex. The angles jump by a turn somewhere; the file for viewers and solvers
# has their sines and cosines beside them.

u, v, s = result.coordinates().T
print(f"u from {u.min():.2f} to {u.max():.2f}, s / r from {s.min() / result.torus.r:.2f}")
result.save(folder / "part_map.vtu")

# %%
# Six sectors round the hole, each inside and outside: twelve parts of exactly the same volume, tets
# cut where the borders run.

parts = sm.partition(result, (6, 2), by=("u", "s"))
print("volumes off by at most", np.abs(parts.volumes / parts.volumes.mean() - 1.0).max())
parts.save(folder / "parts.vtu")

# %%
# A structured grid of hexahedra, for a solver that likes them: ``.inp`` for Abaqus and CalculiX,
# ``.bdf`` for Nastran, ``.msh`` for Gmsh again.

grid = sm.hex_mesh(result, sections=24, block=2, rings=2)
print(grid.summary())
assert grid.n_invalid == 0
grid.save(folder / "part.inp")
print(sorted(path.name for path in folder.iterdir()))

# %%
# How it was to be: all volume ratios near one.

ratios = plot.ratios(result)
ratios
