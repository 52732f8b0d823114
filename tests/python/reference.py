"""Slow, readable twins of the kernels, written from the formulas; the tests compare with them."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np


def face_area(points):
    """Area of a triangle, by Heron's formula."""
    a, b, c = (np.linalg.norm(points[i] - points[j]) for i, j in ((0, 1), (1, 2), (2, 0)))
    s = (a + b + c) / 2
    return np.sqrt(s * (s - a) * (s - b) * (s - c))


def tet_volume(points):
    """Signed volume of a tet."""
    return np.linalg.det(points[1:] - points[0]) / 6


def total_distortion(elements, source, image, n):
    """(6.2) or (6.4) from the sizes of the elements."""
    total = 0.0
    for vertex in range(n):
        ring = [e for e in range(len(elements)) if vertex in elements[e]]
        total += abs(
            sum(source[e] for e in ring) / sum(source) - sum(image[e] for e in ring) / sum(image)
        )
    return total / 4


def ring_ratios(elements, source, image, n):
    """(6.3) or (6.5) from the sizes of the elements."""
    out = []
    for vertex in range(n):
        ring = [e for e in range(len(elements)) if vertex in elements[e]]
        out.append(
            (sum(image[e] for e in ring) / sum(image))
            / (sum(source[e] for e in ring) / sum(source))
        )
    return np.array(out)


def singular_values(source, image):
    """Singular values of the affine map between two triangles in space, largest first."""
    frame = np.linalg.qr((source[1:] - source[0]).T)[0]
    jacobian = (image[1:] - image[0]).T @ np.linalg.inv(frame.T @ (source[1:] - source[0]).T)
    return np.linalg.svd(jacobian, compute_uv=False)


def exact_orient3d(a, b, c, d):
    """Sign of det(b - a, c - a, d - a), in rational arithmetic."""
    a, b, c, d = ([Fraction(float(x)) for x in p] for p in (a, b, c, d))
    rows = [[x - y for x, y in zip(p, a, strict=True)] for p in (b, c, d)]
    det = sum(
        sign * rows[0][i] * rows[1][j] * rows[2][k]
        for (i, j, k), sign in zip(
            itertools.permutations(range(3)), (1, -1, -1, 1, 1, -1), strict=True
        )
    )
    return (det > 0) - (det < 0)
