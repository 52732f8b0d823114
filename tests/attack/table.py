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
from parameters import PARAMETERS, Parameter, value
from sound import Sound

import stretchmap as sm

# Knobs of the optimization, each with its own default as the sound value.
_MOST_STEPS = {"untangle_iter", "frozen_iter", "glide_iter", "target_iter", "shift_iter", "shared"}
_MOST_STEPS |= {"max_cg", "patience"}
# 0: as far as it goes
_SHARES = {"floor", "frozen_tol", "glide_tol", "marginal_tol", "glide_std", "glide_distortion"}
# Classes that are made by hand; others are results.
CLASSES = {"FillOptions", "PointMap", "TetMesh", "Torus", "TriMesh", "VolumeOptions"}
CLASSES |= {"Dask", "Processes", "Similarity"}
CLASSES |= {"AreaStretch", "DistortionEnergy", "VolumeStretch"}
METHODS: dict[str, tuple[Callable[[Sound], Any], tuple[str, ...]]] = {
    "Torus": (
        value(sm.Torus(3.0, 1.0)),
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
    "Landmarks": (value(sm.Landmarks), ("of",)),
    "Energy": (
        lambda s: sm.energies.DistortionEnergy(s.solid),
        ("elements", "value", "gradient", "hessian"),
    ),
    "Population": (
        lambda s: s.population,
        ("reconstruct", "sample", "mode", "outliers", "map", "save"),
    ),
    "ShapeModel": (lambda s: s.population.model, ("reconstruct", "project", "sample")),
    "Similarity": (
        value(sm.population.Similarity(np.eye(3), 2.0, np.ones(3))),
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
    for module in (sm, sm.samples, sm.plot, sm.population, sm.energies):
        short = module.__name__.rpartition(".")[2]
        for name in module.__all__:
            function = getattr(module, name)
            if inspect.isfunction(function) or name in CLASSES:
                found.append(_entry(name, f"{short}.{name}", value(function), function))
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
        return kind, value(parameter.default)
    raise LookupError(f"no sound value for {full_name}({parameter.name}=): add it to {__file__}")
