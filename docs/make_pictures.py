"""Draw the pictures of the README anew: python docs/make_pictures.py"""

from __future__ import annotations

from pathlib import Path

import stretchmap as sm
from stretchmap import plot

FOLDER = Path(__file__).resolve().parent


def main(n_tets: int = 100_000, folder: Path = FOLDER) -> Path:
    """Map a vertebra-like solid and draw ``map.png``; returns its path."""
    result = sm.volume_map(sm.samples.vertebra_like(n_tets))
    path = folder / "map.png"
    plot.save(plot.levels(result), path, dpi=85)
    return path


if __name__ == "__main__":
    print(main())
