"""Memory that is free goes back to the system."""

from __future__ import annotations

import platform
from pathlib import Path

import numpy as np
import pytest

from stretchmap import _core

STATUS = Path("/proc/self/statm")


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc gives memory back")
@pytest.mark.skipif(not STATUS.exists(), reason="no /proc to read the resident size from")
def test_free_memory_is_given_back() -> None:
    def resident() -> int:
        return int(STATUS.read_text().split()[1]) * 4096

    pieces = [np.ones(200) for _ in range(60_000)]  # each too small for pages of its own
    last = pieces[-1]  # stands in the way of all before it
    before = resident()
    del pieces
    kept = resident()
    _core.base.give_free_memory_back()
    assert before - kept < 20e6 < kept - resident()
    assert last.sum() == 200.0
