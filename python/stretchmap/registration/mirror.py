"""Whether one of two shapes is the mirror image of the other, as a left bone is of a right one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .landmarks import similarity

__all__ = ["MIRROR_ADVICE", "mirrored_landmarks"]

MIRROR_ADVICE = (
    "one of the two is likely a mirror image, as a left bone is of a right one; mirror it, and its "
    "landmarks: TetMesh(V * [-1, 1, 1], T, orient=True)"
)
_FEWEST = 4  # fewer lie in a plane, which is its own mirror image
_FAR, _CLOSER = 0.05, 0.5  # misfit over their size that is none of a kind, and what is clearly less

Array = NDArray[np.float64]


def mirrored_landmarks(points: Array, images: Array) -> str:
    """What to tell of landmarks (l, 3) that fit their images far better reflected; else nothing."""
    if (
        len(points) < _FEWEST
        or not np.ptp(points, axis=0).any()
        or not np.ptp(images, axis=0).any()
    ):
        return ""
    plain, reflected = (_misfit(points * [side, 1.0, 1.0], images) for side in (1.0, -1.0))
    if plain <= _FAR or reflected >= _CLOSER * plain:
        return ""
    return (
        f"landmarks fit to {plain:.2g} of their size, after a reflection to {reflected:.2g}: "
        f"{MIRROR_ADVICE}"
    )


def _misfit(points: Array, images: Array) -> float:
    """Root mean square after the best similarity, over that about the middle of the images."""
    rotation, scale, shift = similarity(points, images)
    gaps = scale * points @ rotation + shift - images
    size = np.linalg.norm(images - images.mean(axis=0))
    return float(np.linalg.norm(gaps) / size)
