"""Maps from a template to solids of a population: certified, and true to the material."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stretchmap as sm
from population.truth import correspondence_errors, size
from stretchmap.deformation.fitting import Anchors, Template, fit_surface
from stretchmap.deformation.pose import rigid_poses
from stretchmap.deformation.similarity import similarity_onto
from stretchmap.deformation.thin_plate import ThinPlate
from stretchmap.population import correspond
from stretchmap.population.correspondence import _eased


@pytest.fixture(scope="module")
def bones():
    return sm.samples.vertebra_population(6, seed=2, n_tets=3000)


@pytest.mark.parametrize("along", ["smooth", "area"])
def test_maps_are_certified_and_end_on_the_surface(bones, along):
    found = correspond(bones.solids[0], bones.solids[1], along=along)
    assert found.certificate.certified and found.along == along and not found.note
    goal = bones.solids[1].surface
    boundary = found.image[bones.solids[0].boundary_vertices]
    feet = sm._core.maps.SurfaceTree(goal.V, goal.F).closest(boundary)[0]
    assert np.abs(feet - boundary).max() < 1e-9 * size(goal.V)


def test_smoothness_finds_what_areas_miss(bones):
    template, n = bones.solids[0], bones.solids[0].n_vertices
    errors = {}
    for along in ("smooth", "area"):
        points = [correspond(template, bones.solids[i], along=along).image[:n] for i in (1, 2)]
        found, _ = correspondence_errors(bones, [template.V, *points], (0, 1, 2))
        errors[along] = np.median(found)
    assert errors["smooth"] < 0.004 < errors["area"] and errors["smooth"] < 0.5 * errors["area"]


def test_a_pose_that_looks_as_good_is_not_taken():
    """Individuals whose processes resemble each other: the closest rigid pose is a third of a turn
    off, and bending tells."""
    bones = sm.samples.vertebra_population(6, seed=7, n_tets=3000)
    source, target = bones.solids[0], bones.solids[2]
    truth = bones.place(2, bones.material[0])
    first = rigid_poses(source.surface, target.surface)[0](source.V)
    assert np.median(np.linalg.norm(first - truth, axis=1)) > 0.1 * size(truth)
    found = correspond(source, target).image[: source.n_vertices]
    assert np.median(np.linalg.norm(found - truth, axis=1)) < 0.01 * size(truth)


@pytest.mark.parametrize(("seed", "individual"), [(202, 1), (205, 2)])
def test_coarse_meshes_are_not_followed_face_by_face(seed, individual):
    """A softer spline would end farther off, folded or in another pose."""
    bones = sm.samples.vertebra_population(individual + 1, seed=seed, n_tets=1200)
    source, target = bones.solids[0], bones.solids[individual]
    found, truth = correspond(source, target), bones.place(individual, bones.material[0])
    errors = np.linalg.norm(found.image[: source.n_vertices] - truth, axis=1) / size(truth)
    assert found.along == "smooth" and np.median(errors) < 0.015
    assert np.percentile(errors, 95) < 0.04


def test_affine_maps_are_recovered_exactly(bones):
    template = Template(bones.solids[0])
    matrix = np.eye(3) + 0.05 * np.random.default_rng(3).standard_normal((3, 3))
    goal = sm.TriMesh(template.solid.surface.V @ matrix + [0.1, 0.0, 0.2], template.solid.surface.F)
    fitted = fit_surface(template, goal, template.solid.surface.V, None)
    assert np.abs(fitted.projected - goal.V).max() < 1e-3 * size(goal.V)
    assert fitted.distance < 1e-4 * size(goal.V)


def test_affine_maps_do_not_bend():
    points = np.random.default_rng(0).standard_normal((200, 3))
    spline = ThinPlate.of(points, 40)
    coefficients = np.zeros(len(spline.bending))
    coefficients[:4] = [0.3, 1.0, -2.0, 0.5]
    assert coefficients @ spline.bending @ coefficients == 0.0
    assert np.linalg.eigvalsh(spline.bending)[4:].min() > 0.0
    assert np.abs(spline.projector @ np.column_stack([np.ones(40), spline.sites])).max() < 1e-12


def test_landmarks_draw(bones):
    solid = bones.solids[0]
    at = solid.surface.V[[10, 200]]
    template = Template(solid, Anchors.of(solid.surface, at))
    moved = at + np.array([[0.03 * size(solid.V), 0.0, 0.0], [0.0, 0.0, 0.0]])
    tree = sm._core.maps.SurfaceTree(solid.surface.V, solid.surface.F)
    moved = tree.closest(moved)[0]  # another point of the surface
    assert np.linalg.norm(moved - at, axis=1)[0] > 0.01 * size(solid.V)
    free, held = (
        fit_surface(template, solid.surface, solid.surface.V, marks) for marks in (None, moved)
    )
    gaps = [
        np.linalg.norm(template.anchors.at(f.projected, solid.surface.F) - moved, axis=1)
        for f in (free, held)
    ]
    assert gaps[1][0] < 0.3 * gaps[0][0]


def test_a_goal_that_cannot_be_reached_smoothly_is_told():
    template, goal = sm.samples.solid_torus(1500), sm.samples.bumpy_torus(4000, amplitude=0.6)
    found = correspond(template, goal)
    assert found.certificate.certified
    assert (found.along == "smooth") == (not found.note)


def test_only_what_is_beside_inverted_tets_is_evened_out(bones):
    template = Template(bones.solids[0])
    solid, surface = template.solid, template.solid.surface
    image = solid.V.copy()
    folded = int(solid.boundary_vertices[7])
    image[folded] += 2.0 * (image.mean(axis=0) - image[folded])
    found = SimpleNamespace(image=image, mesh=solid)
    inverted = np.flatnonzero(sm.TetMesh(image, solid.T).tet_volumes <= 0.0)
    assert 0 < len(inverted) < 60
    moved = np.abs(_eased(template, surface, surface.V, found) - surface.V).max(axis=1) > 1e-12
    near = np.isin(solid.boundary_vertices, solid.T[inverted])
    ring = template.ring_mean @ near.astype(float) > 0.0
    assert moved[near].any() and not moved[~(near | ring)].any()


@pytest.mark.parametrize("individual", [1, 7])
def test_a_start_a_third_of_a_turn_off_is_not_believed(individual):
    """Seen from an average, the right pose needs less bending; that round it is taken."""
    bones = sm.samples.vertebra_population(8, seed=5, n_tets=3000)
    template, solid = bones.reference, bones.solids[individual]
    turn = Rotation.from_matrix(
        bones.poses[individual][:3] / np.cbrt(np.linalg.det(bones.poses[individual][:3]))
    )
    center = template.V.mean(axis=0)
    axis = np.linalg.svd(template.surface.V - center, full_matrices=False)[2][2]
    third = Rotation.from_rotvec(2.0 * np.pi / 3.0 * axis)
    wrong = turn.inv().apply(third.apply(template.surface.V - center))
    wrong += solid.V.mean(axis=0)
    begun, found = correspond(template, solid, start=wrong), correspond(template, solid)
    assert begun.along == found.along == "smooth"
    gap = np.linalg.norm(begun.smooth - found.smooth, axis=1)
    assert np.median(gap) < 0.02 * size(solid.V)
    lie = similarity_onto(template.V, begun.smooth).rotation
    true = turn.inv().as_matrix().T
    assert np.trace(lie.T @ true) > 2.5
