"""The API reference has every function and class that users import."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import stretchmap

DOCS = Path(__file__).resolve().parents[3] / "docs"
ROOMS = ("", *(f".{room}" for room in stretchmap._ROOMS), ".plot.populations", ".plot.scene")


def listed(text: str) -> Iterator[Any]:
    """The objects of all autosummaries of a page."""
    module = None
    for line in text.splitlines():
        if found := re.match(r"\.\. (currentmodule|automodule):: (\S+)", line):
            module = importlib.import_module(found[2])
            if found[1] == "automodule":
                yield from vars(module).values()
        elif found := re.fullmatch(r"   ([A-Za-z_]\w*)", line):
            yield getattr(module, found[1])


def missing(text: str) -> list[str]:
    """Public functions and classes of all rooms that a page leaves out."""
    shown = {id(thing) for thing in listed(text)}
    return [
        f"{module.__name__}.{name}"
        for module in (importlib.import_module(f"stretchmap{room}") for room in ROOMS)
        for name in getattr(module, "__all__", ())
        if (inspect.isroutine(thing := getattr(module, name)) or inspect.isclass(thing))
        and id(thing) not in shown
    ]


def test_everything_public_is_in_the_reference():
    pytest.importorskip("matplotlib")
    assert missing((DOCS / "api.md").read_text(encoding="utf-8")) == []


def test_a_name_left_out_is_seen():
    pytest.importorskip("matplotlib")
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    assert missing(text.replace("   volume_map\n", "")) == ["stretchmap.volume_map"]
