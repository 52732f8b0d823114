"""The examples in the docstrings run and show what they say; every public name has one."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
from collections.abc import Iterator
from types import ModuleType

import pytest

import stretchmap
from computed_once import computed_once
from stretchmap.deformation import pose

OPTIONAL = {"plot": ("matplotlib",), "cli": ("typer",), "preparation": ("gpytoolbox", "tetgen")}


def modules() -> list[str]:
    found = pkgutil.walk_packages(stretchmap.__path__, "stretchmap.")
    return sorted(i.name for i in found if "_core" not in i.name and "__main__" not in i.name)


def load(name: str) -> ModuleType:
    for room, packages in OPTIONAL.items():
        if name.startswith(f"stretchmap.{room}"):
            for package in packages:
                pytest.importorskip(package)
    return importlib.import_module(name)


@pytest.fixture(scope="module", autouse=True)
def examples_share_what_they_start_from() -> Iterator[None]:
    """Results do not change, so that the same call of many examples needs to be made only once."""
    with pytest.MonkeyPatch.context() as patch:
        for room, name in (
            (stretchmap, "volume_map"),
            (stretchmap, "register"),
            (stretchmap.population, "fit"),
            (pose, "_ranked"),
            (stretchmap.samples, "vertebra_population"),
        ):
            patch.setattr(room, name, computed_once(getattr(room, name)))
        yield


@pytest.mark.parametrize("name", modules())
def test_examples(name):
    finder = doctest.DocTestFinder(exclude_empty=True)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    text: list[str] = []
    module = load(name)
    for example in finder.find(module, name):
        runner.run(example, out=text.append)
    assert not runner.failures, "".join(text)
