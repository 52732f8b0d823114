"""Docstrings of everything public: arguments, fields, what is returned and raised, an example."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import pytest

import stretchmap

ROOMS = (
    "energies",
    "samples",
    "io",
    "population",
    "plot",
    "plot.scene",
    "plot.report",
    "mesh.refinement",
    "mesh.overconstrained",
    "registration.suggest",
    "conformal.hodge",
    "plot.populations",
    "plot.population_report",
)


def public() -> Iterator[tuple[str, Any]]:
    """Functions and classes that users import, by the name under which they do."""
    pytest.importorskip("matplotlib")
    for name in stretchmap.__all__:
        found = getattr(stretchmap, name)
        if callable(found):
            yield name, found
    for room in ROOMS:
        module = importlib.import_module(f"stretchmap.{room}")
        for name in module.__all__:
            found = getattr(module, name)
            if inspect.isfunction(found) or inspect.isclass(found):
                yield f"{room}.{name}", found


def section(doc: str, title: str) -> str:
    """Text of one section of a NumPy docstring, empty without it."""
    found = re.search(rf"^{title}\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", doc, re.M | re.S)
    return found.group(1) if found else ""


def named(text: str) -> set[str]:
    """Names that a section on parameters or attributes explains."""
    heads = re.findall(r"^(\*{0,2}\w[\w, *]*?)(?: : .*)?$", text, re.M)
    return {name.strip(" *") for head in heads for name in head.split(",")}


def faults(name: str, thing: Any) -> list[str]:
    """What the docstring of a function or class lacks."""
    doc = inspect.getdoc(thing) or ""
    lacking = [] if doc else ["a docstring"]
    if ">>> " not in section(doc, "Examples") and not ancestor_is_error(thing):
        lacking.append("an example")
    if inspect.isclass(thing):
        if dataclasses.is_dataclass(thing):
            fields = {f.name for f in dataclasses.fields(thing) if f.name[0] != "_"}
            inherited = {
                f for base in thing.__mro__[1:] for f in getattr(base, "__annotations__", ())
            }
            lacking += [
                f"the field {f}" for f in fields - named(section(doc, "Attributes")) - inherited
            ]
        return [f"{name}: {fault}" for fault in lacking]
    signature = inspect.signature(thing)
    lacking += [
        f"the parameter {parameter}"
        for parameter in signature.parameters.keys() - named(section(doc, "Parameters"))
    ]
    if signature.return_annotation not in ("None", "Iterator[None]", None) and not section(
        doc, "Returns"
    ):
        lacking.append("what it returns")
    tree = ast.parse(textwrap.dedent(inspect.getsource(thing)))
    if any(isinstance(node, ast.Raise) for node in ast.walk(tree)) and not section(doc, "Raises"):
        lacking.append("what it raises")
    return [f"{name}: {fault}" for fault in lacking]


def ancestor_is_error(thing: Any) -> bool:
    return inspect.isclass(thing) and issubclass(thing, Exception)


def test_every_public_docstring_is_complete():
    missing = [fault for name, thing in public() for fault in faults(name, thing)]
    assert not missing, "\n".join(missing)


def test_methods_have_docstrings():
    for name, thing in public():
        if inspect.isclass(thing) and thing.__module__.startswith("stretchmap"):
            for method, found in vars(thing).items():
                if method[0] != "_" and (inspect.isfunction(found) or isinstance(found, property)):
                    assert inspect.getdoc(getattr(thing, method)), f"{name}.{method}"


def test_what_is_missing_is_seen():
    def area(x: int, y: int) -> int:
        """Area.

        Parameters
        ----------
        x : int
        """
        if x < 0:
            raise ValueError
        return x * y

    assert sorted(faults("area", area)) == [
        "area: an example", "area: the parameter y", "area: what it raises",
        "area: what it returns",
    ]  # fmt: skip
