"""Filling ends in time, and with the call."""

from __future__ import annotations

import time

import pytest

pytest.importorskip("gpytoolbox", reason="remeshing needs gpytoolbox")
pytest.importorskip("pytetwild", reason="fills here")

import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import SolverError
from stretchmap.preparation import wild


def test_a_filling_that_takes_too_long_is_ended(monkeypatch):
    monkeypatch.setattr(wild, "_SCRIPT", "import time; time.sleep(300)")
    monkeypatch.setattr(wild, "_SECONDS", 0.2)
    monkeypatch.setattr(wild, "_SECONDS_PER_FACE", 1e-3)
    start = time.perf_counter()
    with pytest.raises(SolverError, match=r"after 1 seconds; .*fewer faces.* tetgen"):
        sm.prepare(samples.torus_surface(40, 20), faces=800, filler="ftetwild")
    assert time.perf_counter() - start < 60.0
