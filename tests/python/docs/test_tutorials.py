"""Every tutorial runs as the notebook that readers download, and shows what it makes."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
TUTORIALS = sorted((ROOT / "tutorials").glob("[0-9]*.py"))


def test_there_are_three():
    assert [path.stem[3:] for path in TUTORIALS] == [
        "folder_of_bones", "gmsh_part", "own_method",
    ]  # fmt: skip


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda p: p.stem)
def test_tutorial_as_a_notebook(path, tmp_path, monkeypatch):
    notebooks = pytest.importorskip("sphinx_gallery.notebook")
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    pytest.importorskip("meshio")
    pytest.importorskip("matplotlib")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
    script = Path(shutil.copy(path, tmp_path))
    notebooks.python_to_jupyter_cli([str(script)])
    notebook = nbformat.read(script.with_suffix(".ipynb"), as_version=4)
    client = nbclient.NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()  # raises where a cell does
    outputs = [out for cell in notebook.cells for out in cell.get("outputs", ())]
    shown = {kind for out in outputs for kind in out.get("data", ())}
    assert "image/png" in shown
    assert sum(out.output_type == "stream" for out in outputs) >= 3
    assert sum(cell.cell_type == "markdown" for cell in notebook.cells) >= 5
