"""Landmarks of real vertebrae, by one rule on every bone, held out of the fit: errors carried.

python bench/population/run.py --start vertebra_L2_vhm --rounds 4
python bench/population/landmarks.py build/population/all

The rule knows nothing of correspondences. Axes are the principal ones of the solid: lateral is the
one most nearly perpendicular to the axis of the foramen (that of the shortest loop round it) and to
the way from there to the center of mass, anterior the one along that way. What reaches far from the
center, the processes more than the body, hangs down: the moment sum vol * anterior^2 * up is
negative. Landmarks are the tips of the processes: what reaches farthest back, to either side, and,
behind the middle of the foramen, up and down on either side.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import stretchmap as sm
from stretchmap.deformation.fitting import Anchors

Array = NDArray[np.float64]
TIP = 0.02  # of the size: how far round the farthest vertex a tip reaches
NAMES = (
    "spinous", "transverse left", "transverse right", "superior left", "superior right",
    "inferior left", "inferior right",
)  # fmt: skip


@dataclass(frozen=True)
class Anatomy:
    """Center of the foramen and unit vectors left, anterior, up: a right-handed frame."""

    center: Array
    left: Array
    anterior: Array
    up: Array
    width: float  # of the foramen

    def coordinates(self, points: Array) -> Array:
        """(n, 3) along left, anterior and up, from the center."""
        return (points - self.center) @ np.stack([self.left, self.anterior, self.up], axis=1)


def anatomy(solid: sm.TetMesh) -> Anatomy:
    """By the rule above."""
    surface = solid.surface
    loop = surface.V[sm.homology_basis(surface, solid).tunnel_loops[0]]
    center = loop.mean(axis=0)
    axis = np.cross(loop - center, np.roll(loop, -1, axis=0) - center).sum(axis=0)
    axis /= np.linalg.norm(axis)
    volumes, middles = solid.tet_volumes, solid.V[solid.T].mean(axis=1)
    mass = volumes @ middles / volumes.sum()
    middles = middles - mass
    principal = np.linalg.eigh(middles.T @ (volumes[:, None] * middles))[1]
    ahead = mass - center - axis * (axis @ (mass - center))
    left = principal[:, np.argmax(np.abs(principal.T @ np.cross(ahead, axis)))]
    anterior = principal[:, np.argmax(np.abs(principal.T @ (ahead - left * (left @ ahead))))]
    anterior = anterior * np.sign(anterior @ ahead)
    up = np.cross(left, anterior)
    if volumes @ ((middles @ anterior) ** 2 * (middles @ up)) > 0.0:
        left, up = -left, -up
    return Anatomy(center, left, anterior, up, float(np.ptp((loop - center) @ left)))


def landmarks(solid: sm.TetMesh) -> Array:
    """The tips, in the order of `NAMES`: (7, 3)."""
    frame, V = anatomy(solid), solid.surface.V
    x, y, z = frame.coordinates(V).T
    aside = np.abs(x) > 0.25 * frame.width
    sides = [(y < 0.0) & aside & (x > 0.0), (y < 0.0) & aside & (x < 0.0)]
    asked = [(-y, np.ones(len(V), bool)), (x, x > 0.0), (-x, x < 0.0)]
    asked += [(sign * z, side) for sign in (1.0, -1.0) for side in sides]
    reach, tips = TIP * np.linalg.norm(np.ptp(V, axis=0)), []
    for height, where in asked:
        top = V[np.argmax(np.where(where, height, -np.inf))]
        tips.append(V[np.linalg.norm(V - top, axis=1) < reach].mean(axis=0))
    return np.array(tips)


def carried(correspondences: Array, mean: sm.TetMesh, marks: list[Array]) -> Array:
    """Distances (k, k, l) of the landmarks of one shape, carried to another, from its own."""
    skin, faces = mean.boundary_vertices, mean.surface.F
    errors = np.full((len(marks), len(marks), len(marks[0])), np.nan)
    for i, own in enumerate(marks):
        anchors = Anchors.of(sm.TriMesh(correspondences[i][skin], faces), own)
        for j, goal in enumerate(marks):
            if i != j:
                there = anchors.at(correspondences[j][skin], faces)
                errors[i, j] = np.linalg.norm(there - goal, axis=1)
    return errors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="what `run` wrote")
    options = parser.parse_args()
    saved = np.load(options.folder / "population.npz")
    shapes = json.loads(str(saved["meta"]))["shapes"]
    names = [shape["name"] for shape in shapes]
    solids = [sm.read_solid(options.folder / "solids" / f"{name}.npz") for name in names]
    marks = [landmarks(solid) for solid in solids]
    mean = sm.TetMesh(saved["V"], saved["T"])
    errors = carried(saved["correspondences"], mean, marks)
    print("landmark            median    90 %   worst  (mm, ordered pairs)")
    for k, name in enumerate((*NAMES, "all")):
        values = errors[..., k] if name != "all" else errors
        low, high, most = np.nanpercentile(values, [50, 90, 100])
        print(f"{name:18} {low:7.2f} {high:7.2f} {most:7.2f}")
    print("shape               median to and from all others")
    for i, name in enumerate(names):
        print(f"{name:24} {np.nanmedian(np.concatenate([errors[i], errors[:, i]])):7.2f}")


if __name__ == "__main__":
    main()
