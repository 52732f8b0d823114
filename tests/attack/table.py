"""Sound arguments of every public function, by the names the functions share.

A parameter is looked up as ``function.parameter`` first, then by its name alone; it has a kind (see
`hostile`) and a sound value. A kind that ends in ``?`` takes None.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from sound import Sound

import stretchmap as sm

Parameter = tuple[str, Callable[[Sound], Any]]


def _value(value: Any) -> Callable[[Sound], Any]:
    return lambda sound: value


PARAMETERS: dict[str, Parameter] = {
    # meshes and maps
    "V": ("array", lambda s: s.solid.V),
    "TriMesh.V": ("array", lambda s: s.surface.V),
    "F": ("array", lambda s: s.surface.F),
    "T": ("array", lambda s: s.solid.T),
    "surface": ("object", lambda s: s.surface),
    "solid": ("object", lambda s: s.solid),
    "homology_basis.solid": ("object?", _value(None)),
    "mesh": ("object", lambda s: s.solid),
    "source": ("object", lambda s: s.solid),
    "target": ("object", lambda s: s.solid),
    "result": ("object", lambda s: s.map),
    "registration": ("object", lambda s: s.registration),
    "plot.registration.result": ("object", lambda s: s.registration),
    "loops.result": ("object", lambda s: s.surface),
    "basis": ("object?", _value(None)),
    "conformal": ("object?", _value(None)),
    "torus": ("object?", _value(None)),
    "image_on.torus": ("object", lambda s: s.area_map.torus),
    "options": ("object?", _value(None)),
    "found": ("object", lambda s: s.comparison),
    "figure": ("object", lambda s: s.figure),
    "from_meshio.data": ("object", lambda s: s.solid.to_meshio()),
    "from_pyvista.data": ("object", lambda s: s.solid.to_pyvista()),
    "from_trimesh.data": ("object", lambda s: s.surface.to_trimesh()),
    "faces": ("whole", _value(500)),
    "genus": ("whole", _value(1)),
    "balance": ("share", _value(1.0)),
    "maps": ("arrays", lambda s: {0.0: s.map, 1.0: s.map}),
    "spread": ("share", _value(1.0)),
    "vertebra_population.seed": ("seed", _value(1)),
    "max_cut": ("share", _value(0.25)),
    "filler": ("word", _value("auto")),
    "spacing": ("array", _value((1.0, 1.0, 1.0))),
    # populations
    "solids": ("object", lambda s: s.bones),
    "population": ("object", lambda s: s.population),
    "model": ("object", lambda s: s.population.model),
    "fit.template": ("object?", _value(None)),
    "template": ("object", lambda s: s.solid),
    "fit.landmarks": ("object?", _value(None)),
    "correspond.start": ("array?", _value(None)),
    "folder": ("folder?", _value(None)),
    "executor": ("object?", _value(None)),
    "cluster": ("object", _value("dask://localhost:1")),
    "workers": ("whole?", _value(1)),
    "along": ("word", _value("area")),
    "scale": ("flag", _value(True)),
    "volume_weight": ("positive", _value(1.0)),
    "max_rounds": ("whole", _value(1)),
    "fit.tol": ("share", _value(1.0)),
    "shapes": ("array", lambda s: s.population.aligned),
    "mean": ("array?", _value(None)),
    "generalized_procrustes.start": ("array?", _value(None)),
    "carry_field.name": ("word", _value("1")),
    "carry_field.values": ("array", lambda s: s.bones[1].V[:, 0]),
    "carry_field.conserve": ("word", _value("value")),
    "fields": ("arrays", lambda s: {str(k): s.bones[k].V[:, 0] for k in range(3)}),
    "field_statistics.conserve": ("word", _value("value")),
    "group": ("object?", _value(None)),
    "against": ("real", _value(0.0)),
    "n_samples": ("whole", _value(2)),
    "n_modes": ("whole?", _value(1)),
    "scores": ("array", _value([1.0])),
    "shape": ("array", lambda s: s.population.mean.V),
    "number": ("whole", _value(0)),
    "deviations": ("real", _value(1.0)),
    "threshold": ("positive", _value(3.5)),
    "map.name": ("word", _value("1")),
    "Population.save.path": ("path", lambda s: s.path("population.npz")),
    "rotation": ("array", _value([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])),
    "shift": ("array", _value([0.0, 0.0, 1.0])),
    # arrays
    "image": ("array", lambda s: s.solid.V),
    "images": ("arrays", lambda s: {"one": s.solid.V}),
    "angles": ("array?", _value(None)),
    "volume_map.start": ("object?", _value(None)),
    "boundary_image": ("array", lambda s: s.solid.surface.V),
    "values": ("array", lambda s: s.registration.mesh.V[:, 0]),
    "interpolate.values": ("array", lambda s: s.map.mesh.V[:, 0]),
    "interpolate.T": ("array", lambda s: s.map.mesh.T),
    "points": ("array", lambda s: s.map.mesh.V[:3]),
    "Torus.coordinates.points": ("gaps", _value([[3.0, 0.0, 0.5]])),
    "coordinates.points": ("array?", lambda s: s.map.mesh.V[:3]),
    "coefficients": ("array", _value([1, 0])),
    "loop": ("array", lambda s: s.basis.generators[0]),
    "point_data": ("arrays?", lambda s: {"x": s.solid.V}),
    "cell_data": ("arrays?", lambda s: {"y": s.solid.tet_volumes}),
    "corner_uv": ("array?", _value(None)),
    "landmarks": ("array?", _value(None)),
    "source_at": ("array", lambda s: s.solid.boundary_vertices[:3]),
    "target_at": ("array", lambda s: s.solid.boundary_vertices[:3]),
    "u": ("numbers", _value([0.0, 1.0])),
    "v": ("numbers", _value([0.0, 1.0])),
    "s": ("numbers?", _value([0.5, 0.5])),
    # files
    "path": ("path", lambda s: s.path("out.npz")),
    "read_surface.path": ("path", lambda s: s.mesh_file),
    "read_solid.path": ("path", lambda s: s.map_file),
    "read.path": ("path", lambda s: s.mesh_file),
    "load_map.path": ("path", lambda s: s.map_file),
    "certify_file.path": ("path", lambda s: s.map_file),
    "read_landmarks.path": ("path", lambda s: s.marks_file),
    "plot.save.path": ("path", lambda s: s.path("out.png")),
    "HexMesh.save.path": ("path", lambda s: s.path("out.vtu")),
    "Morph.save.path": ("path", lambda s: s.path("out.pvd")),
    # numbers
    "R": ("positive", _value(3.0)),
    "r": ("positive", _value(1.0)),
    "ratio": ("positive?", _value(None)),
    "area_map.ratio": ("positive", _value("conformal")),
    "from_ratio.ratio": ("positive", _value(3.0)),
    "factor": ("positive", _value(2.0)),
    "volume": ("positive?", _value(2.0)),
    "with_volume.volume": ("positive", _value(2.0)),
    "area": ("positive?", _value(None)),
    "with_area.area": ("positive", _value(2.0)),
    "phase": ("real?", _value(0.0)),
    "c": ("real?", _value(None)),
    "tol": ("positive", _value(0.5)),
    "VolumeOptions.tol": ("real?", _value(None)),
    "register.tol": ("real", _value(0.5)),
    "tolerance": ("real", _value(1e-9)),
    "shape_budget": ("positive", _value(1.2)),
    "amplitude": ("real", _value(0.2)),
    "radius": ("positive", _value(0.3)),
    "max_volume": ("positive?", _value(None)),
    "quality": ("positive", _value(1.4)),
    "opening": ("real", _value(0.3)),
    "dpi": ("positive", _value(50.0)),
    "partition.start": ("real", _value(0.0)),
    "within": ("positive", _value(0.1)),
    "count": ("whole?", _value(1)),
    "threads": ("whole?", _value(1)),
    "max_iter": ("steps", _value(2)),
    "volume_map.max_iter": ("steps?", _value(2)),
    "sem_iter": ("steps", _value(2)),
    "sections": ("whole?", _value(12)),
    "block": ("whole?", _value(1)),
    "rings": ("whole?", _value(1)),
    "n_hexahedra": ("whole?", _value(None)),
    "hex_mesh.n_hexahedra": ("whole?", _value(300)),
    "hex_mesh.sections": ("whole?", _value(None)),
    "hex_mesh.block": ("whole?", _value(None)),
    "hex_mesh.rings": ("whole?", _value(None)),
    "target_size": ("positive?", _value(None)),
    "optimize": ("flag", _value(False)),
    "frames": ("whole", _value(2)),
    "frame.i": ("whole", _value(1)),
    "i": ("whole", _value(0)),
    "j": ("whole", _value(1)),
    "n": ("whole", _value(1)),
    "nu": ("whole", _value(6)),
    "nv": ("whole", _value(4)),
    "n_tets": ("whole", _value(400)),
    "vertebra_pair.n_tets": ("pair", _value((400, 400))),
    "n_landmarks": ("whole", _value(3)),
    "p": ("whole", _value(2)),
    "q": ("whole", _value(3)),
    "seed": ("seed?", _value(1)),
    "vertebra_pair.seed": ("seed", _value(1)),
    "waves": ("pair", _value((5, 3))),
    "cells": ("pair", _value((8, 4))),
    "fractions": ("fractions", _value(2)),
    # words and flags
    "by": ("word", _value("s")),
    "weights": ("word", _value("cotangent")),
    "method": ("word?", _value(None)),
    "boundary": ("word?", _value(None)),
    "solver": ("word", _value("auto")),
    "landmark_map": ("word", _value("smooth")),
    "finish": ("word", _value("none")),
    "conserve": ("word", _value("mean")),
    "per": ("word", _value("vertex")),
    "color": ("word", _value("coordinate")),
    "kind": ("word", _value("ratios")),
    "orient": ("flag", _value(False)),
    "compact": ("flag", _value(False)),
    "vertex_exact": ("flag", _value(False)),
    "refine": ("flag", _value(True)),
    "keep_best": ("flag", _value(True)),
    "correct": ("flag", _value(True)),
    "repair": ("flag", _value(True)),
    "align": ("flag", _value(True)),
    "history": ("flag", _value(False)),
    "indent": ("whole?", _value(2)),
    "progress": ("progress?", _value(None)),
}
# Knobs of the optimization, each with its own default as the sound value.
_MOST_STEPS = {"untangle_iter", "frozen_iter", "glide_iter", "target_iter", "shift_iter", "shared"}
_MOST_STEPS |= {"max_cg", "patience"}
_SHARES = {"floor", "frozen_tol", "glide_tol", "marginal_tol"}  # 0: as far as it goes
# Classes that are made by hand; others are results.
CLASSES = {"FillOptions", "PointMap", "TetMesh", "Torus", "TriMesh", "VolumeOptions"}
CLASSES |= {"Dask", "Processes", "Similarity"}
METHODS: dict[str, tuple[Callable[[Sound], Any], tuple[str, ...]]] = {
    "Torus": (
        _value(sm.Torus(3.0, 1.0)),
        ("xi", "coordinates", "normal", "scaled", "with_volume", "with_area", "from_ratio"),
    ),
    "HomologyBasis": (lambda s: s.basis, ("shortest_loop", "length", "classes", "save")),
    "AreaMap": (lambda s: s.area_map, ("image_on",)),
    "VolumeMap": (
        lambda s: s.map,
        ("forward", "inverse", "coordinates", "save", "to_dict", "to_json", "with_fields"),
    ),
    "PointMap": (lambda s: s.map.point_map, ("forward", "inverse")),
    "Located": (lambda s: s.located, ("interpolate",)),
    "Partition": (lambda s: s.partition, ("part", "surface", "interface", "save")),
    "HexMesh": (lambda s: s.grid, ("save",)),
    "Morph": (lambda s: s.morph, ("frame", "save")),
    "Landmarks": (_value(sm.Landmarks), ("of",)),
    "Population": (
        lambda s: s.population,
        ("reconstruct", "sample", "mode", "outliers", "map", "save"),
    ),
    "ShapeModel": (lambda s: s.population.model, ("reconstruct", "project", "sample")),
    "Similarity": (
        _value(sm.population.Similarity(np.eye(3), 2.0, np.ones(3))),
        ("__call__", "back"),
    ),
}


@dataclass(frozen=True)
class Entry:
    """A public function, or a method of a result."""

    name: str
    function: Callable[[Sound], Callable[..., Any]]
    parameters: dict[str, Parameter]


def entries(sound: Sound) -> list[Entry]:
    """Every function of the public modules, and the methods that take arguments."""
    found = []
    for module in (sm, sm.samples, sm.plot, sm.population):
        short = module.__name__.rpartition(".")[2]
        for name in module.__all__:
            function = getattr(module, name)
            if inspect.isfunction(function) or name in CLASSES:
                found.append(_entry(name, f"{short}.{name}", _value(function), function))
    for kind, (make, names) in METHODS.items():
        for name in names:
            method = getattr(make(sound), name)
            found.append(
                _entry(name, f"{kind}.{name}", lambda s, m=make, n=name: getattr(m(s), n), method)
            )
    return found


def _entry(name: str, full_name: str, get: Callable[[Sound], Any], function: Any) -> Entry:
    parameters = {}
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD:
            parameters[parameter.name] = _parameter(name, full_name, parameter)
    return Entry(full_name, get, parameters)


def _parameter(name: str, full_name: str, parameter: inspect.Parameter) -> Parameter:
    for key in (f"{full_name}.{parameter.name}", f"{name}.{parameter.name}", parameter.name):
        if key in PARAMETERS:
            return PARAMETERS[key]
    if name in ("FillOptions", "VolumeOptions"):
        kind = "positive"
        if parameter.name in _MOST_STEPS or parameter.name in _SHARES:
            kind = "steps" if parameter.name in _MOST_STEPS else "share"
        return kind, _value(parameter.default)
    raise LookupError(f"no sound value for {full_name}({parameter.name}=): add it to {__file__}")
