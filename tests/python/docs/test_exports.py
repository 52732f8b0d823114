"""The names of the package: the same for type checkers and at run time, and quickly there."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import stretchmap


def static_names(source: str) -> dict[str, str]:
    """Name -> module, of everything imported for type checkers only."""
    (block,) = (
        node
        for node in ast.parse(source).body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    return {
        alias.asname: node.module or ""
        for node in block.body
        for alias in node.names
        if alias.asname
    }


def test_type_checkers_see_what_is_loaded_on_first_use():
    static = static_names(Path(stretchmap.__file__).read_text(encoding="utf-8"))
    assert static == stretchmap._EXPORTS | dict.fromkeys(stretchmap._ROOMS, "")
    assert set(stretchmap.__all__) == {"__version__", *static}


def test_a_name_only_one_of_them_has_is_seen():
    source = "if TYPE_CHECKING:\n    from .area.map import area_map as area_map\n"
    assert static_names(source) == {"area_map": "area.map"} != stretchmap._EXPORTS


@pytest.mark.parametrize("name", stretchmap.__all__)
def test_every_name_is_there_and_from_where_it_says(name):
    found = getattr(stretchmap, name)
    if name in stretchmap._EXPORTS:
        assert found.__module__ == f"stretchmap.{stretchmap._EXPORTS[name]}"


def test_files_are_read_by_a_process_that_has_done_nothing_else():
    code = "import stretchmap as sm; sm.io.read_arrays"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


def test_other_names_are_errors():
    with pytest.raises(AttributeError, match="volum_map"):
        _ = stretchmap.volum_map


def test_importing_takes_a_twentieth_of_a_second():
    code = "import time; t = time.process_time(); import stretchmap; print(time.process_time() - t)"
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        for _ in range(5)
    ]
    assert min(float(run.stdout) for run in runs) < 0.05
