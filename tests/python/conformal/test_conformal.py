"""Conformal maps: exact moduli, both routes to the lattice, (6.1), invariance, folds, refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest

import shapes
import tubes
from stretchmap import TetMesh, Torus, TriMesh, _core, conformal_map, homology_basis
from stretchmap.conformal.hodge import hodge_lattice
from stretchmap.conformal.torus import conformal_torus, tube_angle
from stretchmap.errors import GenusError, OptionError
from stretchmap.samples import torus_surface

MESHES = ["bob_small", "kitten_small", "twisted_tdem", "vertebra_tdem", "knot_8000"]


def planar_corners(result):
    """(m, 3, 2) corners of each face in the plane, corner 0 at the origin."""
    surface = result.mesh
    i, j = surface.edges.T
    forms = result.forms + (result.turns[j] - result.turns[i]).T
    sign = np.where(surface.F < np.roll(surface.F, -1, axis=1), 1, -1)
    along = (forms[:, surface.topology.edge.reshape(-1, 3)] * sign).transpose(1, 2, 0)
    corners = np.zeros((len(surface.F), 3, 2))
    corners[:, 1], corners[:, 2] = along[:, 0], along[:, 0] + along[:, 1]
    return corners @ result.lattice


def conformal_energy(result):
    """(6.1) face by face: half the Dirichlet energy, from gradients, less the signed area."""
    x = result.mesh.V[result.mesh.F]
    e1, e2 = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    first = e1 / np.linalg.norm(e1, axis=1, keepdims=True)
    normal = np.cross(e1, e2)
    second = np.cross(normal, first) / np.linalg.norm(normal, axis=1, keepdims=True)
    flat = np.stack(
        [np.stack([(e * d).sum(axis=1) for d in (first, second)], axis=-1) for e in (e1, e2)],
        axis=1,
    )
    z = planar_corners(result)
    jacobian = np.linalg.solve(flat, z[:, 1:])
    area = 0.5 * np.abs(np.linalg.det(flat))
    image = 0.5 * np.linalg.det(z[:, 1:])
    return (0.5 * area * (jacobian**2).sum(axis=(1, 2))).sum() - image.sum(), image


# ---------------------------------------------------------------- closed forms


def flat_torus(n, m, first, second, rng):
    """Topology of an n by m grid, edge vectors on the flat torus with the periods given."""
    surface = TriMesh(*shapes.torus(n, m))
    i, j = surface.edges.T
    grid = np.stack([np.arange(n * m) // m / n, np.arange(n * m) % m / m], axis=1)
    grid += rng.uniform(-0.2, 0.2, grid.shape) / [n, m]
    step = grid[j] - grid[i]
    winding = -np.rint(step)
    return surface, winding.astype(np.int32).T, (step + winding) @ np.array([first, second])


@pytest.mark.parametrize(
    ("first", "second"), [((2.0, 0.0), (0.0, 1.0)), ((3.0, 0.0), (0.7, 1.3)), ((1.0, 0), (-0.4, 2))]
)
def test_flat_torus_is_exact(first, second):
    """On a flat torus the linear coordinates are harmonic whatever the triangulation."""
    surface, winding, vectors = flat_torus(9, 7, first, second, np.random.default_rng(0))
    sign = np.where(surface.F < np.roll(surface.F, -1, axis=1), 1, -1)
    e = vectors[surface.topology.edge.reshape(-1, 3)] * sign[..., None]
    assert np.abs(e.sum(axis=1)).max() < 1e-14
    weights = np.zeros(len(vectors))
    for k in range(3):
        a, b = e[:, (k + 1) % 3], e[:, (k + 2) % 3]
        cotangent = -(a * b).sum(axis=1) / np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        np.add.at(weights, surface.topology.edge.reshape(-1, 3)[:, k], 0.5 * cotangent)
    forms, _, gram = _core.forms.harmonic_forms(surface.n_vertices, surface.edges, weights, winding)
    periods = np.array([first, second])
    assert np.allclose(forms.T @ periods, vectors, atol=1e-13)
    # The closed form: sqrt(det G) G^-1 is the Gram matrix of the periods over their area.
    area = np.linalg.det(periods)
    assert np.allclose(
        np.sqrt(np.linalg.det(gram)) * np.linalg.inv(gram), periods @ periods.T / area, atol=1e-12
    )
    assert np.linalg.det(gram) == pytest.approx(1, abs=1e-12)


def test_torus_of_revolution_has_its_modulus_to_second_order():
    """Aspect sqrt((R / r)^2 - 1); the longitude's angle is exact, the tube's converges."""
    exact = np.sqrt(3.0**2 - 1.0)
    errors, tube_errors = [], []
    for nv in (8, 16, 32):
        nu = 3 * nv
        result = conformal_map(torus_surface(nu, nv, 3.0, 1.0))
        errors.append(abs(result.aspect - exact))
        assert result.aspect > 1 and result.flips == 0
        u, v = (result.angles / (2 * np.pi)).T
        grid_u, grid_v = np.arange(nu * nv) // nv / nu, np.arange(nu * nv) % nv / nv
        # Orientation fixes the pair up to turning both round.
        way = 1 if circular(u - grid_u, by_row=nv) < circular(u + grid_u, by_row=nv) else -1
        assert circular(u - way * grid_u, by_row=nv) < 1e-12
        shift = (v - way * grid_v).reshape(nu, nv)
        assert np.abs((shift - shift[:1] + 0.5) % 1 - 0.5).max() < 1e-12
        y = result.turns[:, 1]
        expected = inverse_tube_angle(grid_v, exact)
        tube_errors.append(circular(y - way * expected))
    assert errors[0] > 3.5 * errors[1] > 12 * errors[2]
    assert tube_errors[0] > 3 * tube_errors[1] > 9 * tube_errors[2]


def circular(turns, by_row=None):
    """Spread on the circle, in turns; by_row: within each column of the grid only."""
    z = np.exp(2j * np.pi * turns)
    if by_row:
        z = z.reshape(-1, by_row)
        return np.abs(np.angle(z / z[:1])).max() / (2 * np.pi)
    return np.abs(np.angle(z / z.mean())).max() / (2 * np.pi)


def inverse_tube_angle(v, aspect):
    """Conformal coordinate of a tube angle, both in turns: dy = aspect r dv / (R + r cos v)."""
    fine = np.linspace(0, 1, 20001)
    slope = aspect / (np.sqrt(1 + aspect**2) + np.cos(2 * np.pi * fine))
    y = np.concatenate([[0], np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(fine))])
    assert y[-1] == pytest.approx(1, abs=1e-9)
    return np.interp(v % 1, fine, y)


@pytest.mark.parametrize("aspect", [0.3, 1.0, 2.5])
def test_torus_map_is_conformal_for_every_aspect(aspect):
    """The corrected (3.15) against finite differences, and against its Cartesian form."""
    torus = conformal_torus(aspect)

    def image(x, y):
        return torus.xi(2 * np.pi * x, tube_angle(np.atleast_1d(y), aspect))[0]

    for x, y in np.random.default_rng(0).uniform(-2, 2, (20, 2)):
        h = 1e-6
        fu = (image(x + h, y) - image(x - h, y)) / (2 * h * aspect)
        fv = (image(x, y + h) - image(x, y - h)) / (2 * h)
        scale = np.linalg.norm(fu)
        assert np.linalg.norm(fv) == pytest.approx(scale, rel=1e-8)
        assert abs(fu @ fv) < 1e-8 * scale**2
        d = np.sqrt(aspect**2 + 1) - np.cos(2 * np.pi * y)
        a, b = 2 * np.pi * x, 2 * np.pi * y
        expected = np.array([aspect * np.cos(a), aspect * np.sin(a), np.sin(b)]) / d
        assert np.allclose(image(x, y), expected, atol=1e-12)


def test_tube_angle_is_continuous_and_keeps_whole_turns():
    y = np.linspace(-3, 3, 4001)
    v = tube_angle(y, 0.7)
    assert (np.diff(v) > 0).all() and np.diff(v).max() < 0.04
    assert np.allclose(tube_angle(y + 2, 0.7), v + 4 * np.pi, atol=1e-12)


# ---------------------------------------------------------------- independent second computations


@pytest.mark.parametrize("name", MESHES)
def test_energy_and_area_from_the_image(name, load_surface):
    surface = load_surface(name)
    result = conformal_map(surface)
    energy, image = conformal_energy(result)
    assert energy / surface.area == pytest.approx(result.conformal_energy, abs=1e-10)
    assert np.sqrt(np.linalg.det(result.gram)) - 1 == pytest.approx(
        result.conformal_energy, abs=1e-14
    )
    assert image.sum() == pytest.approx(surface.area, rel=1e-11)
    assert (image > 0).all() and result.flips == 0 and result.converged
    assert np.allclose(
        image, result.chart_areas * surface.area, rtol=1e-6, atol=1e-12 * image.sum()
    )


@pytest.mark.parametrize("name", MESHES)
def test_paper_route_gives_the_same_lattice(name, load_surface):
    surface = load_surface(name)
    basis = homology_basis(surface)
    result = conformal_map(surface, basis=basis)
    by_hodge = hodge_lattice(surface, basis)
    error = np.abs(by_hodge - result.lattice).max() / np.abs(result.lattice).max()
    assert error < 1.5 * result.conformal_energy
    assert np.linalg.det(by_hodge) == pytest.approx(surface.area, rel=1e-12)
    # Where the discrete star is normalised to square to -1, the two are the same to rounding.
    gram = result.gram
    star = np.linalg.solve([[0, 1], [-1, 0]], gram).T / np.sqrt(np.linalg.det(gram))
    first, second = (np.eye(2) + 1j * star)[0]
    ratio = second / first
    closed = result.lattice[1] / result.lattice[0, 0]
    assert [ratio.real, ratio.imag] == pytest.approx(list(closed), abs=1e-10)


def test_every_surface_maps_without_folds(mesh_dir, load_surface):
    """Conformal maps exist on all of them; what is not conformal is the mesh's coarseness."""
    for path in sorted((mesh_dir / "surfaces").glob("*.ply")):
        result = conformal_map(load_surface(path.stem))
        assert result.flips == 0 and result.distortion.flips == 0, path.stem
        assert result.weights == "cotangent"
        assert 0 < result.conformal_energy < 60 / result.mesh.n_faces, path.stem
        assert abs(result.gram[0, 1]) <= 0.5 * result.gram[0, 0] * (1 + 1e-9)


