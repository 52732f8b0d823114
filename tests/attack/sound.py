"""Sound meshes, maps and files, each made when it is first asked for."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import stretchmap as sm


class Sound:
    """What arguments that are not hostile are taken from."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="stretchmap-attack-"))

    def path(self, name: str) -> Path:
        return self.folder / name

    @functools.cached_property
    def solid(self) -> sm.TetMesh:
        return sm.samples.solid_torus(400)

    @functools.cached_property
    def surface(self) -> sm.TriMesh:
        return sm.samples.torus_surface(12, 8)

    @functools.cached_property
    def basis(self) -> Any:
        return sm.homology_basis(self.surface)

    @functools.cached_property
    def conformal(self) -> Any:
        return sm.conformal_map(self.surface)

    @functools.cached_property
    def area_map(self) -> Any:
        return sm.area_map(self.surface, finish="none", phase=0.0)

    @functools.cached_property
    def boundary_map(self) -> Any:
        return sm.area_map(self.solid.surface, finish="none", phase=0.0)

    @functools.cached_property
    def map(self) -> Any:
        return sm.volume_map(self.solid)

    @functools.cached_property
    def registration(self) -> Any:
        return sm.register(self.solid, self.solid, max_iter=2)

    @functools.cached_property
    def partition(self) -> Any:
        return sm.partition(self.map, 2)

    @functools.cached_property
    def grid(self) -> Any:
        return sm.hex_mesh(self.map, sections=12, block=1, rings=1)

    @functools.cached_property
    def morph(self) -> Any:
        return sm.morph(self.map, 2)

    @functools.cached_property
    def comparison(self) -> Any:
        return sm.compare(self.solid, {"one": self.map.image})

    @functools.cached_property
    def located(self) -> Any:
        return sm.PointMap(self.map).forward(self.map.mesh.V[:5])

    @functools.cached_property
    def marks(self) -> Any:
        ids = self.solid.boundary_vertices[:3]
        return sm.Landmarks.of(self.solid, self.solid, ids, ids)

    @functools.cached_property
    def vertebrae(self) -> Any:
        return sm.samples.vertebra_population(6, seed=2, n_tets=600)

    @functools.cached_property
    def bones(self) -> tuple[sm.TetMesh, ...]:
        return self.vertebrae.solids[:3]

    @functools.cached_property
    def bone_marks(self) -> Any:
        """Without them poses are searched for, which takes most of the time of a run."""
        return self.vertebrae.landmarks[:3]

    @functools.cached_property
    def population(self) -> Any:
        folder = self.path("run")
        return sm.population.fit(
            self.bones, landmarks=self.bone_marks, folder=folder, max_rounds=1, tol=1.0
        )

    @functools.cached_property
    def figure(self) -> Any:
        return sm.plot.ratios(self.map)

    @functools.cached_property
    def mesh_file(self) -> Path:
        sm.write(self.path("mesh.npz"), self.surface)
        return self.path("mesh.npz")

    @functools.cached_property
    def map_file(self) -> Path:
        self.map.save(self.path("map.npz"))
        return self.path("map.npz")

    @functools.cached_property
    def marks_file(self) -> Path:
        ids = self.solid.boundary_vertices[:3]
        np.savetxt(self.path("marks.csv"), np.stack([ids, ids], axis=1), "%d", ",")
        return self.path("marks.csv")
