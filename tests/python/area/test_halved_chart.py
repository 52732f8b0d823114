"""Charts of surfaces whose edges are halved."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from small_handles import small_handle, start_of
from stretchmap import _core
from stretchmap.base.torus import TWO_PI
from stretchmap.errors import ArrayError
from stretchmap.mesh.halved_faces import halve_edges


def test_a_chart_is_halved_with_its_surface() -> None:
    start = start_of(small_handle(2))
    level, rng = start.level, np.random.default_rng(5)
    marked = rng.random(len(level.surface.edges)) < 0.3
    finer = start.halved(marked)
    areas = _core.area.turn_areas(finer.level.chart, finer.angles / TWO_PI)
    assert (areas > 0.0).all()
    i, j = level.surface.edges.T
    along = start.angles[j] - start.angles[i] + TWO_PI * level.forms.T
    middle = {(a, b): start.angles[a] + 0.5 * d for a, b, d in zip(i, j, along, strict=True)}
    ends = finer.added.halved[-1]
    found = finer.angles[len(start.angles) :] - [middle[a, b] for a, b in ends]
    assert np.allclose(found / TWO_PI, np.rint(found / TWO_PI), atol=1e-12)
    kept = np.bincount(finer.added.parent_face, areas)
    assert np.allclose(kept, _core.area.turn_areas(level.chart, start.angles / TWO_PI), rtol=1e-9)
    for n_u in (12, 200):  # of fewer faces, and of more
        other = sm.samples.torus_surface(n_u, 30)
        n_edges = len(other.edges)
        halved = halve_edges(other, np.ones(n_edges, bool), np.ones(n_edges)).corners
        with pytest.raises(ArrayError, match="another surface"):
            _core.area.HalvedChart(level.chart, start.angles, halved)
    with pytest.raises(ArrayError, match="for each face"):
        _core.area.chart_forms(
            level.surface.topology, finer.level.chart.shift_u, level.chart.shift_v
        )
