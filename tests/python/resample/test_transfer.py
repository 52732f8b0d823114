"""Fields carried over: what is conserved, what is reproduced, what is left alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import stretchmap as sm
from shapes import a_map
from stretchmap import samples
from stretchmap.errors import ArrayError, NonFiniteError, OptionError

INTEGRAL = {"vertex": lambda m, f: m.tet_volumes @ f[m.T].mean(axis=1)}
INTEGRAL["tet"] = lambda m, f: m.tet_volumes @ f


def onto(solid, image, target):
    """A registration made of any map of the solid."""
    return dataclasses.replace(a_map(solid, image), target=target)


def refit(coarse, fine, stretch=(1.0, 1.0, 1.0)):
    """The identity between two meshes of one torus, or a linear map."""
    solid, other = samples.solid_torus(coarse), samples.solid_torus(fine)
    return onto(solid, solid.V * stretch, sm.TetMesh(other.V * stretch, other.T))


@pytest.fixture(scope="module")
def registered():
    pair = samples.vertebra_pair(n_landmarks=30, n_tets=(2000, 3000))
    return sm.register(pair.source, pair.target, (pair.source_landmarks, pair.target_landmarks))


@pytest.fixture(scope="module")
def between_meshes():
    return refit(1500, 2500, stretch=(1.0, 2.0, 0.5))


def check(result, field, per, conserve="integral"):
    """Integral or mean to rounding, range kept; returns the field carried over."""
    solid, target = result.mesh, result.target
    out = sm.transfer(result, field, per=per, conserve=conserve)
    size = np.abs(field).max()
    scale = 1.0 if conserve == "mean" else solid.volume / target.volume
    mean = INTEGRAL[per](solid, field) / solid.volume
    off = target.tet_volumes @ out / target.volume / scale - mean
    assert np.all(np.abs(off) <= 1e-13 * size)
    slack = 1e-15 * size
    assert (out / scale >= field.min(axis=0) - slack).all()
    assert (out / scale <= field.max(axis=0) + slack).all()
    return out


@settings(max_examples=40, deadline=None)
@given(data=st.data(), per=st.sampled_from(["vertex", "tet"]))
def test_any_field_keeps_integral_and_range(registered, data, per):
    """Whatever its sign, size, support or mean."""
    solid = registered.mesh
    n = solid.n_vertices if per == "vertex" else solid.n_tets
    numbers = st.floats(-1e12, 1e12, allow_subnormal=False)
    few = data.draw(hnp.arrays(float, 8, elements=numbers))
    seed = data.draw(st.integers(0, 2**32 - 1))
    field = np.random.default_rng(seed).choice(few, n)
    if not field.any():
        field[0] = 1.0
    check(registered, field, per, data.draw(st.sampled_from(["integral", "mean"])))


@pytest.mark.parametrize("mean", [0.0, 1e-4, -1e-9, 3.0])
def test_a_field_of_small_mean_comes_back_as_it_is(registered, mean):
    solid = registered.mesh
    field = solid.V[:, 0] - INTEGRAL["vertex"](solid, solid.V[:, 0]) / solid.volume + mean
    out = check(registered, field, "vertex", "mean")
    centers = registered.inverse(registered.target.V[registered.target.T].mean(axis=1))
    there = np.isfinite(centers[:, 0])
    plain = centers[there, 0] - solid.V[0, 0] + field[0]
    assert np.abs(out[there] - plain).max() < 0.1 * np.ptp(field)
    assert np.abs(out[there] - plain).mean() < 0.01 * np.ptp(field)


def test_constants_stay_constant(registered, between_meshes):
    for result in (registered, between_meshes):
        for per, n in (("vertex", result.mesh.n_vertices), ("tet", result.mesh.n_tets)):
            for value in (1.0, -1 / 3, 1e300, 5e-324, 0.0):
                out = sm.transfer(result, np.full(n, value), per=per, conserve="mean")
                assert (out == value).all()
            out = sm.transfer(result, np.full(n, 0.1), per=per)
            assert np.ptp(out) == 0.0
            assert out[0] == pytest.approx(0.1 * result.mesh.volume / result.target.volume)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_linear_fields_are_reproduced_to_the_order_of_the_mesh(seed):
    """Between two meshes of one curved solid; halving the mesh width halves what is off."""
    slope = np.random.default_rng(seed).normal(size=3)
    worst = []
    for n in (2000, 16_000):
        solid, target = samples.bumpy_torus(n), samples.bumpy_torus(4 * n)
        result = onto(solid, solid.V, target)
        out = check(result, solid.V @ slope, "vertex", "mean")
        worst.append(np.abs(out - target.V[target.T].mean(axis=1) @ slope).max())
    assert 1e-6 < worst[1] < 0.6 * worst[0]
    assert worst[1] < 0.2 * np.linalg.norm(slope)
    same = samples.solid_torus(2000)
    out = sm.transfer(onto(same, same.V, same), same.V @ slope)
    assert np.allclose(out, same.V[same.T].mean(axis=1) @ slope, atol=1e-12)


def test_where_a_field_is_zero_all_round_it_stays_zero(registered):
    """The correction is local: a dose stays where it is."""
    solid = registered.mesh
    for share in np.linspace(0.45, 0.55, 40):  # of some, rounding leaves a trifle of the integral
        field = np.where(solid.V[:, 0] > np.quantile(solid.V[:, 0], share), 1.0, 0.0)
        out = check(registered, field, "vertex")
        assert (out == 0.0).mean() > 0.3 and out.min() >= 0.0


@pytest.mark.parametrize("conserve", ["integral", "mean"])
@pytest.mark.parametrize("n_tets", [600, 3000, 20_000])
def test_identity_keeps_every_tet_exactly(n_tets, conserve):
    """No tet straddles two values, so what the sums round off has no place to go."""
    solid = samples.bumpy_torus(n_tets)
    fields = np.random.default_rng(n_tets).random((solid.n_tets, 40)) < np.linspace(0.01, 0.99, 40)
    out = check(onto(solid, solid.V, solid), fields.astype(float), "tet", conserve)
    assert np.array_equal(out, fields)


def test_vector_fields_are_carried_column_by_column(registered):
    solid = registered.mesh
    field = np.column_stack([solid.V, np.ones(solid.n_vertices)])
    out = check(registered, field, "vertex")
    assert out.shape == (registered.target.n_tets, 4)
    columns = np.column_stack([sm.transfer(registered, column) for column in field.T])
    assert np.allclose(out, columns, rtol=1e-12, atol=1e-12)


def test_fields_of_extreme_size_do_not_overflow(registered):
    field = np.sin(registered.mesh.V[:, 0])
    plain = sm.transfer(registered, field, conserve="mean")
    for unit in (2.0**1023, 2.0**-1000):
        assert np.array_equal(sm.transfer(registered, field * unit, conserve="mean") / unit, plain)


def test_a_registration_read_from_a_file_carries_fields_too(registered, tmp_path):
    registered.save(tmp_path / "r.npz")
    field = registered.mesh.V[:, 0] + 10.0
    loaded = sm.load_map(tmp_path / "r.npz")
    assert np.array_equal(sm.transfer(loaded, field), sm.transfer(registered, field))


@pytest.mark.parametrize(
    ("spoil", "error", "words"),
    [
        (lambda f: f[:3], ArrayError, "must have shape"),
        (lambda f: f + 1j, ArrayError, "complex"),
        (lambda f: f > 0, ArrayError, "truth values"),
        (lambda f: f.astype(str), ArrayError, "text"),
        (lambda f: f.astype(object), ArrayError, "Python objects"),
        (lambda f: np.ma.masked_less(f, 0.0), ArrayError, "masked"),
        (lambda f: np.where(f == f.max(), np.inf, f), NonFiniteError, "row"),
        (lambda f: np.where(f == f.max(), np.nan, f), NonFiniteError, "row"),
    ],
)
def test_a_field_that_is_none_is_refused(registered, spoil, error, words):
    with pytest.raises(error, match=words):
        sm.transfer(registered, spoil(registered.mesh.V[:, 0]))


def test_options_are_checked(registered):
    zeros = np.zeros(registered.mesh.n_vertices)
    with pytest.raises(OptionError):
        sm.transfer(registered, zeros, conserve="energy")
    with pytest.raises(OptionError, match="no target"):
        sm.transfer(a_map(registered.mesh, registered.image), zeros)
