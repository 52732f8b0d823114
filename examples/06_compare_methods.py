"""
6 - A method of your own against ours
=====================================

Whatever gives an image to every vertex can be measured by the same rules: here the harmonic map
that an afternoon's work brings about, the published iteration, and the certified map.

Run: python examples/06_compare_methods.py [comparison.png]
"""

import sys

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

import stretchmap as sm
from stretchmap import plot

solid = sm.samples.vertebra_like(5_000)
paper = sm.volume_map(solid, c=10, max_iter=20)


def harmonic(solid, boundary_image):
    """Every inner vertex at the mean of its neighbors, the boundary prescribed."""
    n, held = solid.n_vertices, solid.boundary_vertices
    rows, columns = np.concatenate([solid.edges, solid.edges[:, ::-1]]).T
    graph = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), (n, n))
    laplacian = sp.diags(np.asarray(graph.sum(axis=1)).ravel()) - graph
    free = np.setdiff1d(np.arange(n), held)
    image = np.zeros((n, 3))
    image[held] = boundary_image
    pull = -(laplacian[free][:, held] @ boundary_image)
    image[free] = spsolve(laplacian[free][:, free].tocsc(), pull)
    return image


mine = harmonic(solid, paper.image[solid.boundary_vertices])
found = sm.compare(
    solid,
    {"mine": mine, "published, 20 steps": paper.image, "certified": sm.volume_map(solid)},
    torus=paper.torus,
)
print(found.summary())
assert found.certificate["certified"].certified

# %%
# The spread of the volumes, and who may call himself a map.
figure = plot.comparison(found)
if len(sys.argv) > 1:
    plot.save(figure, sys.argv[1])