def test_lattice_is_the_best_one():
    """Every other lattice of the same area has more energy."""
    result = conformal_map(TriMesh(*tubes.tube(tubes.trefoil, 90, 8, twist=1)))
    rng = np.random.default_rng(0)

    def dirichlet(lattice):
        return 0.5 * np.sum(result.gram * (lattice @ lattice.T))

    best = dirichlet(result.lattice)
    for _ in range(20):
        other = result.lattice @ (np.eye(2) + 0.05 * rng.normal(size=(2, 2)))
        other *= np.sqrt(np.linalg.det(result.lattice) / np.linalg.det(other))
        assert dirichlet(other) > best
    assert result.aspect == pytest.approx(
        np.linalg.norm(result.lattice[0]) / np.linalg.norm(result.lattice[1]), rel=1e-12
    )
    first, second = result.lattice / np.linalg.norm(result.lattice, axis=1, keepdims=True)
    assert result.skew == pytest.approx(first @ second, abs=1e-12)


@pytest.mark.parametrize("twist", [-7, -1, 0, 4])
def test_the_longitude_is_not_twisted(twist):
    """However the mesh winds, the skew is that of the least skew longitude."""
    result = conformal_map(TriMesh(*tubes.tube(tubes.circle, 80, 12, twist=twist)))
    assert abs(result.gram[0, 1]) <= 0.5 * result.gram[0, 0] * (1 + 1e-9)
    assert abs(result.skew) < 0.1  # a Dehn twist alone makes 0.14


