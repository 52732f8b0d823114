"""Several maps of one mesh side by side."""

from __future__ import annotations

import numpy as np
import pytest

import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import ArrayError, KindError, OptionError


@pytest.fixture(scope="module")
def solid():
    return samples.bumpy_torus(1500)


def test_maps_are_measured_alike_whoever_made_them(solid):
    certified = sm.volume_map(solid)
    crushed = solid.V.copy()
    crushed[0] = crushed[-1]
    found = sm.compare(
        solid,
        {"identity": solid.V, "crushed": crushed, "certified": certified},
    )
    assert list(found.distortion) == ["identity", "crushed", "certified"]
    assert found.distortion["identity"].ratios == pytest.approx(1.0)
    assert found.certificate["identity"].certified and found.certificate["certified"].certified
    assert found.distortion["crushed"].flips > 0
    assert not found.certificate["crushed"].certified
    assert found.distortion["certified"].ratio_min == certified.distortion.ratio_min


def test_the_table_has_a_row_per_map_and_aligned_columns(solid):
    found = sm.compare(solid, {"a": solid.V, "a longer name": 2.0 * solid.V})
    lines = found.summary().splitlines()
    assert len(lines) == 3 and "certified" in lines[0]
    assert [line.split()[-1] for line in lines[1:]] == ["1", "1"]
    assert found.to_dict()["a"]["certified"] is True


def test_surfaces_are_compared_too(solid):
    surface = solid.surface
    found = sm.compare(surface, {"identity": surface.V, "conformal": sm.conformal_map(surface)})
    assert found.certificate["conformal"].certified
    assert found.distortion["conformal"].angle_mean < 1.1


def test_what_cannot_be_compared_is_refused(solid):
    other = sm.conformal_map(samples.torus_surface(12, 8))
    with pytest.raises(OptionError, match="another mesh"):
        sm.compare(solid, {"other": other})
    with pytest.raises(OptionError, match="at least one"):
        sm.compare(solid, {})
    with pytest.raises(KindError):
        sm.compare("solid", {"a": np.zeros((3, 3))})
    with pytest.raises(OptionError, match="names, and 1 is not"):
        sm.compare(solid, {1: solid.V})
    with pytest.raises(ArrayError, match=r"images\['short'\] must have shape"):
        sm.compare(solid, {"good": solid.V, "short": solid.V[:3]})


def test_a_comparison_is_drawn(solid, tmp_path):
    pytest.importorskip("matplotlib")
    from stretchmap import plot

    found = sm.compare(solid, {"identity": solid.V, "doubled": 2.0 * solid.V})
    figure = plot.comparison(found)
    assert len(figure.axes) == 2
    plot.save(figure, tmp_path / "comparison.png")
    assert (tmp_path / "comparison.png").stat().st_size > 1000
