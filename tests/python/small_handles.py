"""Tori turned inside out near a point: bodies whose hole is small, and their charts."""

from __future__ import annotations

import numpy as np

import stretchmap as sm
from stretchmap import TriMesh, _core
from stretchmap.area.coarse import Level
from stretchmap.area.finer import Finer
from stretchmap.area.map import equal_areas
from stretchmap.area.search import search_phase
from stretchmap.base.torus import TWO_PI


def small_handle(seed: int, far: float = 3.6) -> TriMesh:
    """A torus turned inside out about a point close to it: a big body with a small hole."""
    rng = np.random.default_rng(seed)
    mesh = sm.samples.torus_surface(40, 28, 2.0, 1.0)
    away = mesh.V - [far, *rng.uniform(-0.2, 0.2, size=2)]
    return TriMesh(away / (away**2).sum(axis=1)[:, None], mesh.F, orient=True)


def start_of(surface: TriMesh) -> Finer:
    """Its chart as it is, no edge halved."""
    chart = sm.area_map(surface, finish="none", keep_best=True)
    level = Level.of(surface, chart.angles / TWO_PI, chart.forms, chart.ratio)
    return Finer.of(level, np.array(chart.angles), chart.ratio)


def eased(surface: TriMesh) -> tuple[Level, np.ndarray, float, float]:
    """A level with turns eased towards shapes, phase and ratio."""
    equal = equal_areas(surface, sm.conformal_map(surface), None)
    turns, _ = equal.eased(0.01, equal.balanced(0.0)[0])
    phase, ratio, _ = search_phase(surface, turns, equal.level.aspect, None, "conformal")
    return equal.level, turns, phase, ratio


def inward_faces(finer: Finer) -> int:
    """How many faces do not look outward."""
    faces = finer.level.chart.faces
    return len(_core.certificate.torus_graph(finer.image, faces, finer.ratio).bad)
