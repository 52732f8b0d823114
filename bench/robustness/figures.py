"""The figures of a map that the tables are made of."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stretchmap import TetMesh


def quasi_isometry(solid: TetMesh, image: NDArray[np.float64]) -> NDArray[np.float64]:
    """For each tet the least K with ``|x - y| / K <= |f(x) - f(y)| <= K |x - y|``, shape (k,).

    The image is scaled to the volume of the solid first; infinite where a tet is not positive.
    """
    source, target = (
        points[solid.T[:, 1:]] - points[solid.T[:, :1]] for points in (solid.V, image)
    )
    before, after = np.linalg.det(source), np.linalg.det(target)
    total = after.sum() / before.sum()
    constants = np.full(len(solid.T), np.inf)
    if total > 0.0:
        good = (before > 0.0) & (after > 0.0)
        jacobian = np.linalg.solve(source[good], target[good] / np.cbrt(total))
        stretch = np.linalg.svd(jacobian, compute_uv=False)
        constants[good] = np.maximum(stretch[:, 0], 1.0 / stretch[:, -1])
    return constants


def of_ratios(ratios: NDArray[np.float64]) -> dict[str, float]:
    """Mean of ``|ratio - 1|``, standard deviation and extremes of the elements' signed ratios."""
    return {
        "mean": float(np.abs(ratios - 1.0).mean()),
        "sd": float(ratios.std()),
        "ratio_min": float(ratios.min()),
        "ratio_max": float(ratios.max()),
    }


def of_solid_map(given: TetMesh, result: Any) -> dict[str, Any]:
    """Figures of a volume map; ``given`` is the solid that was asked for."""
    solid, image = result.mesh, np.asarray(result.image)
    n = given.n_vertices
    figures = of_ratios(result.distortion.ratios)
    figures["quasi_isometry"] = float(quasi_isometry(solid, image).max())
    return figures | {
        "certified": bool(result.certificate.certified),
        "converged": bool(result.converged),
        "reason": result.certificate.reason if not result.certificate.certified else "",
        "stop_reason": result.stop_reason,
        "flips": int((result.distortion.ratios <= 0.0).sum()),
        "added_percent": 100.0 * (solid.n_tets - given.n_tets) / given.n_tets,
        "rows_kept": bool(np.array_equal(solid.V[:n], given.V)),
        "steps": len(result.history),
        "stages": {name: round(value, 3) for name, value in result.seconds.items()},
    }
