"""Places where the boundary leaves an interior vertex no room: they are refined, and only they."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from stretchmap import _core, samples
from stretchmap.base.torus import Torus
from stretchmap.mesh.refinement import crowded_edges, refine_overconstrained
from stretchmap.volume.flip_free import FlipFreeSolver
from stretchmap.volume.options import FlipFreeOptions
from stretchmap.volume.problem import SolidProblem
from stretchmap.volume.routes import certified_route
from stretchmap.volume.untangle import untangle_refining

# Corners of a lightning bolt: no point sees all six sides from within.
BOLT = np.array([(1.5, 1.0), (-0.5, 0.6), (-0.3, -0.3), (-1.5, -1.0), (0.5, -0.6), (0.3, 0.3)])


@pytest.fixture(scope="module")
def bolt():
    """A solid torus of hexagonal section, each with one interior vertex; its boundary is mapped so
    that one section becomes a bolt, its neighbours less so."""
    source = samples.solid_torus(400)
    refinement = refine_overconstrained(source)
    ids = source.boundary_vertices
    x, y, z = source.surface.V.T
    u, p = np.arctan2(y, x), np.hypot(x, y) - 3.0
    corner = np.round(np.arctan2(z, p) / (np.pi / 3.0)).astype(int) % 6
    share = np.exp(-((4.0 * np.sin(u / 2.0)) ** 2))[:, None]
    q = (1.0 - share) * np.stack([p, z], axis=1) + share * BOLT[corner]
    image = np.stack([(3.0 + q[:, 0]) * np.cos(u), (3.0 + q[:, 0]) * np.sin(u), q[:, 1]], axis=1)
    faces = source.surface.F
    assert not len(_core.certificate.crossing_faces(image, faces, 10))
    V = refinement.solid.V / source.volume ** (1.0 / 3.0)
    start = V.copy()
    start[ids] = image / _core.mesh.enclosed_volume(image, faces) ** (1.0 / 3.0)
    solver = FlipFreeSolver(
        V=V, T=refinement.solid.T, boundary=ids, faces=ids[faces], R=2.0, r=1.0,
        options=FlipFreeOptions(),
    )  # fmt: skip
    return source, refinement, solver, start


def test_a_vertex_without_room_is_given_company(bolt, caplog):
    source, refinement, solver, start = bolt
    stuck, left = solver.untangle(start, glide=False)
    assert left > 0
    with caplog.at_level(logging.INFO, "stretchmap"):
        solver, done, x, left = untangle_refining(solver, refinement, start, glide=False)
    assert left == 0 and (_core.volume.signed_tet_volumes(x, done.solid.T) > 0.0).all()
    assert "are stuck" in caplog.text
    ids = source.boundary_vertices
    np.testing.assert_array_equal(x[ids], start[ids])
    np.testing.assert_array_equal(done.solid.boundary_vertices, ids)
    # Only the tets at the inverted ones have been cut.
    flipped = _core.volume.signed_tet_volumes(stuck, refinement.solid.T) <= 0.0
    near = np.isin(refinement.solid.T, refinement.solid.T[flipped]).any(axis=1)
    cut = np.bincount(done.parent_tet, minlength=source.n_tets) > 1
    assert cut.any() and not cut[~near].any()


def test_halved_edges_leave_the_way_back(bolt):
    source, refinement, _, _ = bolt
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


def test_the_certified_route_refines_where_it_may(bolt):
    _, refinement, solver, start = bolt
    torus, options = Torus(2.0, 1.0), FlipFreeOptions(frozen_iter=5)
    for given in (refinement, None):
        problem = SolidProblem(refinement.solid, solver.V, start, torus, 1.0, True, given)
        problem, run = certified_route(
            problem, options, glide=False, vertex_exact=False, solver="auto", progress=None
        )
        volumes = _core.volume.signed_tet_volumes(run.x, problem.solid.T)
        if given is None:
            assert problem.solid is refinement.solid and not (volumes > 0.0).all()
            assert "could not be untangled" in run.stop_reason
        else:
            assert problem.refinement.solid is problem.solid and (volumes > 0.0).all()
