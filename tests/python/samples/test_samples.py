"""Samples are what they claim: topology, positive tets, volumes that converge to the exact ones."""

import itertools

import numpy as np
import pytest

from stretchmap import TetMesh, TriMesh, samples
from stretchmap.errors import (
    DegenerateError,
    MissingDependencyError,
    OpenSurfaceError,
    OptionError,
    SelfIntersectionError,
    SolverError,
)
from stretchmap.mesh import tetrahedralize as tetrahedralizing

SOLID_TORI = {
    "standard": samples.solid_torus,
    "bumpy": samples.bumpy_torus,
    "knot": samples.knot_tube,
    "vertebra": samples.vertebra_like,
}


def euler(mesh: TriMesh) -> int:
    return len(mesh.V) - len(mesh.edges) + len(mesh.F)


@pytest.mark.parametrize("name", SOLID_TORI)
@pytest.mark.parametrize("n_tets", [500, 6000])
def test_solid_tori(name, n_tets):
    solid = SOLID_TORI[name](n_tets)
    assert len(solid.T) == pytest.approx(n_tets, rel=0.25)
    assert solid.tet_volumes.min() > 0
    assert len(np.unique(solid.T)) == len(solid.V)
    solid.require_solid_torus()
    assert euler(solid.surface) == 0
    # The tets fill what the surface encloses: no gap, no overlap at the closing station.
    assert solid.surface.volume == pytest.approx(solid.volume, rel=1e-12)


def test_solid_torus_converges_to_the_exact_volume():
    exact = 2 * np.pi**2 * 3.0
    errors = [exact - samples.solid_torus(n).volume for n in (2_000, 16_000, 128_000)]
    assert errors[0] > 0
    for coarse, fine in itertools.pairwise(errors):
        assert 3.0 < coarse / fine < 5.2  # second order: half the cell size, a quarter of the error


def test_bumps_change_the_volume_as_they_should():
    # The mean of (1 + a cos cos)^2 is 1 + a^2 / 4; the offset of the centroid averages out.
    bumpy = samples.bumpy_torus(150_000, amplitude=0.3)
    plain = samples.solid_torus(150_000)
    assert bumpy.volume / plain.volume == pytest.approx(1 + 0.3**2 / 4, rel=5e-3)


def test_torus_surface():
    surface = samples.torus_surface(40, 30, 2.0, 0.5)
    assert euler(surface) == 0
    surface.require_genus_one()
    assert surface.volume == pytest.approx(2 * np.pi**2 * 2.0 * 0.25, rel=0.02)
    radial = np.hypot(surface.V[:, 0], surface.V[:, 1]) - 2.0
    np.testing.assert_allclose(np.hypot(radial, surface.V[:, 2]), 0.5, rtol=1e-14)


def test_knot_tube_keeps_its_radius_and_closes():
    solid = samples.knot_tube(12_000, radius=0.3)
    t = np.linspace(0, 2 * np.pi, 20_000)
    rho = 2 + np.cos(3 * t)
    curve = np.stack([rho * np.cos(2 * t), rho * np.sin(2 * t), np.sin(3 * t)], axis=1)
    from scipy.spatial import cKDTree

    distance = cKDTree(curve).query(solid.surface.V)[0]
    np.testing.assert_allclose(distance, 0.3, rtol=1e-3)
    # A frame that failed to close would leave one station twisted and its tets far from regular.
    assert solid.tet_volumes.min() > 0.2 * solid.tet_volumes.mean()


@pytest.mark.parametrize("seed", range(5))
def test_individual_vertebrae(seed):
    solid = samples.vertebra_like(8_000, seed)
    assert solid.tet_volumes.min() > 0
    assert not np.array_equal(solid.V, samples.vertebra_like(8_000).V)
    np.testing.assert_array_equal(solid.V, samples.vertebra_like(8_000, seed).V)


