"""Volume maps by an optimizer of the user's own, and maps to go on from."""

from __future__ import annotations

import numpy as np
import pytest

import shapes
import stretchmap as sm
from stretchmap.errors import (
    ArrayError,
    CertificationError,
    KindError,
    OptionError,
    OrientationError,
)

SOLID = sm.samples.bumpy_torus(1200)


def newton(solid, image, torus):
    """Newton steps on the public barrier with the boundary held; needs a start without folds."""
    from scipy.sparse.linalg import spsolve

    energy = sm.energies.DistortionEnergy(solid, volume=5.0, projected=True)
    free = np.ones((solid.n_vertices, 3), bool)
    free[solid.boundary_vertices] = False
    inner = np.flatnonzero(free.ravel())
    x = image
    for _ in range(8):
        step = np.zeros(x.size)
        hessian = energy.hessian(x)[inner][:, inner]
        step[inner] = -spsolve(hessian.tocsc(), energy.gradient(x).ravel()[inner])
        step = step.reshape(-1, 3)
        alpha = 0.9 * sm.energies.longest_step(solid, x, step, limit=1.0 / 0.9)
        while energy.value(x + alpha * step) > energy.value(x) and alpha > 1e-6:
            alpha *= 0.5
        x = x + alpha * step
    return x


def test_a_method_of_ones_own_is_measured_and_certified_like_ours():
    seen = {}

    def mine(solid, image, torus):
        seen.update(solid=solid, image=image, torus=torus)
        return newton(solid, image, torus)

    result = sm.volume_map(SOLID, optimizer=mine)
    assert result.certificate.certified and result.method == "mine" and result.boundary == "own"
    assert result.distortion.image_total == pytest.approx(SOLID.volume, rel=1e-12)
    # What it was given: an image of the solid's volume, boundary vertices on the torus.
    solid, image, torus = seen["solid"], seen["image"], seen["torus"]
    assert sm.distortion(solid, image).image_total == pytest.approx(SOLID.volume, rel=1e-9)
    on = image[solid.boundary_vertices]
    tube = np.hypot(np.hypot(on[:, 0], on[:, 1]) - torus.R, on[:, 2])
    np.testing.assert_allclose(tube, torus.r, rtol=1e-9)
    start = sm.distortion(solid, image)
    assert result.distortion.element_std < start.element_std
    # The same methods serve its result as any other.
    parts = sm.partition(result, 3)
    np.testing.assert_allclose(parts.volumes / SOLID.volume, 1.0 / 3.0, rtol=1e-9)


def test_it_may_go_on_from_a_map():
    ours = sm.volume_map(SOLID)
    result = sm.volume_map(ours.mesh, start=ours, optimizer=lambda solid, image, torus: image)
    np.testing.assert_allclose(result.image, ours.image, atol=1e-12 * ours.torus.R)


def test_a_poor_image_is_refused_unless_asked_for():
    def shuffle(solid, image, torus):
        inner = np.setdiff1d(np.arange(solid.n_vertices), solid.boundary_vertices)
        image = image.copy()
        image[inner] = image[inner[::-1]]
        return image

    with pytest.raises(CertificationError):
        sm.volume_map(SOLID, optimizer=shuffle)
    found = sm.volume_map(SOLID, optimizer=shuffle, keep_best=True)
    assert not found.certificate.certified and found.distortion.flips > 0


def test_errors_name_what_is_wrong():
    with pytest.raises(OptionError, match="optimizer must be"):
        sm.volume_map(SOLID, optimizer=3)
    with pytest.raises(ArrayError, match="what the optimizer returned"):
        sm.volume_map(SOLID, optimizer=lambda solid, image, torus: image[:-1])
    with pytest.raises(ArrayError, match=r"returned None, not an image: end it with"):
        sm.volume_map(SOLID, optimizer=lambda solid, image, torus: None)
    with pytest.raises(OrientationError, match="inside out"):
        sm.volume_map(SOLID, optimizer=lambda solid, image, torus: image * [1.0, 1.0, -1.0])
    for options in ({"c": 1.0}, {"max_iter": 3}, {"balance": 0.5}, {"boundary": "glide"}):
        with pytest.raises(OptionError, match="takes no"):
            sm.volume_map(SOLID, optimizer=newton, **options)
    exact = sm.VolumeOptions(vertex_exact=True, ratio=2.0)
    with pytest.raises(OptionError, match=r"does not take vertex_exact$"):
        sm.volume_map(SOLID, optimizer=newton, options=exact)


def test_a_refined_map_starts_one_of_the_input():
    thin = sm.TetMesh(*shapes.cubes(shapes.RING))  # every vertex lies on the boundary
    first = sm.volume_map(thin)
    assert first.refinement is not None
    again = sm.volume_map(thin, start=first, max_iter=3)
    assert again.certificate.certified
    assert again.mesh.n_vertices >= thin.n_vertices
    with pytest.raises(KindError):
        sm.volume_map(SOLID, start=first)


def test_an_image_is_no_start_and_the_error_names_the_way() -> None:
    with pytest.raises(OptionError, match="for an image see optimizer"):
        sm.volume_map(SOLID, start=SOLID.V)
    begun = sm.conformal_map(SOLID.surface)
    assert sm.volume_map(SOLID, start=begun).certificate.certified


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("size", [1.0, 0.25])
def test_an_image_may_be_of_any_size_and_in_single_precision(size, dtype):
    def mine(solid, image, torus):
        return (size * newton(solid, image, torus)).astype(dtype)

    result = sm.volume_map(SOLID, optimizer=mine)
    assert result.certificate.certified
    same = sm.volume_map(SOLID, optimizer=newton)
    assert result.torus.R == pytest.approx(same.torus.R, rel=1e-6)
    np.testing.assert_allclose(result.image, same.image, atol=1e-5 * same.torus.R)


def test_a_boundary_off_the_torus_stays_off():
    def lifted(solid, image, torus):
        image[solid.boundary_vertices[0]] *= 1.001
        return image

    with pytest.raises(CertificationError, match="not on the torus"):
        sm.volume_map(SOLID, optimizer=lifted)
