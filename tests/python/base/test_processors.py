"""How many processors there are: of a container no more than it may take time of."""

from __future__ import annotations

import os
import sys

import pytest

from stretchmap import _core
from stretchmap.population.executors import Processes

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="control groups are Linux's")


@pytest.fixture
def allowed():
    return len(os.sched_getaffinity(0))


@pytest.mark.parametrize(
    ("text", "count"),
    [("50000 100000\n", 1), ("100000 100000\n", 1), ("150000 100000\n", 2), ("max 100000\n", 10**6),
     ("99999999 1\n", 10**6), ("0 100000\n", 10**6), ("", 10**6)],
)  # fmt: skip
def test_a_quota_is_rounded_up(tmp_path, allowed, text, count):
    (tmp_path / "cpu.max").write_text(text)
    assert _core.base.processors(str(tmp_path)) == min(count, allowed)


@pytest.mark.parametrize(("quota", "count"), [(50_000, 1), (-1, 10**6)])
def test_of_older_systems_too(tmp_path, allowed, quota, count):
    folder = tmp_path / "cpu"
    folder.mkdir()
    (folder / "cpu.cfs_quota_us").write_text(f"{quota}\n")
    (folder / "cpu.cfs_period_us").write_text("100000\n")
    assert _core.base.processors(str(tmp_path)) == min(count, allowed)


def test_where_nobody_says_all_count(tmp_path, allowed):
    assert _core.base.processors(str(tmp_path)) == allowed
    assert 1 <= Processes().workers == _core.base.processors() <= allowed
