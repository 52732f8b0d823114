"""Places where the boundary leaves an interior vertex no room: they are refined, and only they."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from stretchmap import _core, samples
from stretchmap.mesh.refinement import crowded_edges, refine_overconstrained
from stretchmap.volume.engine import solve
from stretchmap.volume.options import FillOptions
from stretchmap.volume.problem import VolumeProblem

# Corners of a lightning bolt: no point sees all six sides from within.
BOLT = np.array([(1.5, 1.0), (-0.5, 0.6), (-0.3, -0.3), (-1.5, -1.0), (0.5, -0.6), (0.3, 0.3)])


@pytest.fixture(scope="module")
def bolt():
    """A solid torus of hexagonal section, each with one interior vertex; its boundary is mapped so
    that one section becomes a bolt, its neighbours less so."""
    source = samples.solid_torus(400)
    x, y, z = source.surface.V.T
    u, p = np.arctan2(y, x), np.hypot(x, y) - 3.0
    corner = np.round(np.arctan2(z, p) / (np.pi / 3.0)).astype(int) % 6
    share = np.exp(-((4.0 * np.sin(u / 2.0)) ** 2))[:, None]
    q = (1.0 - share) * np.stack([p, z], axis=1) + share * BOLT[corner]
    image = np.stack([(3.0 + q[:, 0]) * np.cos(u), (3.0 + q[:, 0]) * np.sin(u), q[:, 1]], axis=1)
    faces = source.surface.F
    assert not len(_core.certificate.crossing_faces(image, faces, 10))
    return source, image


@pytest.fixture(scope="module")
def refinement(bolt):
    return refine_overconstrained(bolt[0])


def run(source, image, **options):
    options = FillOptions(frozen_iter=5, **options)
    return solve(VolumeProblem.of(source, image, refine=options.refine), options)


def test_a_vertex_without_room_is_given_company(bolt, caplog):
    source, image = bolt
    with caplog.at_level(logging.INFO, "stretchmap"):
        outcome = run(source, image)
    solid, x = outcome.problem.solid, outcome.problem.x
    assert (_core.mesh.tet_volumes(x, solid.T) > 0.0).all()
    assert "are stuck" in caplog.text and outcome.problem.refinement.halved
    ids = source.boundary_vertices
    np.testing.assert_array_equal(solid.boundary_vertices, ids)
    back = x[ids] * outcome.problem.length + outcome.problem.center
    np.testing.assert_allclose(back, image, atol=1e-12)
    # Only few tets have been cut: those round the bolt.
    cut = np.bincount(outcome.problem.refinement.parent_tet, minlength=source.n_tets) > 2
    u = np.arctan2(*source.V[source.T].mean(axis=1)[:, [1, 0]].T)
    assert cut.any() and np.abs(u[cut]).max() < 0.5 * np.pi


def test_a_solid_that_must_not_be_refined_is_given_up(bolt):
    source, image = bolt
    whole = refine_overconstrained(source).solid
    outcome = run(whole, image, refine=False)
    assert outcome.problem.solid is whole and not outcome.converged
    assert (_core.mesh.tet_volumes(outcome.problem.x, whole.T) <= 0.0).any()
    assert "could not be untangled" in outcome.stop_reason


def test_halved_edges_leave_the_way_back(bolt, refinement):
    source, _ = bolt
    done = refinement
    for k in (7, 90):
        corners = done.solid.T[k]
        done = done.halve(crowded_edges(done.solid, np.array([k])))
        # No interior vertex of that tet touches the boundary any more.
        outside = done.solid.boundary_index >= 0
        a, b = done.solid.edges[outside[done.solid.edges].sum(axis=1) == 1].T
        assert not np.isin(corners, np.where(outside[a], b, a)).any()
    new, n = done.solid, source.n_vertices
    assert new.diagnose().ok and len(done.halved) > 1
    np.testing.assert_array_equal(new.V[:n], source.V)
    np.testing.assert_allclose(new.V, done.prolong(source.V), atol=1e-15)
    assert done.n_split == new.n_vertices - n
    assert done.n_added_tets == new.n_tets - source.n_tets
    assert (np.diff(done.parent_tet) >= 0).all()
    shares = np.bincount(done.parent_tet, new.tet_volumes)
    np.testing.assert_allclose(shares, source.tet_volumes, rtol=1e-12)
    rows = [np.unique(np.sort(mesh.surface.F, axis=1), axis=0) for mesh in (new, source)]
    np.testing.assert_array_equal(*rows)
