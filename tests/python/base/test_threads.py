"""The number of threads: what it changes (nothing) and where it is put back."""

import threading

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import _core, errors, samples


@pytest.fixture(scope="module")
def solid():
    # Large enough that the loops are split and multigrid solves the systems.
    return samples.bumpy_torus(40000)


def history(result):
    return [(r.stage, r.energy, r.flips, r.residual) for r in result.history]


@pytest.mark.parametrize(
    "options", [{"c": 10.0, "max_iter": 4}, {"max_iter": 3}], ids=["vsem", "certified"]
)
def test_maps_are_the_same_to_the_last_bit(solid, options):
    one, two, three = (sm.volume_map(solid, threads=n, **options) for n in (1, 2, 3))
    for other in (two, three):
        assert np.array_equal(one.image, other.image)
        np.testing.assert_equal(history(one), history(other))


def test_the_number_is_put_back(solid):
    before = _core.base.thread_count()
    with sm.threads(before + 1):
        assert _core.base.thread_count() == before + 1
        with sm.threads(None):
            assert _core.base.thread_count() == before + 1
        with pytest.raises(errors.OptionError):
            sm.area_map(solid.surface, threads=before + 2, max_iter=-1)
        assert _core.base.thread_count() == before + 1
    assert _core.base.thread_count() == before


def test_map_functions_set_it_while_they_run():
    seen = []
    surface = samples.bumpy_torus(2000).surface
    sm.area_map(surface, threads=3, progress=lambda *a, **k: seen.append(_core.base.thread_count()))
    assert set(seen) == {3}
    solid = samples.solid_torus(600)
    sm.register(
        solid, solid, threads=2, progress=lambda *a, **k: seen.append(_core.base.thread_count())
    )
    assert set(seen) == {2, 3}


def test_other_python_threads_keep_theirs():
    seen = []
    before = _core.base.thread_count()
    with sm.threads(before + 1):
        worker = threading.Thread(target=lambda: seen.append(_core.base.thread_count()))
        worker.start()
        worker.join()
    assert seen == [before]


@pytest.mark.parametrize("count", [0, -1, 1.5, "2", 5000])
def test_nonsense_is_refused(count):
    with pytest.raises(errors.OptionError), sm.threads(count):
        pass
