"""Fields of the source go with a registration into its files and the frames of a morph, through
every kind of refinement."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from shapes import thin_wall
from stretchmap.cli import main
from stretchmap.io import read_arrays
from stretchmap.mesh.refinement import Refinement, refine_overconstrained
from stretchmap.mesh.split_edges import SplitSolid


@pytest.fixture(scope="module", params=["frozen", "glide"])
def coarse(request) -> sm.Registration:
    """Onto a thin wall: boundary edges are split, and where the boundary is held, interior edges
    and faces; where it glides, it gives way before that."""
    source, target = sm.samples.solid_torus(400), thin_wall(0.02)
    even = sm.samples.solid_torus(12_000)
    torus, skin = sm.Torus(3.0, 1.0), target.boundary_vertices
    marks = source.boundary_vertices[::22]
    u, v, _ = torus.coordinates(source.V[marks])
    goals = torus.xi(u + 0.3 * np.cos(v), v)
    nearest = [int(np.argmin(((even.V[skin] - goal) ** 2).sum(axis=1))) for goal in goals]
    result = sm.register(source, target, (marks, skin[nearest]), boundary=request.param)
    assert result.boundary == request.param
    assert result.boundary_splits > 0 and result.refinement is not None
    if request.param == "frozen":
        assert result.refinement.n_split > result.boundary_splits
    return result


def inside(solid: sm.TetMesh, tets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether points (k, 3) lie in the tets of these numbers (k,)."""
    corners = solid.V[solid.T[tets]]
    sides = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 2)
    weights = np.linalg.solve(sides, (points - corners[:, 0])[:, :, None])[:, :, 0]
    return (weights > -1e-9).all(axis=1) & (weights.sum(axis=1) < 1.0 + 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_way_back_from_passes_of_splits_and_a_refinement(seed):
    rng = np.random.default_rng(seed)
    solid = sm.samples.solid_torus(400)
    split = SplitSolid.of(solid)
    for _ in range(3):
        edges = rng.permutation(split.solid.edges)[:25]
        split, kept = split.split(edges, rng.uniform(0.2, 0.8, len(edges)))
        assert len(kept)
    for found in (Refinement.of(split), refine_overconstrained(split.solid).after(split)):
        assert found.n_split == found.solid.n_vertices - solid.n_vertices
        assert found.n_added_tets == found.solid.n_tets - solid.n_tets
        np.testing.assert_allclose(found.prolong(solid.V), found.solid.V, atol=1e-12)
        centers = found.solid.V[found.solid.T].mean(axis=1)
        assert inside(solid, found.parent_tet, centers).all()


def test_added_vertices_and_tets_inherit(coarse):
    given = sm.samples.solid_torus(400)
    groups, n = np.arange(given.n_tets) % 5, given.n_vertices
    carried = coarse.with_fields(
        {"load": 2.0 * given.V, "label": np.arange(n)}, {"gmsh:physical": groups}
    )
    np.testing.assert_allclose(carried.point_fields["load"], 2.0 * coarse.mesh.V, atol=1e-12)
    labels = carried.point_fields["label"]
    assert labels.dtype.kind == "i" and (labels[:n] == np.arange(n)).all()
    assert ((labels >= 0) & (labels < n)).all()
    centers = coarse.mesh.V[coarse.mesh.T].mean(axis=1)
    parent = coarse.extra_arrays()["parent_tet"]
    assert inside(given, parent, centers).all()
    np.testing.assert_array_equal(carried.cell_fields["gmsh:physical"], groups[parent])


def test_the_command_carries_fields_into_map_and_frames(tmp_path):
    pytest.importorskip("meshio")
    source, target = sm.samples.solid_torus(600), sm.samples.bumpy_torus(1000)
    groups = np.arange(source.n_tets) % 4
    sm.write(tmp_path / "a.vtu", source, {"t": source.V[:, 0]}, {"gmsh:physical": groups})
    sm.write(tmp_path / "b.npz", target)
    for name in ("map.npz", "map.vtu"):
        arguments = [tmp_path / "a.vtu", tmp_path / "b.npz", "-o", tmp_path / name, "-q"]
        assert main(["register", *map(str, arguments)]) == 0
    found = read_arrays(tmp_path / "map.vtu")
    parent = found.cell_data.get("parent_tet", np.arange(len(found.T)))
    np.testing.assert_array_equal(found.cell_data["gmsh:physical"], groups[parent])
    assert main(["morph", str(tmp_path / "map.npz"), "-o", str(tmp_path / "m.pvd"), "-q"]) == 0
    for frame in ("m_000.vtu", "m_020.vtu"):
        found = read_arrays(tmp_path / frame)
        np.testing.assert_array_equal(found.cell_data["gmsh:physical"], groups[parent])
        np.testing.assert_array_equal(found.point_data["t"][: source.n_vertices], source.V[:, 0])