# ---------------------------------------------------------------- the image


@pytest.mark.parametrize("name", MESHES)
def test_image_lies_on_the_torus(name, load_surface):
    result = conformal_map(load_surface(name))
    _, _, s = result.torus.coordinates(result.image)
    assert np.allclose(s, result.torus.r, rtol=1e-12)
    assert result.torus.area == pytest.approx(result.mesh.area, rel=1e-12)
    assert result.torus.ratio == pytest.approx(np.sqrt(1 + result.aspect**2), rel=1e-12)
    assert isinstance(result.torus, Torus)


def test_angles_converge_on_a_smooth_surface():
    """A bumpy tube: the mean angle distortion of the image tends to 1 like the edge length."""
    means = []
    for n in (1, 2, 4):
        points, faces = tubes.tube(tubes.circle, 40 * n, 12 * n, radius=0.8)
        points *= 1 + 0.1 * np.sin(2 * points)
        means.append(conformal_map(TriMesh(points, faces)).distortion.angle_mean - 1)
    assert means[0] > 1.8 * means[1] > 3.24 * means[2]


def test_numbering_rotation_and_scale_do_not_matter():
    points, faces = tubes.tube(tubes.trefoil, 90, 9, radius=0.35, twist=1)
    points += np.random.default_rng(0).normal(scale=0.01, size=points.shape)
    reference = conformal_map(TriMesh(points, faces))
    rng = np.random.default_rng(5)
    for scale in (1e-5, 1.0, 1e7):
        order = rng.permutation(len(points))
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        moved = TriMesh(scale * (points[order] @ turn), np.argsort(order)[faces[::-1]])
        result = conformal_map(moved)
        assert result.aspect == pytest.approx(reference.aspect, rel=1e-10)
        assert result.skew == pytest.approx(reference.skew, abs=1e-10)
        assert result.conformal_energy == pytest.approx(reference.conformal_energy, abs=1e-11)
        assert result.torus.R == pytest.approx(scale * reference.torus.R, rel=1e-10)
        gap = min(
            np.abs(np.angle(z / z[0])).max()
            for way in (1, -1)
            for z in [np.exp(2j * np.pi * (result.turns - way * reference.turns[order]))]
        )
        assert gap < 1e-8


