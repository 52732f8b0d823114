"""Fields on the mean: integrals, known differences found and others not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import stretchmap as sm
from stretchmap.errors import ArrayError, OptionError


@pytest.fixture(scope="module")
def bones():
    return sm.samples.vertebra_population(6, seed=2, n_tets=1500)


@pytest.fixture(scope="module")
def found(bones):
    return sm.population.fit(bones.solids, landmarks=bones.landmarks, max_rounds=1, tol=1.0)


def fields(bones, found, change=0.0):
    """A smooth field of the material; in the last three individuals raised in the body."""
    noise = np.random.default_rng(0).normal(0.0, 0.02, 6)
    out = {}
    for name in found.names:
        i = int(name)
        x = bones.material[i][:, 0]
        out[name] = 2.0 + 0.1 * x + noise[i] + (change * (x > 1.5) if i >= 3 else 0.0)
    return out


def test_integrals_are_conserved(bones, found):
    for name, values in fields(bones, found).items():
        solid = bones.solids[int(name)]
        carried = sm.population.carry_field(found, name, values)
        wanted = (solid.tet_volumes * values[solid.T].mean(axis=1)).sum()
        assert carried @ found.mean.tet_volumes == pytest.approx(wanted, rel=1e-12)


def test_a_mean_too_coarse_for_a_shape_is_refined_there(bones, found):
    """The template was mapped with more tets than it has; with its own, some turn over."""
    name, solid = found.names[2], bones.solids[2]
    points = found.correspondences.copy()
    mean = found.mean
    inner = np.setdiff1d(np.arange(mean.n_vertices), mean.boundary_vertices)
    beside = np.setdiff1d(mean.T[(mean.T == inner[0]).any(axis=1)], inner[:1])
    points[2, inner[0]] = 4.0 * points[2, beside].mean(axis=0) - 3.0 * points[2, inner[0]] + 5.0
    turned = dataclasses.replace(found, correspondences=points)
    assert (sm.TetMesh(points[2], mean.T).tet_volumes <= 0.0).any()
    values = fields(bones, found)[name]
    wanted = (solid.tet_volumes * values[solid.T].mean(axis=1)).sum()
    mass = sm.population.carry_field(turned, name, values)
    assert mass @ mean.tet_volumes == pytest.approx(wanted, rel=1e-12)
    there = sm.population.carry_field(turned, name, values, conserve="value")
    plain = sm.population.carry_field(found, name, values, conserve="value")
    assert np.median(np.abs(there - plain)) < 0.02 and np.abs(there - plain).max() < 0.3


def test_values_are_carried_to_where_they_belong(bones, found):
    statistics = sm.population.field_statistics(found, fields(bones, found), conserve="value")
    # 0.1 per unit of length: an error of one percent of the size is 0.01.
    assert np.median(statistics.std) < 0.05
    assert 1.5 < statistics.mean.min() < statistics.mean.max() < 2.5
    assert np.allclose(statistics.mean, statistics.values.mean(axis=0))


def test_a_difference_of_groups_is_found_where_it_is(bones, found):
    group = {name: "changed" if int(name) >= 3 else "control" for name in found.names}
    changed, null = (
        sm.population.field_statistics(
            found, fields(bones, found, change), conserve="value", group=group
        )
        for change in (0.5, 0.0)
    )
    front = changed.values[3:].mean(axis=0) - changed.values[:3].mean(axis=0) > 0.4
    assert 0.05 < front.mean() < 0.9
    assert (changed.p_adjusted[front] < 0.05).mean() > 0.9
    assert (changed.t[front] > 0.0).all()  # "changed" before "control"
    assert (null.p_adjusted < 0.05).mean() < 0.05
    assert (changed.p_adjusted >= changed.p).all()


def test_groups_are_sorted_as_what_their_labels_are(bones, found):
    given = fields(bones, found, 0.5)

    def t(first, second):
        group = {name: second if int(name) >= 3 else first for name in found.names}
        return sm.population.field_statistics(found, given, conserve="value", group=group).t

    wanted = t("a", "b")
    for first, second in ((9, 10), (np.int64(-1), 0.5), ("10", "9")):
        np.testing.assert_array_equal(t(first, second), wanted)
        np.testing.assert_array_equal(t(second, first), -wanted)


@pytest.mark.parametrize(
    "labels", [(1, "1"), (None, "a"), ([1], [2]), (np.ones(2), 1), (np.nan, 1)]
)
def test_labels_that_cannot_be_sorted_are_refused(bones, found, labels):
    group = {name: labels[int(name) >= 3] for name in found.names}
    with pytest.raises(ArrayError, match=r"labels must be all numbers or all text|no label of 0"):
        sm.population.field_statistics(found, fields(bones, found), group=group)


def test_a_field_that_does_not_vary_has_no_t(bones, found):
    ones = {name: np.ones(bones.solids[int(name)].n_vertices) for name in found.names}
    statistics = sm.population.field_statistics(found, ones, conserve="value", against=1.0)
    assert np.isnan(statistics.t).all() and np.allclose(statistics.mean, 1.0)


def test_what_does_not_fit_is_refused(bones, found):
    name, solid = found.names[0], bones.solids[int(found.names[0])]
    for width in (1, 3):
        with pytest.raises(ArrayError, match="values must have shape"):
            sm.population.carry_field(found, name, np.ones((solid.n_vertices, width)))
    good = fields(bones, found)
    with pytest.raises(OptionError, match="name must be '0', '1'"):
        sm.population.carry_field(found, "x", good["0"])
    with pytest.raises(ArrayError):
        sm.population.carry_field(found, "0", good["0"][:-1])
    with pytest.raises(ArrayError, match="two shapes or more, got 1"):
        sm.population.field_statistics(found, {"0": good["0"]})
    for group in ({name: 0 for name in good}, {name: name for name in good}, {"0": 1}):
        with pytest.raises(ArrayError):
            sm.population.field_statistics(found, good, group=group)
