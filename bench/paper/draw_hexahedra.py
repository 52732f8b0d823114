"""The picture of docs/finite_elements.md: where grids are off the surface or poor.

Run: python bench/paper/draw_hexahedra.py PICTURE.png SOLID=GRID.vtu ...
"""

from __future__ import annotations

import sys

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import stretchmap as sm
from stretchmap import _core
from stretchmap.resample.quality import boundary_quads

_LIMIT = 0.5  # % of the diagonal, the end of the colors
_POOR = 0.3


def panel(axes, surface: sm.TriMesh, V, H, title: str) -> None:
    """Boundary quads colored by their distance, poor hexahedra outlined, seen from the farthest."""
    quads = boundary_quads(H)
    centers = V[quads].mean(axis=1)
    diagonal = np.linalg.norm(np.ptp(surface.V, axis=0))
    tree = _core.maps.SurfaceTree(surface.V, surface.F)
    samples = [
        centers,
        *(t * centers + (1 - t) * V[quads[:, k]] for k in range(4) for t in (0, 0.5)),
    ]
    away = [np.linalg.norm(tree.closest(np.ascontiguousarray(p))[0] - p, axis=1) for p in samples]
    distance = 100.0 * np.max(away, axis=0) / diagonal
    quality = _core.resample.scaled_jacobians(V, H).min(axis=1)
    poor = quads[np.isin(quads, H[quality < _POOR]).all(axis=1)]
    colors = matplotlib.colormaps["viridis"](distance / _LIMIT)
    axes.add_collection3d(
        Poly3DCollection(V[quads], facecolors=colors, edgecolors="0.2", linewidths=0.2)
    )
    if len(poor):
        axes.add_collection3d(
            Poly3DCollection(V[poor], facecolors="none", edgecolors="red", linewidths=1.5)
        )
    low, high = V.min(axis=0), V.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.1)
    way = centers[distance.argmax()] - 0.5 * (low + high)
    axes.view_init(np.degrees(np.arctan2(way[2], np.hypot(*way[:2]))) + 20.0,
                   np.degrees(np.arctan2(way[1], way[0])) + 30.0)  # fmt: skip
    axes.set_axis_off()
    axes.set_title(f"{title}\n{len(H)}, least scaled Jacobian {quality.min():.2f}", fontsize=9)


def main() -> None:
    import meshio

    picture, *pairs = sys.argv[1:]
    figure = Figure(figsize=(3.2 * len(pairs), 3.6), layout="constrained")
    for place, pair in enumerate(pairs, 1):
        solid, _, path = pair.partition("=")
        grid = meshio.read(path)
        H = np.ascontiguousarray(grid.cells_dict["hexahedron"], np.int32)
        axes = figure.add_subplot(1, len(pairs), place, projection="3d")
        name = solid.rpartition("/")[2].partition("_")[0]
        panel(axes, sm.read_solid(solid).surface, np.ascontiguousarray(grid.points), H, name)
    shades = ScalarMappable(Normalize(0.0, _LIMIT), "viridis")
    figure.colorbar(shades, ax=figure.axes, shrink=0.7, label="off the surface, % of the diagonal")
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    main()
