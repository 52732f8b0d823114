"""Tubes around closed curves with a known framing, and linking numbers read off a projection."""

from __future__ import annotations

import numpy as np


def circle(t):
    return np.stack([2 * np.cos(t), 2 * np.sin(t), 0 * t], axis=-1)


def trefoil(t):
    """The (2, 3) torus knot; seen from above it has three crossings of the same sign."""
    rho = 2 + np.cos(3 * t)
    return np.stack([rho * np.cos(2 * t), rho * np.sin(2 * t), np.sin(3 * t)], axis=-1)


def figure_eight(t):
    """The figure-eight knot; seen from above its crossings cancel."""
    rho = 2 + np.cos(2 * t)
    return np.stack([rho * np.cos(3 * t), rho * np.sin(3 * t), np.sin(4 * t)], axis=-1)


def tube(curve, nu=120, nv=10, radius=0.3, twist=0):
    """Points and outward faces of a tube around a closed curve that is nowhere vertical.

    Vertex ``i nv + j`` lies at curve parameter ``2 pi i / nu`` and at the angle ``2 pi j / nv``
    round the tube, counted from the side that is on top in the projection along z, plus ``twist``
    turns on the way round.
    """
    t = 2 * np.pi * np.arange(nu) / nu
    step = 1e-5
    tangent = curve(t + step) - curve(t - step)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    top = np.array([0.0, 0.0, 1.0]) - tangent[:, 2:] * tangent
    top /= np.linalg.norm(top, axis=1, keepdims=True)
    side = np.cross(top, tangent)
    angle = 2 * np.pi * np.arange(nv) / nv + twist * t[:, None]
    points = curve(t)[:, None] + radius * (
        np.cos(angle)[..., None] * top[:, None] + np.sin(angle)[..., None] * side[:, None]
    )
    i, j = (x.ravel() for x in np.indices((nu, nv)))
    a, b = i * nv + j, (i + 1) % nu * nv + j
    c, d = (i + 1) % nu * nv + (j + 1) % nv, i * nv + (j + 1) % nv
    faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    return points.reshape(-1, 3), faces.astype(np.int32)


def projected_linking(p, q):
    """Linking number of closed polygons: half the signed crossings seen along a generic axis."""
    turn, _ = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    p, q = p @ turn, q @ turn
    dp, dq = np.roll(p, -1, axis=0) - p, np.roll(q, -1, axis=0) - q

    def cross(x, y):
        return x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]

    gap = q[None] - p[:, None]
    det = cross(dp[:, None], dq[None])
    det[det == 0] = np.nan  # parallel segments do not cross
    s, t = cross(gap, dq[None]) / det, cross(gap, dp[:, None]) / det
    hit = (0 <= s) & (s < 1) & (0 <= t) & (t < 1)
    height = gap[..., 2] + t * dq[None, :, 2] - s * dp[:, None, 2]
    return round(-(np.sign(det) * np.sign(height))[hit].sum() / 2)
