"""Places where the boundary leaves an interior vertex no room: they are refined, and only they."""

from __future__ import annotations

import logging
from types import SimpleNamespace

import numpy as np
import pytest

from stretchmap import _core, samples
from stretchmap.base.budget import Budget
from stretchmap.mesh.refinement import crowded_edges, refine_overconstrained, surrounding_edges
from stretchmap.volume import untangle_order
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
    late = solve(VolumeProblem.of(whole, image, refine=False), FillOptions(), budget=Budget(0.0))
    assert late.stop_reason == f"the time limit was reached; {late.stuck}"
    assert late.stuck.endswith(" tets could not be untangled")


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


def test_of_edges_with_a_tet_in_common_the_longest_is_halved_first(bolt):
    problem = VolumeProblem.of(*bolt)
    edges = surrounding_edges(problem.solid, np.array([0]))
    assert len(edges) > 10
    lengths = np.linalg.norm(np.diff(problem.V[edges], axis=1)[:, 0], axis=1)
    first = problem.halved(edges).refinement.halved[0]
    at = [np.flatnonzero((edges == pair).all(axis=1))[0] for pair in first]
    # Those that had to wait have a tet in common with a longer one, or one as long.
    ends = [set(pair) for pair in edges[at].tolist()]
    tets = [set(tet) for tet in problem.solid.T.tolist()]
    for k in np.setdiff1d(np.arange(len(edges)), at):
        near = [tet for tet in tets if set(edges[k].tolist()) <= tet]
        rivals = [i for i, pair in zip(at, ends, strict=True) if any(pair <= tet for tet in near)]
        assert not rivals or lengths[rivals].max() > 0.97 * lengths[k]
    assert lengths.argmax() in at and not (np.diff(lengths[at]) > 0.05 * lengths.max()).any()


def test_edges_that_surround_tets_are_all_those_of_vertices_inside_next_to_them():
    solid = samples.solid_torus(3000)
    inside = set(range(solid.n_vertices)) - set(solid.boundary_vertices.tolist())
    for tets in ([5], [5, 700, 2100]):
        corners = set(solid.T[tets].ravel().tolist())
        near = {v for tet in solid.T.tolist() if corners & set(tet) for v in tet} & inside
        expected = [tuple(e) for e in solid.edges.tolist() if near & set(e)]
        found = [tuple(e) for e in surrounding_edges(solid, np.array(tets)).tolist()]
        assert found == expected
        assert {tuple(e) for e in crowded_edges(solid, np.array(tets)).tolist()} <= set(found)


@pytest.mark.parametrize("glide", [False, True])
@pytest.mark.parametrize("breeds", [False, True])
def test_where_halving_breeds_stuck_tets_all_round_is_halved_instead(monkeypatch, breeds, glide):
    """One stuck tet: of three with edges to the boundary halved, none with all those near it."""
    asked: list[str] = []
    state, may_glide = {"halved": ""}, glide

    class Problem:
        refinement, solid = object(), None

        def halved(self, edges):
            state["halved"] = edges
            return Problem()

    def take(problem):
        run.problem = problem

    def some(name):
        return lambda solid, tets: asked.append(name) or name

    def left(*_, glide=True, **__):
        assert not glide or may_glide
        state["halved"], now = "", state["halved"]
        if now == "crowded":
            return np.arange(3 if breeds else 0)
        return np.arange(0)

    run = SimpleNamespace(
        problem=Problem(), take=take, hasty=True, x=None,
        history=SimpleNamespace(budget=Budget(9.0), model=None),
    )  # fmt: skip
    given = run.problem
    monkeypatch.setattr(untangle_order, "crowded_edges", some("crowded"))
    monkeypatch.setattr(untangle_order, "surrounding_edges", some("surrounding"))
    for name in ("_patched", "_patched_gliding", "stuck_tets"):
        monkeypatch.setattr(untangle_order, name, left)
    assert not len(untangle_order._untangled_halved(run, np.arange(1), glide=glide))
    assert asked == ["crowded", "surrounding"][: 1 + breeds]
    assert run.problem is not given
