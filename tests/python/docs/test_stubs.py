"""The stubs in python/stretchmap/_core describe the compiled module.

They are written by `python -m pybind11_stubgen stretchmap._core -o python`; how a type is spelt
depends on pybind11's version, so names, members and arguments are compared.
"""

from __future__ import annotations

import ast
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

import stretchmap

PACKAGE = Path(stretchmap.__file__).parent
STUBS = PACKAGE / "_core"


def declared(path: Path) -> set[str]:
    """`Class.member(argument, ...)` for everything a stub declares."""
    names = set()

    def visit(node: ast.Module | ast.ClassDef, prefix: str) -> None:
        for item in node.body:
            if isinstance(item, ast.ClassDef):
                names.add(prefix + item.name)
                visit(item, f"{prefix}{item.name}.")
            elif isinstance(item, ast.FunctionDef):
                names.add(f"{prefix}{item.name}({', '.join(a.arg for a in item.args.args)})")

    visit(ast.parse(path.read_text(encoding="utf-8")), "")
    return names


@pytest.fixture(scope="module")
def generated(tmp_path_factory):
    if importlib.util.find_spec("pybind11_stubgen") is None:
        pytest.skip("pybind11-stubgen is not installed")
    folder = tmp_path_factory.mktemp("stubs")
    command = [sys.executable, "-m", "pybind11_stubgen", "stretchmap._core", "-o", str(folder)]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return folder / "stretchmap" / "_core"


def test_there_is_one_stub_per_room(generated):
    assert {p.name for p in STUBS.glob("*.pyi")} == {p.name for p in generated.glob("*.pyi")}


def test_the_stubs_declare_what_is_compiled(generated):
    for path in sorted(generated.glob("*.pyi")):
        assert declared(STUBS / path.name) == declared(path), path.name


def test_a_stub_that_misses_an_argument_is_seen(tmp_path):
    path = tmp_path / "mesh.pyi"
    path.write_text("def f(points, tets): ...")
    (tmp_path / "other.pyi").write_text("def f(points): ...")
    assert declared(path) != declared(tmp_path / "other.pyi")
