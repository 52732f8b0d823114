"""Types: the package checked strictly, and what a user's own checker sees of it."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import stretchmap

ROOT = Path(__file__).resolve().parents[3]
SCRIPT = Path(__file__).with_name("user_script.py")
# Line of the script -> the same with a mistake.
MISTAKES = {
    'sm.read_solid("part.msh", compact=True)': 'sm.read_solid("part.msh", compct=True)',
    "surface = solid.surface": "surface = solid.boundary",
    'ratio="search", glide_iter': 'ratio="serach", glide_iter',
    "glide_iter=20": "glide_iters=20",
    'boundary="glide"': 'boundary="gliding"',
    "sm.FillOptions(refine=False)": "sm.FillOptions(vertex_exact=False)",
    "result.distortion.ring_std": "result.distortion.ring_sd",
    "(result.torus.R, result.torus.r)": "(result.torus.R, result.radius)",
    "result.certificate.certified": "result.certificate.ok",
    "else result.refinement.n_split": "else result.refinement.n_splits",
    'sm.area_map(surface, finish="ring"': 'sm.area_map(surface, finish="rings"',
    'weights="clamped"': 'weights="cotan"',
    "sm.homology_basis(surface, solid)": "sm.homology_basis(solid, solid)",
    '[0.2, 0.8], by="u"': '[0.2, 0.8], by="w"',
    'by=("s", "v")': 'by=("s", "z")',
    "sm.register(solid, sm.samples.bumpy_torus": "sm.register(solid, sm.samples.torus_surface",
    'landmark_map="affine"': 'landmark_map="afine"',
    'per="tet"': 'per="cell"',
    'sm.load_map("map.npz")': 'sm.loadmap("map.npz")',
    "record.ring_std for record": "record.spread for record",
    "with sm.threads(1)": 'with sm.threads("all")',
    '"levels", by="s"': '"level", by="s"',
    "surface.require_genus_one()": "surface.require_solid_torus()",
    "sm.errors.GenusError": "sm.errors.GenusErrors",
    "**values: float) -> None": "values: float) -> None",
}
# Large packages that need not be there: to check them takes longer than all else.
OTHERS = """[mypy]
[mypy-distributed.*,IPython.*,matplotlib.*,pyvista.*,rich.*]
follow_imports = skip
follow_imports_for_stubs = True
"""


def mypy(*arguments: str) -> subprocess.CompletedProcess[str]:
    if importlib.util.find_spec("mypy") is None:
        pytest.skip("mypy is not installed")
    package = Path(stretchmap.__file__).parents[1]
    path = {} if "site-packages" in package.parts else {"MYPYPATH": str(package)}
    return subprocess.run(
        [sys.executable, "-m", "mypy", *arguments],
        cwd=ROOT, env={**os.environ, **path}, capture_output=True, text=True, check=False,
    )  # fmt: skip


def at_fault(config: Path, *scripts: Path) -> set[str]:
    """Names of the scripts that mypy finds fault with."""
    config.write_text(OTHERS, encoding="utf-8")
    options = ("--strict", f"--config-file={config}", "--follow-imports=silent")
    run = mypy(*options, *map(str, scripts))
    assert run.returncode in (0, 1), run.stdout + run.stderr
    return set(re.findall(r"([^/\s]+)\.py:\d+: error:", run.stdout))


def test_the_package_is_typed_strictly():
    run = mypy()
    assert run.returncode == 0, run.stdout + run.stderr


def test_a_users_script_is_clean_and_every_mistake_in_it_is_found(tmp_path):
    text = SCRIPT.read_text(encoding="utf-8")
    scripts = [SCRIPT]
    for k, (right, wrong) in enumerate(MISTAKES.items()):
        assert text.count(right) == 1, right
        scripts.append(tmp_path / f"mistake_{k}.py")
        scripts[-1].write_text(text.replace(right, wrong), encoding="utf-8")
    found = at_fault(tmp_path / "mypy.ini", *scripts)
    assert SCRIPT.stem not in found
    missed = [wrong for k, wrong in enumerate(MISTAKES.values()) if f"mistake_{k}" not in found]
    assert not missed
