import numpy as np
import pytest

from stretchmap import Torus
from stretchmap.errors import ArrayError, OptionError


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_xi_and_coordinates_are_inverse(rng):
    torus = Torus(3.0, 1.25)
    u, v = rng.uniform(0, 2 * np.pi, (2, 500))
    s = rng.uniform(1e-3, torus.r, 500)
    back = torus.coordinates(torus.xi(u, v, s))
    for got, want in zip(back, (u, v, s), strict=True):
        np.testing.assert_allclose(got, want, atol=1e-11)


def test_surface_points_lie_on_the_torus_and_normals_stand_on_it(rng):
    torus = Torus(2.0, 0.7)
    u, v = rng.uniform(-10, 10, (2, 200))
    x = torus.xi(u, v)
    np.testing.assert_allclose(
        (np.hypot(x[:, 0], x[:, 1]) - torus.R) ** 2 + x[:, 2] ** 2, torus.r**2, rtol=1e-13
    )
    h = 1e-6
    xu = (torus.xi(u + h, v) - torus.xi(u - h, v)) / (2 * h)
    xv = (torus.xi(u, v + h) - torus.xi(u, v - h)) / (2 * h)
    cross = np.cross(xu, xv)
    cross /= np.linalg.norm(cross, axis=1, keepdims=True)
    np.testing.assert_allclose(torus.normal(u, v), cross, atol=1e-8)


def test_area_and_volume_match_quadrature():
    torus = Torus(2.5, 1.5)
    n = 400
    t = 2 * np.pi * np.arange(n) / n
    ring = 2 * np.pi * (torus.R + torus.r * np.cos(t))
    assert torus.area == pytest.approx(np.mean(ring * torus.r) * 2 * np.pi, rel=1e-13)
    # Volume by the divergence theorem: one third of the integral of x . n.
    x, normal = torus.xi(0.0, t), torus.normal(0.0, t)
    flux = np.mean(np.sum(x * normal, axis=1) * ring * torus.r) * 2 * np.pi / 3
    assert torus.volume == pytest.approx(flux, rel=1e-13)


def test_sizes():
    torus = Torus(3.0, 1.0)
    assert torus.ratio == 3.0
    assert torus.scaled(2.0) == Torus(6.0, 2.0)
    assert torus.with_volume(5.0).volume == pytest.approx(5.0, rel=1e-14)
    assert torus.with_area(5.0).area == pytest.approx(5.0, rel=1e-14)
    assert torus.with_area(5.0).ratio == pytest.approx(3.0, rel=1e-14)
    assert Torus.from_ratio(4.0) == Torus(4.0, 1.0)
    assert Torus.from_ratio(4.0, volume=2.0).volume == pytest.approx(2.0, rel=1e-14)
    assert Torus.from_ratio(4.0, area=2.0).area == pytest.approx(2.0, rel=1e-14)


def test_angles_stay_below_a_full_turn():
    u, v, _ = Torus(2.0, 1.0).coordinates([[2.5, -1e-300, -1e-300], [0.0, 0.0, 0.5]])
    assert ((u >= 0) & (u < 2 * np.pi) & (v >= 0) & (v < 2 * np.pi)).all()


@pytest.mark.parametrize(
    ("R", "r"), [(1, 1), (1, 2), (1, 0), (1, -1), (np.nan, 1), (np.inf, 1), (2, np.nan)]
)
def test_bad_radii(R, r):
    with pytest.raises(OptionError):
        Torus(R, r)


def test_bad_arguments():
    torus = Torus(2, 1)
    with pytest.raises(OptionError):
        Torus.from_ratio(2.0, volume=1.0, area=1.0)
    with pytest.raises(OptionError):
        torus.with_volume(-1.0)
    with pytest.raises(OptionError):
        torus.with_area(np.inf)
    with pytest.raises(OptionError):
        Torus.from_ratio(0.5)
    with pytest.raises(ArrayError):
        torus.coordinates([1.0, 2.0])


def test_one_point_has_no_further_axis():
    torus = Torus(3.0, 1.0)
    assert torus.xi(0.0, 0.0).tolist() == [4.0, 0.0, 0.0]
    assert torus.normal(0.0, 0.0).shape == (3,)
    assert [angle.shape for angle in torus.coordinates([3.5, 0.0, 0.0])] == [(), (), ()]
