"""
8 - Finite elements on hexahedra and on tets
============================================

Heat flows through a solid of wound fibers, which conduct ten times better along than across. The
map says where the fibers run; the same problem is solved on its hexahedra and on its tets, and the
energies meet as both get finer. Needs scikit-fem: pip install 'stretchmap[fem]'.

Run: python examples/08_finite_elements.py [energies.png]
"""

import sys

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from skfem import (
    Basis,
    BilinearForm,
    ElementHex1,
    ElementTetP1,
    ElementTetP2,
    FacetBasis,
    LinearForm,
    asm,
    solve,
)
from skfem.helpers import dot, grad
from skfem.io.meshio import from_meshio
from skfem.utils import solver_iter_pcg

import stretchmap as sm
from stretchmap import plot

# Hexahedra bridge the edges of the solid's polyhedron. Were it coarser, of 1000 tets, its surface
# would be 2.4 per cent larger than theirs, and would exchange more heat.
solid = sm.samples.bumpy_torus(3_000)
result = sm.volume_map(solid, balance=0.5)

# %%
# Conductivity 10 along the fibers and 1 across, heated in proportion to x, and the boundary
# exchanges heat with surroundings of temperature 0:
# find T with a(T, w) = l(w) for all w, where
# a(T, w) is the integral of (grad T + 9 (d . grad T) d) . grad w and that of T w over the boundary.


@BilinearForm
def conduction(T, w, at):
    return dot(grad(T), grad(w)) + 9.0 * dot(at.fiber, grad(T)) * dot(at.fiber, grad(w))


@BilinearForm
def exchange(T, w, at):
    return T * w


@LinearForm
def heating(w, at):
    return at.x[0] * w


def fibers(points):
    """Directions (3, ...) of the fibers at points (3, ...), NaN outside the solid."""
    return result.coordinate_field(points.reshape(3, -1).T).frames[:, 0].T.reshape(points.shape)


def heat(mesh, element):
    """Temperatures at the nodes of the mesh, unknowns, and the energy l(T) / 2."""
    basis, boundary = Basis(mesh, element, intorder=3), FacetBasis(mesh, element)
    fiber, middle = fibers(basis.global_coordinates()), fibers(mesh.p[:, mesh.t].mean(axis=1))
    assert np.isfinite(middle).all()
    # Faces of hexahedra bridge edges of the solid: a point outside it gets its hexahedron's fiber.
    fiber = np.where(np.isfinite(fiber), fiber, middle[:, :, None])
    load = asm(heating, basis)
    stiffness = asm(conduction, basis, fiber=fiber) + asm(exchange, boundary)
    T = solve(stiffness, load, solver=solver_iter_pcg())
    return T[basis.nodal_dofs[0]], len(T), 0.5 * load @ T


tets = from_meshio(solid.to_meshio())
fine = heat(tets.refined(1), ElementTetP2())
runs = {"tets": [], "hexahedra": []}
for mesh in (tets, tets.refined(1)):
    runs["tets"].append((mesh, *heat(mesh, ElementTetP1())))
for sections, block, rings in ((20, 2, 1), (30, 3, 1), (40, 4, 1)):
    grid = sm.hex_mesh(result, sections=sections, block=block, rings=rings)
    assert grid.n_invalid == 0
    mesh = from_meshio(grid.to_meshio())
    runs["hexahedra"].append((mesh, *heat(mesh, ElementHex1())))
for name, found in runs.items():
    for mesh, _, unknowns, energy in found:
        print(f"{mesh.nelements:6d} {name:9s} {unknowns:6d} unknowns  energy {energy:.6g}  "
              f"off by {100 * (energy / fine[2] - 1):+.2f} %")  # fmt: skip
print(f"reference: {fine[1]} unknowns, second order, energy {fine[2]:.6g}")
# Both converge from below: with half the spacing the error is well below half.
off = {name: [1 - run[3] / fine[2] for run in found] for name, found in runs.items()}
for errors in off.values():
    assert min(errors) > 0 and sorted(errors, reverse=True) == errors
    assert errors[-1] < 0.5 * errors[0] and errors[-1] < 0.01

# %%
# The temperatures on both, and the energies.
figure = Figure(figsize=(12, 4), layout="constrained")
limit = np.abs(fine[0]).max()
for place, (name, shown) in enumerate({"tets": 0, "hexahedra": 2}.items(), 1):
    mesh, temperature = runs[name][shown][:2]
    axes = figure.add_subplot(1, 3, place, projection="3d")
    # scikit-fem's quads go round their corners.
    corners = mesh.facets[:, mesh.boundary_facets()]
    shades = matplotlib.colormaps["RdBu_r"](0.5 + 0.5 * temperature[corners].mean(axis=0) / limit)
    axes.add_collection3d(
        Poly3DCollection(mesh.p.T[corners.T], facecolors=shades, edgecolors="0.3", linewidths=0.2)
    )
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_title(f"{mesh.nelements} {name}")
    axes.set_box_aspect(high - low, zoom=1.25)
    axes.set_axis_off()
axes = figure.add_subplot(1, 3, 3)
for name, found in runs.items():
    axes.loglog([f[2] for f in found], [abs(f[3] / fine[2] - 1) for f in found], "o-", label=name)
axes.xaxis.set_minor_formatter("")
axes.set(xlabel="unknowns", title="error of the energy")
axes.legend()
if len(sys.argv) > 1:
    plot.save(figure, sys.argv[1])
