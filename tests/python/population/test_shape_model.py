"""The linear model against planted modes, and its measures where they are known."""

from __future__ import annotations

import numpy as np
import pytest

from stretchmap.errors import ArrayError, OptionError
from stretchmap.population import measure_model, shape_model

RNG = np.random.default_rng(5)


def planted(k=30, n=50, deviations=(3.0, 1.0)):
    """Shapes with orthonormal modes and scores that are not correlated."""
    modes = np.linalg.qr(RNG.standard_normal((3 * n, len(deviations))))[0].T
    scores = RNG.standard_normal((k, len(deviations)))
    scores = np.linalg.qr(scores - scores.mean(axis=0))[0] * np.sqrt(k - 1.0) * deviations
    mean = RNG.standard_normal((n, 3))
    return mean + (scores @ modes).reshape(k, n, 3), mean, modes.reshape(-1, n, 3)


def test_planted_modes_come_back():
    shapes, mean, modes = planted()
    model = shape_model(shapes)
    assert model.n_modes == 2
    assert np.allclose(model.mean, mean) and np.allclose(model.variances, [9.0, 1.0])
    assert np.allclose(np.abs(np.einsum("inx,jnx->ij", model.modes, modes)), np.eye(2), atol=1e-9)
    flat = model.modes.reshape(2, -1)
    assert (flat[[0, 1], np.abs(flat).argmax(axis=1)] > 0).all()


def test_scores_make_the_shapes_again():
    shapes, *_ = planted(k=6, deviations=(3.0, 2.0, 1.0))
    model = shape_model(shapes)
    assert np.allclose(model.reconstruct(model.scores), shapes)
    assert np.allclose(model.reconstruct(model.project(shapes[1])), shapes[1])
    assert np.allclose(model.reconstruct([]), model.mean)
    assert np.allclose(model.scores.var(axis=0, ddof=1), model.variances)


def test_samples_have_the_variance_of_the_model():
    shapes, *_ = planted()
    model = shape_model(shapes)
    drawn = model.sample(4000, seed=1)
    scores = np.tensordot(drawn - model.mean, model.modes, axes=([1, 2], [1, 2]))
    assert scores.var(axis=0) == pytest.approx(model.variances, rel=0.1)
    assert np.array_equal(drawn, model.sample(4000, seed=1))
    assert np.allclose(model.sample(3, n_modes=0), model.mean)


def test_measures_of_a_model_of_one_mode():
    line = RNG.standard_normal((1, 20, 3))
    direction = RNG.standard_normal((20, 3))
    scores = np.array([-3.0, -1.0, 0.0, 1.0, 3.0])
    found = measure_model(shape_model(line + scores[:, None, None] * direction), n_samples=50)
    assert found.compactness == pytest.approx([0.0, 1.0])
    unit = np.linalg.norm(direction, axis=1).mean()
    others = (scores.sum() - scores) / 4
    assert found.generalization[0] == pytest.approx(np.abs(scores - others) * unit)
    # All random shapes without a mode are the mean, which is one of the shapes.
    assert found.specificity[0] == pytest.approx(0.0, abs=1e-12)
    assert 0.0 < found.specificity[1].mean() < scores.std(ddof=1) * unit


def test_more_modes_generalize_better():
    shapes, *_ = planted(k=12, deviations=(4.0, 2.0, 1.0))
    noisy = shapes + 0.01 * RNG.standard_normal(shapes.shape)
    found = measure_model(shape_model(noisy), n_samples=200)
    means = found.generalization.mean(axis=1)
    assert (np.diff(means) < 1e-6).all()
    assert means[3] < 0.03 < 0.1 < means[2]  # three modes are what there is, the rest is noise
    assert (np.diff(found.specificity[1:4].mean(axis=1)) > 0).all()  # with none it is the mean


@pytest.mark.parametrize("call", [
    lambda model: model.reconstruct(np.zeros(99)),
    lambda model: model.project(np.zeros((2, 3))),
    lambda model: shape_model(np.zeros((1, 4, 3))),
    lambda model: measure_model(shape_model(np.eye(6).reshape(2, 6, 3))),
])  # fmt: skip
def test_what_does_not_fit_is_refused(call):
    with pytest.raises(ArrayError):
        call(shape_model(planted()[0]))


def test_numbers_out_of_range():
    model = shape_model(planted()[0])
    for call in (
        lambda: model.sample(0),
        lambda: model.sample(n_modes=9),
        lambda: measure_model(model, n_samples=0),
        lambda: measure_model("model"),
    ):
        with pytest.raises(OptionError):
            call()
