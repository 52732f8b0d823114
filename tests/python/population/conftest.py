"""Poses, most of the time of a run, are searched once for each pair of surfaces."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from computed_once import computed_once
from stretchmap.deformation import pose


@pytest.fixture(scope="session", autouse=True)
def poses_are_searched_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pose, "_ranked", computed_once(pose._ranked))
        yield
