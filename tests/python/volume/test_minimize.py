"""Steps of the minimization of volume distortion, and when it is at rest."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stretchmap.volume.minimize import minimize
from stretchmap.volume.options import FillOptions


def steps(*lengths_and_promises):
    """Steps that gain next to nothing."""
    report = SimpleNamespace(energy=1e4, flips=0, folds=0)
    for alpha, decrement in lengths_and_promises:
        yield SimpleNamespace(
            before=report, after=report, alpha=alpha, decrement=decrement, negative_curvature=False
        )


@pytest.mark.parametrize(
    ("promises", "records"),
    [
        ([(1.0, 1e-9)], 1),
        ([(1e-5, 1e3), (1.0, 1e-9), (1e-5, 1e3)] + [(1.0, 1e-9)] * 5, 8),
    ],
)
def test_a_small_promise_after_a_large_one_that_was_not_kept_is_no_rest(promises, records):
    """Of a gradient that one flat tet fills, a solver sees nothing else: it promises nothing."""
    given = steps(*promises)
    newton = SimpleNamespace(set_targets=lambda _: None, step=lambda x, *_: (x, next(given)))
    options = FillOptions(shared=1)
    model = SimpleNamespace(
        options=options,
        newton=lambda x, glide: newton,
        targets=np.ones(1),
        T=np.zeros((1, 4), np.int32),
    )
    kept = []
    history = SimpleNamespace(
        budget=SimpleNamespace(spent=False), add=lambda *_, **__: kept.append(1)
    )
    goal = options.volume_weight
    done = minimize(model, np.zeros((4, 3)), history, glide=False, start=goal, goal=goal)
    assert done.converged and len(kept) == records
