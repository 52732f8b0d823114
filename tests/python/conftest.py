"""Fixtures shared by all stages: the meshes on disk, skipped with a reason when absent."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from stretchmap.base import budget
from stretchmap.mesh.meshes import TetMesh, TriMesh

_ROOT = Path(__file__).resolve().parents[2]
_MESHES = Path(os.environ.get("STRETCHMAP_MESHES", _ROOT.parent / "shared" / "meshes"))


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """All tests share up to four processors; a few named ones are there sooner without."""
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    if not (whole and config.pluginmanager.hasplugin("xdist")) or hasattr(config, "workerinput"):
        return
    option = config.option
    if (
        option.numprocesses is None
        and option.dist == "no"
        and not (option.usepdb or option.collectonly)
    ):
        option.numprocesses = min(4, _processors())
        option.dist = "worksteal"  # tests of a file stay together, and with them what they share


def _need(path: Path) -> Path:
    if not path.exists():
        pytest.skip(f"{path} is not there; set STRETCHMAP_MESHES to the folder of test meshes")
    return path


@lru_cache(maxsize=8)
def _solid(name: str) -> TetMesh:
    with np.load(_MESHES / "tets" / f"{name}.npz") as data:
        return TetMesh(data["V"], data["T"])


@lru_cache(maxsize=8)
def _surface(name: str) -> TriMesh:
    """Read the one layout the test surfaces have: binary little-endian PLY of doubles."""
    raw = (_MESHES / "surfaces" / f"{name}.ply").read_bytes()
    header, _, body = raw.partition(b"end_header\n")
    counts = {
        words[1]: int(words[2])
        for words in (line.split() for line in header.decode().splitlines())
        if words[:1] == ["element"]
    }
    n, m = counts["vertex"], counts["face"]
    face = np.dtype([("count", "u1"), ("ids", "<i4", 3)])
    points = np.frombuffer(body, "<f8", 3 * n).reshape(n, 3)
    return TriMesh(points, np.frombuffer(body, face, m, offset=24 * n)["ids"])


def _entries() -> set[Path]:
    """What lies in the checkout and where the tests were started, but for builds and caches."""
    folders = {_ROOT, _ROOT / "tests" / "python", Path.cwd()}
    found = (path for folder in folders for path in folder.iterdir())
    return {path for path in found if path.name[0] != "." and path.name != "build"}


@pytest.fixture(scope="session", autouse=True)
def nothing_is_left_behind() -> Iterator[None]:
    """Tests, and what they call, write to folders of their own."""
    before = _entries()
    yield
    left = sorted(map(str, _entries() - before))
    assert not left, f"left behind by a test: {', '.join(left)}"


@pytest.fixture(scope="session", autouse=True)
def limits_are_those_of_a_plain_build() -> Iterator[None]:
    """Limits of processor time times ``STRETCHMAP_SLOWDOWN``, of a build that is so much slower,
    so that its maps end where those of a plain build do."""
    slowdown = float(os.environ.get("STRETCHMAP_SLOWDOWN", "1"))
    with pytest.MonkeyPatch.context() as patch:
        for name in ("_LEAST_SECONDS", "_MARGIN"):
            patch.setattr(budget, name, slowdown * getattr(budget, name))
        yield


@pytest.fixture(scope="session")
def mesh_dir() -> Path:
    """Folder with ``surfaces`` and ``tets``; skips when there is none."""
    return _need(_MESHES)


@pytest.fixture(scope="session")
def load_surface() -> Callable[[str], TriMesh]:
    """Return a loader of ``surfaces/NAME.ply``; skips when the file is absent."""

    def load(name: str) -> TriMesh:
        _need(_MESHES / "surfaces" / f"{name}.ply")
        return _surface(name)

    return load


@pytest.fixture(scope="session")
def load_solid() -> Callable[[str], TetMesh]:
    """Return a loader of ``tets/NAME.npz``; skips when the file is absent."""

    def load(name: str) -> TetMesh:
        _need(_MESHES / "tets" / f"{name}.npz")
        return _solid(name)

    return load
