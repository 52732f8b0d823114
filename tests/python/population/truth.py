"""Correspondences of synthetic vertebrae against what is known of them."""

from __future__ import annotations

import numpy as np
from scipy.linalg import subspace_angles

from stretchmap import _core
from stretchmap.deformation.similarity import similarity_onto


def size(points):
    return np.linalg.norm(np.ptp(points, axis=0))


def material(bones, i, points):
    """Material points of the mean individual that lie at points of individual i."""
    solid = bones.solids[i]
    tolerance = 0.02 * size(solid.V)  # the smooth solid bulges out of its mesh
    locator = _core.maps.TetLocator(solid.V, solid.T, tolerance)
    tets, weights = locator.locate(np.ascontiguousarray(points))
    assert (tets >= 0).all()
    return np.einsum("nq,nqx->nx", weights, bones.material[i][solid.T[tets]])


def correspondence_errors(bones, points, which=None):
    """(k, n) How far points that ought to correspond are from their common material point, over
    the size; the individuals in order, or ``which`` of them."""
    rows = range(len(points)) if which is None else which
    found = np.stack([material(bones, i, x) for i, x in zip(rows, points, strict=True)])
    return np.linalg.norm(found - found.mean(axis=0), axis=2) / size(bones.reference.V), found


def mode_angles(bones, model, common):
    """Degrees between the planted modes at material points (n, 3) and as many of a model."""
    move = similarity_onto(common, model.mean)
    planted = bones.modes_at(common) @ move.rotation
    x = model.mean - model.mean.mean(axis=0)
    turned = [np.cross(x, axis) for axis in np.eye(3)]
    shifted = [np.tile(axis, (len(x), 1)) for axis in np.eye(3)]
    free = np.linalg.qr(np.stack([x, *turned, *shifted]).reshape(7, -1).T)[0]
    flat = planted.reshape(len(planted), -1)
    flat = flat - flat @ free @ free.T  # what Procrustes analysis takes out
    found = model.modes[: len(planted)].reshape(len(planted), -1)
    return np.degrees(np.sort(subspace_angles(flat.T, found.T)))
