"""Options that would do nothing are refused."""

from __future__ import annotations

import pytest

import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import OptionError


@pytest.fixture(scope="module")
def bumpy():
    return samples.bumpy_torus(600)


GLIDING = {"frozen_weight": 5.0, "face_weight": 2.0, "glide_iter": 9, "glide_tol": 1e-3}
ON_MESH = {"glide_std": 0.1, "glide_distortion": 0.1}


@pytest.mark.parametrize(("name", "value"), [*GLIDING.items(), *ON_MESH.items()])
def test_options_of_a_boundary_that_glides_are_refused_where_none_does(bumpy, name, value):
    options = sm.VolumeOptions(**{name: value})
    with pytest.raises(OptionError, match=f"does not glide; leave {name} out"):
        sm.volume_map(bumpy, boundary="frozen", options=options)
    with pytest.raises(OptionError, match=f"does not glide; leave {name} out"):
        sm.fill(bumpy, bumpy.surface.V, options=sm.FillOptions(**{name: value}))
    with pytest.raises(OptionError, match=f"does not glide; leave {name} out"):
        sm.register(bumpy, bumpy, boundary="frozen", options=options)
    if name in ON_MESH:
        with pytest.raises(OptionError, match=f"only register takes {name}"):
            sm.volume_map(bumpy, options=options)


def test_what_exact_rings_may_cost_goes_with_them(bumpy):
    options = sm.VolumeOptions(exact_std_factor=2.0)
    with pytest.raises(OptionError, match="exact_std_factor goes with vertex_exact=True"):
        sm.volume_map(bumpy, options=options)


def test_the_torus_is_that_of_the_start():
    solid = samples.bumpy_torus(600)
    start = sm.area_map(solid.surface, finish="none")
    for name, value in (("ratio", 4.0), ("ratio", "conformal"), ("phase", 0.1)):
        options = sm.VolumeOptions(**{name: value})
        for more in ({}, {"c": 1.0}, {"optimizer": lambda solid, image, torus: image}):
            with pytest.raises(OptionError, match=f"of start; leave {name} out"):
                sm.volume_map(solid, start=start, options=options, **more)
