"""What somebody writes who uses the package: checked by mypy as it is and with mistakes in it."""

import numpy as np

import stretchmap as sm


def show(stage: str, done: int, total: int, **values: float) -> None:
    print(stage, done, total, values)


solid = sm.read_solid("part.msh", compact=True)
surface = solid.surface
options = sm.VolumeOptions(ratio="search", glide_iter=20)
result = sm.volume_map(solid, boundary="glide", options=options, threads=2, progress=show)
filled = sm.fill(solid, 2.0 * surface.V, options=sm.FillOptions(refine=False)).mesh.n_tets
spread: float = result.distortion.ring_std
radii = (result.torus.R, result.torus.r)
proven: bool = result.certificate.certified
added = None if result.refinement is None else result.refinement.n_split
area = sm.area_map(surface, finish="ring", ratio=2.5)
flat = sm.conformal_map(surface, weights="clamped", progress=show)
classes = sm.homology_basis(surface, solid).torus_classes
parts = sm.partition(result, [0.2, 0.8], by="u")
grid = sm.partition(result, (3, [0.5, 0.5]), by=("s", "v")).part(0).n_tets
other = sm.register(solid, sm.samples.bumpy_torus(1500), landmark_map="affine")
density = sm.transfer(other, np.ones(solid.n_tets), per="tet")
loaded = sm.load_map("map.npz")
count = loaded.mesh.n_tets if isinstance(loaded.mesh, sm.TetMesh) else loaded.mesh.n_faces
history = [record.ring_std for record in loaded.history if record.stage == "vsem"]
with sm.threads(1):
    figure = sm.plot.picture(result, "levels", by="s")
try:
    surface.require_genus_one()
except sm.errors.GenusError as error:
    print(error.ids)
