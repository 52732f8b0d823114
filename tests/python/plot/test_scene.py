"""Scenes by PyVista; drawn in processes of their own, since a missing OpenGL aborts the process."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

import stretchmap as sm
from stretchmap import samples
from stretchmap.errors import ArrayError, FileFormatError, MissingDependencyError, OptionError
from stretchmap.plot import scene

ENV = {**os.environ, "PYTHONPATH": str(Path(sm.__file__).parents[1])}


@pytest.fixture(scope="module")
def area():
    return sm.area_map(samples.bumpy_torus(1500).surface, finish="none")


_IMPORTS = (
    "import stretchmap as sm\nfrom stretchmap import samples\nfrom stretchmap.plot import scene"
)


def run(code, folder):
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, env=ENV
    )


@pytest.fixture(scope="module")
def can_draw(tmp_path_factory):
    pytest.importorskip("pyvista")
    probe = "import pyvista; pyvista.Plotter(off_screen=True).screenshot('probe.png')"
    if run(probe, tmp_path_factory.mktemp("probe")).returncode:
        pytest.skip("PyVista cannot draw here")


def drawn(body, folder):
    """Run Python code that saves a scene as x.png."""
    done = run(f"{_IMPORTS}\n{body}", folder)
    assert done.returncode == 0, done.stderr
    return (folder / "x.png").read_bytes()


def test_a_cut_is_drawn(tmp_path, can_draw):
    picture = drawn(
        "m = sm.volume_map(samples.bumpy_torus(1500), c=1, max_iter=1)\n"
        "scene.save(scene.cut(m, 'ratio'), 'x.png')",
        tmp_path,
    )
    assert picture.startswith(b"\x89PNG") and len(picture) > 10_000


def test_loops_are_drawn(tmp_path, can_draw):
    """Of a sphere, which has none, the surface; a scene that is closed is no picture any more."""
    picture = drawn(
        "scene.save(scene.loops(samples.double_torus(1)), 'x.png')\n"
        "closed = scene.loops(samples.sphere(1))\n"
        "scene.save(closed, 'sphere.png')\n"
        "try:\n    scene.save(closed, 'again.png')\n"
        "except sm.errors.OptionError as error:\n    assert 'make it anew' in str(error)",
        tmp_path,
    )
    assert picture.startswith(b"\x89PNG") and len(picture) > 10_000
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sphere.png", "x.png"]


def test_what_is_no_scene_is_refused():
    pytest.importorskip("pyvista")
    for call in (lambda: scene.save(None, "x.png"), lambda: scene.widget(None)):
        with pytest.raises(OptionError, match="plotter must be a Plotter"):
            call()


def test_wrong_requests_are_refused(area, monkeypatch):
    with pytest.raises(ArrayError, match="solid"):
        scene.cut(area)
    solid = sm.volume_map(samples.bumpy_torus(1500), c=1, max_iter=0)
    with pytest.raises(OptionError, match="'coordinate' or 'ratio'"):
        scene.cut(solid, "red")
    with pytest.raises(FileFormatError, match=r"\.png"):
        scene.save(None, "x.jpg")
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingDependencyError, match=r"stretchmap\[viz\]"):
        scene.cut(solid)


def test_a_notebook_shows_a_scene(can_draw):
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    cell = f"{_IMPORTS}\nscene.widget(scene.loops(samples.double_torus(1)))"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell)])
    nbclient.NotebookClient(notebook, timeout=60).execute()
    (shown,) = (out.data for out in notebook.cells[0].outputs if "data" in out)
    turnable = all(map(importlib.util.find_spec, ("trame", "trame_vtk", "ipywidgets")))
    if not turnable:
        assert "image/png" in shown
        return
    state = notebook.metadata.widgets["application/vnd.jupyter.widget-state+json"]["state"]
    model = shown["application/vnd.jupyter.widget-view+json"]["model_id"]
    page = state[model]["state"]["value"]  # the whole scene: it needs no server
    assert page.startswith("<iframe srcdoc=") and "vtk" in page


def test_elsewhere_a_widget_is_refused(tmp_path, can_draw):
    drawn(
        "try:\n    scene.widget(scene.loops(samples.double_torus(1)))\n"
        "except sm.errors.OptionError as error:\n    assert 'notebooks' in str(error)\n"
        "    scene.save(scene.loops(samples.double_torus(1)), 'x.png')",
        tmp_path,
    )