def test_vertebra_pair():
    pair = samples.vertebra_pair(40, seed=1, n_tets=(9_000, 14_000))
    assert len(pair.source.V) != len(pair.target.V)
    assert len(np.unique(pair.source_landmarks)) == 40
    assert np.isin(pair.source_landmarks, pair.source.boundary_vertices).all()
    assert np.isin(pair.target_landmarks, pair.target.boundary_vertices).all()
    np.testing.assert_allclose(
        pair.truth[pair.source_landmarks], pair.target.V[pair.target_landmarks], atol=1e-14
    )
    # The truth carries the source mesh onto the other individual without a fold.
    carried = TetMesh(pair.truth, pair.source.T)
    assert carried.tet_volumes.min() > 0
    assert carried.volume == pytest.approx(pair.target.volume, rel=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_vertebra_population(seed):
    bones = samples.vertebra_population(5, seed, n_tets=3000, n_landmarks=12)
    sizes = [np.linalg.norm(np.ptp(solid.V, axis=0)) for solid in bones.solids]
    for i, solid in enumerate(bones.solids):
        assert solid.tet_volumes.min() > 0
        solid.require_solid_torus()
        np.testing.assert_allclose(bones.place(i, bones.material[i]), solid.V, atol=1e-12)
        np.testing.assert_allclose(bones.place(i, bones.reference.V), bones.truth[i], atol=1e-12)
        # Landmarks lie on the smooth surface, off the polyhedron by the height of a chord.
        gap = np.linalg.norm(bones.landmarks[i][:, None] - solid.surface.V, axis=2).min(axis=1)
        assert gap.max() < 0.08 * sizes[i]
    assert len({solid.n_vertices for solid in bones.solids}) > 1
    # What is left of an individual without its pose is the reference moved along the modes.
    turn, shift = bones.poses[2, :3], bones.poses[2, 3]
    unposed = (bones.truth[2] - shift) @ np.linalg.inv(turn)
    moved = bones.reference.V + np.tensordot(bones.scores[2], bones.modes, 1)
    np.testing.assert_allclose(unposed, moved, atol=1e-12)
    again = samples.vertebra_population(5, seed, n_tets=3000, n_landmarks=12)
    np.testing.assert_array_equal(again.solids[4].V, bones.solids[4].V)


def test_modes_of_a_vertebra_population_are_orthogonal_to_each_other_and_to_similarities():
    bones = samples.vertebra_population(1, n_tets=150_000)
    x, o = bones.reference.V - bones.reference.V.mean(axis=0), np.zeros((3, 3, 3))
    o[[0, 1, 2], [1, 2, 0], [2, 0, 1]], o[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0, -1.0
    moved = [np.tile(e, (len(x), 1)) for e in np.eye(3)] + [x] + [x @ turn for turn in o]
    fields = np.concatenate([bones.modes, np.stack(moved)]).reshape(4 + 7, -1)
    fields /= np.linalg.norm(fields, axis=1, keepdims=True)
    angles = fields[:4] @ fields.T - np.eye(4, 11)
    assert np.abs(angles).max() < 0.05  # the points of the reference are spread a little otherwise


def test_a_population_too_wide_is_refused():
    with pytest.raises(SolverError, match="smaller spread"):
        samples.vertebra_population(4, spread=30.0, n_tets=1000)


@pytest.mark.parametrize(
    ("surface", "chi", "volume"),
    [(samples.sphere(8), 2, 4 / 3 * np.pi), (samples.double_torus(2), -2, 13.0)],
)
def test_closed_surfaces(surface, chi, volume):
    surface.require_closed()
    assert euler(surface) == chi
    assert surface.volume == pytest.approx(volume, rel=0.02)


def test_solids_that_are_no_tori():
    for solid in (samples.ball(3), samples.solid_double_torus(1)):
        assert solid.tet_volumes.min() > 0
        assert solid.surface.volume == pytest.approx(solid.volume)


def test_tetrahedralize_keeps_the_surface():
    pytest.importorskip("tetgen")
    surface = samples.torus_surface(30, 12)
    solid = samples.tetrahedralize(surface, max_volume=0.02)
    n = len(surface.V)
    np.testing.assert_array_equal(solid.V[:n], surface.V)
    np.testing.assert_array_equal(solid.boundary_vertices, np.arange(n))
    assert {tuple(np.roll(f, -np.argmin(f))) for f in solid.surface.F} == {
        tuple(np.roll(f, -np.argmin(f))) for f in surface.F
    }
    assert solid.tet_volumes.min() > 0
    assert len(solid.T) > 2 * len(samples.tetrahedralize(surface).T)
    assert solid.volume == pytest.approx(surface.volume, rel=1e-12)


def test_tetrahedralize_refuses_a_surface_that_crosses_itself():
    pytest.importorskip("tetgen")
    surface = samples.torus_surface(30, 12)
    V = surface.V.copy()
    V[0] = -V[0]
    with pytest.raises(SelfIntersectionError, match="crosses itself at") as caught:
        samples.tetrahedralize(TriMesh(V, surface.F))
    assert np.isin(0, surface.F[list(caught.value.ids)])
    assert set(caught.value.ids) <= set(range(surface.n_faces))


def test_tetrahedralize_names_what_is_wrong_with_a_surface():
    pytest.importorskip("tetgen")
    surface = samples.torus_surface(30, 12)
    with pytest.raises(OpenSurfaceError, match="on a border"):
        samples.tetrahedralize(TriMesh(surface.V, surface.F[1:]))
    with pytest.raises(DegenerateError, match="second copy"):
        samples.tetrahedralize(TriMesh(surface.V, np.vstack([surface.F, surface.F[:1]])))


def test_tetrahedralize_makes_as_many_tets_as_their_volume_asks_for(monkeypatch):
    pytest.importorskip("tetgen")
    surface = samples.torus_surface(40, 16)
    volume, run = surface.volume / 6e4, tetrahedralizing._run_tetgen
    solid = samples.tetrahedralize(surface, max_volume=volume, quality=10.0)
    by_surface = (solid.T < surface.n_vertices).any(axis=1)  # which is not refined
    assert by_surface.mean() < 0.2 and np.mean(solid.tet_volumes[~by_surface] > volume) < 0.03
    with pytest.raises(OptionError, match="GiB"):
        samples.tetrahedralize(surface, max_volume=1e-9 * volume)
    # Vertices tetgen may add: it ends at 100,000 if it is not told otherwise.
    allowed = []

    def limited(surface, options):
        allowed.append(options["steinerleft"])
        return run(surface, {**options, "steinerleft": 5000})

    monkeypatch.setattr(tetrahedralizing, "_run_tetgen", limited)
    few = samples.tetrahedralize(surface, max_volume=volume, quality=10.0)
    assert allowed == [-1]
    assert few.n_vertices - surface.n_vertices == 5000 < 0.7 * solid.n_vertices


def test_tetrahedralize_says_what_it_could_not_keep():
    pytest.importorskip("tetgen")
    surface = samples.torus_surface(30, 12)
    inner = 0.5 * (surface.V - [3, 0, 0]) + [9, 0, 0]
    loose = TriMesh(np.vstack([surface.V, inner[:1]]), surface.F)
    with pytest.raises(SolverError, match=r"vertex 360; surface\.compact"):
        samples.tetrahedralize(loose)


def test_tetrahedralize_names_the_package_that_is_missing(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "tetgen", None)
    with pytest.raises(MissingDependencyError, match="pip install"):
        samples.tetrahedralize(samples.torus_surface(10, 5))


@pytest.mark.parametrize(
    "call",
    [
        lambda: samples.solid_torus(100),
        lambda: samples.solid_torus(1000, 1.0, 2.0),
        lambda: samples.bumpy_torus(1000, amplitude=1.5),
        lambda: samples.torus_surface(2, 5),
        lambda: samples.knot_tube(1000, radius=2.0),
        lambda: samples.knot_tube(1000, p=2, q=4),
        lambda: samples.vertebra_pair(100),
        lambda: samples.ball(0),
        lambda: samples.vertebra_population(0),
        lambda: samples.vertebra_population(2, n_landmarks=73),
        lambda: samples.solid_double_torus(0),
        lambda: samples.tetrahedralize(samples.torus_surface(10, 5), quality=0.5),
    ],
)
def test_bad_parameters(call):
    with pytest.raises(OptionError):
        call()
