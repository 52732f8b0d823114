"""What compilers for other processors see of the kernels made for some."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SOURCES = Path(__file__).resolve().parents[3] / "cpp" / "src"


@pytest.mark.parametrize("kernel", sorted(SOURCES.rglob("*_avx*.cpp")), ids=lambda path: path.stem)
def test_a_kernel_for_wider_processors_compiles_without_them(kernel):
    compiler = shutil.which(os.environ.get("CXX", "c++"))
    if compiler is None:
        pytest.skip("no compiler")
    includes = (f"-I{SOURCES}", f"-I{SOURCES.parent / 'include'}")
    run = subprocess.run(
        [compiler, "-std=c++17", "-fsyntax-only", *includes, str(kernel)],
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
