"""A folder to run commands in, unless a file has one of its own."""

from __future__ import annotations

import pytest

import stretchmap as sm
from stretchmap import samples


@pytest.fixture(scope="module")
def solid():
    return samples.bumpy_torus(2500)


@pytest.fixture
def folder(tmp_path, monkeypatch, solid):
    """A folder with a good solid and its surface, made the current one."""
    monkeypatch.chdir(tmp_path)
    sm.write("solid.npz", solid)
    sm.write("surface.ply", solid.surface)
    return tmp_path
