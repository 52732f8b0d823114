"""The style of the sources, by the tools that define it."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("arguments", [("check",), ("format", "--check")])
def test_python_is_clean(arguments):
    if importlib.util.find_spec("ruff") is None:
        pytest.skip("ruff is not installed")
    run = subprocess.run(
        [sys.executable, "-m", "ruff", *arguments, "."], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout + run.stderr


def test_cpp_is_formatted():
    beside = Path(sys.executable).with_name("clang-format")
    tool = str(beside) if beside.exists() else shutil.which("clang-format")
    if tool is None:
        pytest.skip("clang-format is not installed")
    sources = [
        str(path)
        for folder in ("cpp", "bench", "tests/cpp")
        for path in sorted((ROOT / folder).rglob("*"))
        if path.suffix in (".hpp", ".cpp")
    ]
    run = subprocess.run([tool, "--dry-run", "-Werror", *sources], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[:4000]
