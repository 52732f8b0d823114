"""Edges of surfaces halved: the same surface, in more pieces, with the way back."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.errors import ArrayError
from stretchmap.mesh.halved_faces import SurfaceRefinement, halve_edges


def lengths_of(surface: sm.TriMesh) -> np.ndarray:
    """(e,) of the edges."""
    return np.linalg.norm(np.diff(surface.V[surface.edges], axis=1)[:, 0], axis=1)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 1.0])
def test_halving_edges_changes_no_point_of_the_surface(share: float) -> None:
    surface = sm.samples.bumpy_torus(1000).surface
    rng = np.random.default_rng(3)
    marked = rng.random(len(surface.edges)) < share
    done = halve_edges(surface, marked, lengths_of(surface))
    finer = done.surface
    assert finer.genus == 1 and finer.volume == pytest.approx(surface.volume, rel=1e-13)
    assert (finer.V[: surface.n_vertices] == surface.V).all()
    assert (finer.V[surface.n_vertices :] == surface.V[done.edges].mean(axis=1)).all()
    areas = np.bincount(done.parent, finer.face_areas, surface.n_faces)
    assert np.allclose(areas, surface.face_areas, rtol=1e-12)
    halved = {tuple(edge) for edge in done.edges.tolist()}
    assert {tuple(edge) for edge in surface.edges[marked].tolist()} <= halved
    assert halved.isdisjoint({tuple(edge) for edge in finer.edges.tolist()})
    assert (np.diff(done.parent) >= 0).all()
    a, b, c = np.moveaxis(finer.V[finer.F], 1, 0)
    p, q, r = np.moveaxis(surface.V[surface.F[done.parent]], 1, 0)
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.cross(q - p, r - p)) <= 0.0
    assert not turned.any()


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_the_longest_edge_of_a_face_is_halved_with_any_other(seed: int | None) -> None:
    surface = sm.samples.torus_surface(24, 12)
    lengths = lengths_of(surface)
    if seed is not None:  # chains of longer and longer edges, either way
        lengths = np.random.default_rng(seed).random(len(lengths))
    marked = np.arange(len(surface.edges)) == lengths.argmin()
    if seed is not None:
        marked |= np.arange(len(lengths)) % 50 == 0
    halved = halve_edges(surface, marked, lengths).edges
    assert len(halved) > 1
    index = {tuple(edge): k for k, edge in enumerate(surface.edges.tolist())}
    cut = np.zeros(len(surface.edges), bool)
    cut[[index[tuple(edge)] for edge in halved.tolist()]] = True
    edge = surface.topology.edge.reshape(-1, 3)
    longest = edge[np.arange(len(edge)), lengths[edge].argmax(axis=1)]
    assert cut[longest[cut[edge].any(axis=1)]].all()


@pytest.mark.parametrize("pattern", range(1, 8))
def test_a_face_is_cut_by_the_shorter_median(pattern: int) -> None:
    surface = sm.samples.torus_surface(24, 12)
    surface = sm.TriMesh(surface.V * [1.0, 1.3, 0.8], surface.F)
    edge = surface.topology.edge.reshape(-1, 3)
    lengths = lengths_of(surface)
    longest = lengths[edge[0]].argmax()
    marked = np.zeros(len(lengths), bool)
    marked[edge[0][[k for k in range(3) if pattern >> k & 1]]] = True
    done = halve_edges(surface, marked, lengths)
    parts = done.surface.F[done.parent == 0]
    cut = marked[edge[0]] | (np.arange(3) == longest)
    assert len(parts) == 1 + cut.sum()
    if cut.sum() == 2:  # corners that meet at the edge left whole
        whole = int((~cut).argmax())
        ends = surface.F[0][[whole, (whole + 1) % 3]]
        ids = {tuple(pair): surface.n_vertices + k for k, pair in enumerate(done.edges.tolist())}
        far = surface.F[0][(whole + 2) % 3]
        medians = {}
        for here, other in (ends, ends[::-1]):
            midpoint = ids[min(far, other), max(far, other)]
            medians[np.linalg.norm(surface.V[here] - done.surface.V[midpoint])] = (here, midpoint)
        here, midpoint = medians[min(medians)]
        assert any({here, midpoint} <= set(part) for part in parts.tolist())


def test_flags_and_lengths_are_of_the_edges() -> None:
    surface = sm.samples.torus_surface(24, 12)
    lengths = lengths_of(surface)
    with pytest.raises(ArrayError, match="for each edge"):
        halve_edges(surface, np.ones(3, bool), lengths)
    with pytest.raises(ArrayError, match="for each edge"):
        halve_edges(surface, np.ones(len(lengths), bool), lengths[1:])


def test_values_are_carried_over_pass_by_pass() -> None:
    surface = sm.samples.torus_surface(24, 12)
    finer = SurfaceRefinement.of(surface)
    for _ in range(3):
        marked = np.arange(len(finer.surface.edges)) % 7 == 0
        finer = finer.after(halve_edges(finer.surface, marked, lengths_of(finer.surface)))
    assert len(finer.halved) == 3 and finer.n_added_faces == finer.surface.n_faces - 576
    assert np.allclose(finer.prolong(surface.V), finer.surface.V, rtol=0, atol=1e-14)
    areas = np.bincount(finer.parent_face, finer.surface.face_areas)
    assert np.allclose(areas, surface.face_areas, rtol=1e-12)
    with pytest.raises(ArrayError, match="288 rows"):
        finer.prolong(np.zeros(5))
