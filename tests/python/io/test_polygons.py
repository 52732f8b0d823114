"""Polygons are split into triangles without a new point, and the log says how many."""

from __future__ import annotations

import logging
import time

import numpy as np
import pytest

import shapes
import stretchmap as sm
from stretchmap.errors import FileFormatError
from stretchmap.io import read, read_arrays


def quads() -> tuple[np.ndarray, np.ndarray]:
    """A torus of quads, 12 round the axis and 8 round the tube."""
    n, m = 12, 8
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    points = sm.Torus(3.0, 1.0).xi(u.ravel(), v.ravel())
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b = (i + 1) % n, (j + 1) % m
    return points, np.stack([i * m + j, a * m + j, a * m + b, i * m + b], axis=1)


def obj(points: np.ndarray, faces: list[list[int]]) -> str:
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    return "\n".join([*rows, *("f " + " ".join(str(i + 1) for i in f) for f in faces)]) + "\n"


def off(points: np.ndarray, faces: list[list[int]]) -> str:
    rows = [f"\n\nOFF\n\n{len(points)} {len(faces)} 0"]
    rows += [f"{x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    return "\n".join([*rows, *(" ".join(map(str, [len(f), *f])) for f in faces)]) + "\n"


@pytest.mark.parametrize(("suffix", "text"), [(".obj", obj), (".off", off)])
def test_quads_become_triangles(suffix, text, tmp_path, caplog):
    points, faces = quads()
    path = tmp_path / f"torus{suffix}"
    path.write_text(text(points, faces.tolist()))
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        mesh = read(path)
    assert "96 polygons were split into 192 triangles" in caplog.text
    np.testing.assert_array_equal(mesh.V, points)
    np.testing.assert_array_equal(mesh.F[::2], faces[:, [0, 1, 2]])
    np.testing.assert_array_equal(mesh.F[1::2], faces[:, [0, 2, 3]])
    mesh.require_genus_one()


@pytest.mark.parametrize(("suffix", "text"), [(".obj", obj), (".off", off)])
def test_faces_of_several_sizes(suffix, text, tmp_path):
    path = tmp_path / f"mixed{suffix}"
    path.write_text(text(np.eye(5, 3), [[0, 1, 2], [0, 1, 2, 3, 4], [4, 3, 2, 1]]))
    wanted = [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 2], [4, 2, 1]]
    np.testing.assert_array_equal(read_arrays(path).F, wanted)
    path.write_text(text(np.eye(5, 3), [[0, 1, 2], [3, 4]]))
    with pytest.raises(FileFormatError):
        read(path)


def test_texture_of_polygons_and_texture_that_points_nowhere(tmp_path, caplog):
    path = tmp_path / "t.obj"
    head = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    path.write_text(head + "f 1/1 2/2 3/3 4/4 # quad\n")
    found = read_arrays(path)
    np.testing.assert_array_equal(found.F, [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(found.corner_uv[1], [[0, 0], [1, 1], [0, 1]])
    path.write_text(head + "f 1/1 2/2 3/9\n")
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        found = read_arrays(path)
    assert found.corner_uv is None and "texture left out" in caplog.text


def test_triangles_are_read_as_before(tmp_path, caplog):
    points, faces = shapes.torus()
    path = tmp_path / "t.off"
    path.write_text(off(points, faces.tolist()))
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        np.testing.assert_array_equal(read(path).F, faces)
    assert not caplog.text


def test_a_text_stl_of_blank_lines_is_read_at_once(tmp_path):
    """200 kB of blank lines took minutes while the pattern could begin at each of them."""
    path = tmp_path / "t.stl"
    path.write_text("solid t\n" + "\n" * 200_000 + "endsolid t\n")
    before = time.process_time()
    with pytest.raises(FileFormatError):
        read(path)
    assert time.process_time() - before < 2.0
