"""Tets without volume on flat parts of a surface: opened from inside, the surface kept."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.mesh import tetrahedralize as module
from stretchmap.mesh.flat_tets import opened
from stretchmap.mesh.split_edges import split_edges
from stretchmap.samples.solids import cut_cells


def test_a_cavity_is_named_with_what_to_do():
    pytest.importorskip("tetgen")
    outer, inner = sm.samples.sphere(1), sm.samples.sphere(1)
    for F in (inner.F, inner.F[:, ::-1]):  # whichever way it is turned
        surface = sm.TriMesh(
            np.vstack([outer.V, 0.5 * inner.V]), np.vstack([outer.F, F + len(outer.V)])
        )
        with pytest.raises(sm.errors.GenusError, match=r"lies inside another.*leave") as caught:
            sm.tetrahedralize(surface)
        assert caught.value.ids == tuple(range(len(outer.F), len(surface.F)))
    left, _ = sm.TriMesh(surface.V, np.delete(surface.F, caught.value.ids, axis=0)).compact()
    assert sm.tetrahedralize(left).diagnose().ok


def test_a_vertex_that_tetgen_adds_is_refused_with_the_face_it_lies_on(monkeypatch):
    pytest.importorskip("tetgen")
    solid = sm.samples.solid_torus(300)
    surface, ids = solid.surface, solid.boundary_vertices
    inner = np.setdiff1d(np.arange(solid.n_vertices), ids)
    order = np.concatenate([ids, inner])  # as tetgen leaves them
    solid = sm.TetMesh(solid.V[order], np.argsort(order)[solid.T].astype(np.int32))
    edge = surface.F[7, :2]
    split = split_edges(solid, edge[None].astype(np.int32), np.array([0.3])).solid
    monkeypatch.setattr(module, "_run_tetgen", lambda *_: (split.V, split.T))
    with pytest.raises(sm.errors.SolverError, match=r"new vertex on face \d+: .*prepare") as caught:
        sm.tetrahedralize(surface)
    assert np.isin(edge, surface.F[list(caught.value.ids)]).all()


def box_with_flat_tets(step: int) -> sm.TetMesh:
    """A box; under every so many edges that divide a square of its surface lies a flat tet."""
    V, T = cut_cells(np.ones((3, 3, 2), bool))
    solid = sm.TetMesh(V, T, orient=True)
    surface, ids = solid.surface, solid.boundary_vertices
    normals = np.cross(*(surface.V[surface.F[:, k]] - surface.V[surface.F[:, 0]] for k in (1, 2)))
    faces: dict[tuple[int, ...], list[int]] = {}
    for f, corners in enumerate(surface.F.tolist()):
        for i, j in ((0, 1), (1, 2), (2, 0)):
            faces.setdefault(tuple(sorted((corners[i], corners[j]))), []).append(f)
    divided = [(e, pair) for e, pair in faces.items() if np.dot(*normals[pair]) > 0.5]
    squares = [
        (e, pair)
        for e, pair in divided
        if np.isclose(np.linalg.norm(surface.V[e[0]] - surface.V[e[1]]), np.sqrt(2.0))
    ]
    added = [[*e, *(np.setdiff1d(surface.F[f], e)[0] for f in pair)] for e, pair in squares[::step]]
    return sm.TetMesh(solid.V, np.vstack([solid.T, ids[np.array(added)]]), orient=True)


def volumes(solid: sm.TetMesh) -> np.ndarray:
    corners = solid.V[solid.T]
    return np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0


@pytest.mark.parametrize("step", [40, 3, 1])
def test_flat_tets_get_volume_and_the_surface_stays(step):
    solid = box_with_flat_tets(step)
    flat = len(solid.diagnose().degenerate)
    assert flat >= 1
    result = opened(solid)
    assert result.diagnose().ok
    assert volumes(result).min() > 1e-3 and volumes(result).sum() == pytest.approx(18.0)
    assert np.array_equal(result.V[: len(solid.V)], solid.V)
    assert len(result.V) == len(solid.V) + flat
    assert np.array_equal(result.boundary_vertices, solid.boundary_vertices)
    before, after = (np.unique(np.sort(mesh.surface.F), axis=0) for mesh in (solid, result))
    assert np.array_equal(before, after)


def test_flat_tets_open_whatever_the_turn_and_size_of_the_solid():
    solid = box_with_flat_tets(2)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    for size in (1e-20, 1e20):
        turned = sm.TetMesh(size * solid.V @ turn.T, solid.T, orient=True)
        result = opened(turned)
        assert result.diagnose().ok and len(result.V) > len(solid.V)
        assert volumes(result).min() > 1e-3 * size**3


def test_nothing_to_open_and_what_cannot_be_opened_stay():
    solid = sm.samples.solid_torus(500)
    assert opened(solid) is solid
    # All edges of its flat tet are on the surface.
    alone = sm.TetMesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), [[0, 1, 2, 3]])
    assert opened(alone) is alone


def test_what_tetgen_leaves_flat_is_opened(monkeypatch):
    """Its own result, the vertices of the surface first; it need not be there for that."""
    solid = box_with_flat_tets(5)
    order = np.argsort(solid.boundary_index < 0, kind="stable")
    number = np.empty(len(order), int)
    number[order] = np.arange(len(order))
    V, T = solid.V[order], number[solid.T]
    surface = sm.TetMesh(V, T).surface
    monkeypatch.setattr(module, "_run_tetgen", lambda *_: (V, T))
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda _: True)
    result = module.tetrahedralize(surface)
    assert result.diagnose().ok and len(result.V) > len(V)