def test_a_mirror_image_has_the_opposite_skew():
    points, faces = tubes.tube(tubes.trefoil, 90, 9)
    here = conformal_map(TriMesh(points, faces))
    there = conformal_map(TriMesh(points * [1, 1, -1], faces[:, ::-1]))
    assert abs(here.skew) > 1e-3
    assert there.skew == pytest.approx(-here.skew, abs=1e-10)
    assert there.aspect == pytest.approx(here.aspect, rel=1e-10)


# ---------------------------------------------------------------- folds


def jittered_torus(seed):
    nu, nv = 24, 10
    i, j = np.arange(nu * nv) // nv, np.arange(nu * nv) % nv
    jitter = np.random.default_rng(seed).uniform(-0.45, 0.45, (2, nu * nv))
    u, v = (i + jitter[0]) / nu, (j + jitter[1]) / nv
    return TriMesh(Torus(3, 1).xi(2 * np.pi * u, 2 * np.pi * v), torus_surface(nu, nv).F)


@pytest.mark.parametrize(("seed", "weights"), [(34, "intrinsic_delaunay"), (1, "clamped")])
def test_negative_weights_that_fold_the_chart_are_replaced(seed, weights):
    surface = jittered_torus(seed)
    plain = conformal_map(surface, weights="cotangent")
    assert plain.flips > 0 and not plain.converged and "folded" in plain.stop_reason
    assert plain.weights == "cotangent"
    result = conformal_map(surface)
    assert result.weights == weights
    assert result.flips == 0 and result.converged and result.stop_reason == "solved"
    # The energy is measured in cotangent weights whichever were used: least for these.
    assert result.conformal_energy > plain.conformal_energy
    energy, image = conformal_energy(result)
    assert energy / surface.area == pytest.approx(result.conformal_energy, abs=1e-10)
    assert (image > 0).all()


@pytest.mark.parametrize("seed", range(20, 32))
def test_clamped_weights_never_fold(seed):
    try:
        basis = homology_basis(jittered_torus(seed))
    except Exception as error:  # a jitter that makes the surface cross itself
        pytest.skip(str(error))
    assert conformal_map(basis.surface, basis=basis, weights="clamped").flips == 0


# ---------------------------------------------------------------- refusals and output


def test_other_genera_are_refused():
    for filled, genus in ((shapes.BALL, 0), (shapes.DOUBLE, 2)):
        surface = TetMesh(*shapes.cubes(filled)).surface
        with pytest.raises(GenusError, match=f"has genus {genus}"):
            conformal_map(surface)
        with pytest.raises(GenusError):
            hodge_lattice(surface)
    with pytest.raises(OptionError, match="weights must be 'auto'"):
        conformal_map(TriMesh(*shapes.torus()), weights="mean value")


def test_report_and_file(tmp_path):
    result = conformal_map(TriMesh(*shapes.torus()))
    report = json.loads(result.to_json())
    assert report["chart_flips"] == 0 and report["weights"] == "cotangent"
    assert report["aspect"] == pytest.approx(result.aspect)
    assert set(report["seconds"]) == {"homology", "conformal"}
    assert "conformal energy" in result.summary()
    result.save(tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz") as data:
        assert np.array_equal(data["turns"], result.turns)
        assert np.array_equal(data["image"], result.image)
