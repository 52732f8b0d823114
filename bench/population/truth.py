"""Synthetic vertebrae against what is known of them: correspondence, landmarks, modes, template.

python bench/population/truth.py --shapes 20 --tets 10000 --seeds 0 --starts 0 7
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import stretchmap as sm
from stretchmap import _core
from stretchmap.deformation.fitting import Anchors
from stretchmap.deformation.pose import rigid_poses

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "python"))
from population.truth import correspondence_errors, mode_angles, size


def landmark_errors(bones, found):
    """Landmarks of every individual carried to every other, none of them used; over the size."""
    mesh, errors = found.mean, []
    skin, faces = mesh.boundary_vertices, mesh.surface.F
    for i, marks in enumerate(bones.landmarks):
        anchors = Anchors.of(sm.TriMesh(found.correspondences[i][skin], faces), marks)
        for j, goal in enumerate(bones.landmarks):
            if i != j:
                carried = anchors.at(found.correspondences[j][skin], faces)
                errors.append(np.linalg.norm(carried - goal, axis=1) / size(bones.solids[j].V))
    return np.concatenate(errors)


def surface_distance(one, other):
    """Root mean square distance of two solids' boundaries in the best rigid pose, over the size."""
    moved = rigid_poses(one.surface, other.surface)[0](one.surface.V)
    gaps = []
    for a, b in ((sm.TriMesh(moved, one.surface.F), other.surface), (other.surface, None)):
        goal = sm.TriMesh(moved, one.surface.F) if b is None else b
        feet = _core.maps.SurfaceTree(goal.V, goal.F).closest(a.V)[0]
        gaps.append(((feet - a.V) ** 2).sum(axis=1))
    return np.sqrt(np.concatenate(gaps).mean()) / size(other.V)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shapes", type=int, default=20)
    parser.add_argument("--tets", type=int, default=10_000)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--starts", type=int, nargs="+", default=[0])
    parser.add_argument("--along", default="smooth", choices=("smooth", "area"))
    parser.add_argument("--executor", default="serial")
    options = parser.parse_args()
    if options.shapes < 5:
        parser.error("four modes are planted: they take at least five shapes to be found")
    for seed in options.seeds:
        bones = sm.samples.vertebra_population(options.shapes, seed, n_tets=options.tets)
        names = [f"{i:02d}" for i in range(options.shapes)]
        means = []
        for start in options.starts:
            clock = time.perf_counter()
            found = sm.population.fit(
                dict(zip(names, bones.solids, strict=True)), names[start], along=options.along,
                executor=options.executor,
            )  # fmt: skip
            seconds = time.perf_counter() - clock
            errors, places = correspondence_errors(bones, found.correspondences)
            marks = landmark_errors(bones, found)
            angles = mode_angles(bones, found.model, places.mean(axis=0))
            means.append(found.mean)
            print(f"seed {seed}, start {start}: {seconds:.0f} s, rounds {len(found.moved)}")
            print(f"  certified         {sum(r['certified'] for r in found.records if r['ok'])} of "
                  f"{options.shapes}, mean {found.certificate.certified}, not smooth "
                  f"{sum(bool(r['note']) for r in found.records if r['ok'])}")  # fmt: skip
            for what, values in (("correspondence", errors), ("held-out landmarks", marks)):
                low, high, most = 100.0 * np.percentile(values, [50, 95, 100])
                print(f"  {what:18} median {low:.2f} %, 95 % {high:.2f} %, worst {most:.2f} %")
            print(f"  angles (degrees)   {', '.join(f'{angle:.1f}' for angle in angles)}")
            print(f"  template moved (%) {', '.join(f'{100 * m:.3f}' for m in found.moved)}")
            print(f"  mode SD            {np.sqrt(found.model.variances[:7]).round(2).tolist()}")
            print(f"  generalization     {found.measures.generalization.mean(axis=1)[:7].round(4)}")
            print(f"  specificity        {found.measures.specificity.mean(axis=1)[:7].round(4)}")
            print(f"  outliers           {found.outliers()}", flush=True)
        for k, mean in enumerate(means[1:], start=1):
            distance = 100.0 * surface_distance(means[0], mean)
            print(f"  template of start {options.starts[k]} from that of {options.starts[0]}: "
                  f"{distance:.3f} % of the size", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
