"""
Your own method against ours
============================

A researcher's bench: energies with derivatives, a start and a proof are there; the method is yours.
"""

# %%
# Whatever maps a solid gives every vertex an image. Here a projected Newton method on the barrier
# energy with the boundary held, in a few lines: the energy, its derivatives and the longest step
# that turns no tet over come from ``stretchmap.energies``.

import numpy as np
from scipy.sparse.linalg import spsolve

import stretchmap as sm
from stretchmap import plot


def newton(solid, image, torus, steps=8):
    """Lower the distortion of all tets, inner vertices free."""
    energy = sm.energies.DistortionEnergy(solid, volume=10.0, projected=True)
    inner = np.setdiff1d(np.arange(solid.n_vertices), solid.boundary_vertices)
    free = (3 * inner[:, None] + np.arange(3)).ravel()
    for _ in range(steps):
        step = np.zeros(image.size)
        hessian = energy.hessian(image)[free][:, free].tocsc()
        step[free] = -spsolve(hessian, energy.gradient(image).ravel()[free])
        step = step.reshape(-1, 3)
        alpha = 0.9 * sm.energies.longest_step(solid, image, step, limit=1 / 0.9)
        while energy.value(image + alpha * step) > energy.value(image) and alpha > 1e-6:
            alpha /= 2
        image = image + alpha * step
    return image


# %%
# Are the derivatives right? A look at differences takes one line each, for any energy.

solid = sm.samples.bumpy_torus(2_000)
energy = sm.energies.VolumeStretch(solid)
rng = np.random.default_rng(0)
x, d, h = solid.V + 0.05 * rng.normal(size=solid.V.shape), rng.normal(size=solid.V.shape), 1e-6
slope = (energy.value(x + h * d) - energy.value(x - h * d)) / (2 * h)
print(f"by differences {slope:.8f}, by the gradient {(energy.gradient(x) * d).sum():.8f}")

# %%
# ``volume_map`` hands the method its own start, which here has no folds, and takes the result back
# through the same measures and the same certificate as any other map.

mine = sm.volume_map(solid, optimizer=newton)
print(mine.summary())
assert mine.certificate.certified

# %%
# Side by side: the published iteration, that method, ours with the boundary held, and ours.

maps = {
    "published, 20 steps": sm.volume_map(solid, c=10, max_iter=20),
    "mine": mine,
    "boundary held": sm.volume_map(solid, boundary="frozen"),
    "default": sm.volume_map(solid),
}
found = sm.compare(solid, maps)
print(found.summary())
figure = plot.comparison(found)
figure

# %%
# The price: what single tets pay for volumes in shape.

for name, measured in found.distortion.items():
    print(f"{name:20}  volumes {measured.element_error_mean:.4f}  angles {measured.angle_mean:.4f}")
