"""What gliding costs in correspondence: pairs of synthetic vertebrae against the truth.

python bench/population/gliding.py --seeds 51 52 53 --tets 5000
"""

from __future__ import annotations

import argparse

import numpy as np

import stretchmap as sm


def surface_errors(bones: sm.samples.VertebraPopulation, result: sm.Registration) -> np.ndarray:
    """(n,) How far the source's boundary vertices end from where they truly are, over the size."""
    solid, target = bones.solids
    skin = solid.boundary_vertices
    truth = bones.place(1, bones.material[0][skin])
    size = np.linalg.norm(np.ptp(target.V, axis=0))
    return np.linalg.norm(result.image[skin] - truth, axis=1) / size


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[51, 52, 53])
    parser.add_argument("--tets", type=int, default=5000)
    options = parser.parse_args()
    for seed in options.seeds:
        bones = sm.samples.vertebra_population(2, seed, n_tets=options.tets)
        for way in ("frozen", "glide"):
            result = sm.register(*bones.solids, boundary=way)
            errors, found = surface_errors(bones, result), result.distortion
            print(
                f"seed {seed} {way:6s} ended {result.boundary:6s} total distortion "
                f"{found.total_distortion:.4f}  errors in per cent: median "
                f"{100 * np.median(errors):.2f}, 95 % {100 * np.quantile(errors, 0.95):.2f}  "
                f"({result.stop_reason})",
                flush=True,
            )


if __name__ == "__main__":
    main()
