"""Odd but legal files are read; every one is a cube."""

from __future__ import annotations

import logging

import numpy as np
import pytest

import corpus
import corpus_cube
from stretchmap.errors import FileFormatError
from stretchmap.io import read, read_arrays

CASES = corpus.cases()


@pytest.mark.parametrize("case", CASES, ids=[f"{c.suffix} {c.name}" for c in CASES])
def test_a_cube_is_read(case, tmp_path, caplog):
    path = tmp_path / f"cube{case.suffix}"
    path.write_bytes(case.data)
    with caplog.at_level(logging.WARNING, logger="stretchmap"):
        mesh = read(path)
    assert corpus.is_cube(mesh.V, mesh.F)
    if case.suffix != ".stl":
        np.testing.assert_array_equal(mesh.V, corpus_cube.POINTS)
        wanted = {tuple(f) for f in corpus_cube.TRIANGLES}
        assert {tuple(f) for f in mesh.F.tolist()} == wanted
    assert (f"{case.split} polygons were split" in caplog.text) == (case.split > 0)


def test_data_of_a_polygon_goes_to_its_triangles(tmp_path):
    quads = next(c for c in CASES if c.name == "text, quads").data.decode()
    lines = quads.replace("end_header", "property int part\nend_header").splitlines()
    rows = [f"{line} {k}" for k, line in enumerate(lines[-6:])]
    path = tmp_path / "cube.ply"
    path.write_text("\n".join([*lines[:-6], *rows]))
    found = read_arrays(path)
    np.testing.assert_array_equal(found.cell_data["part"], np.repeat(np.arange(6), 2))


@pytest.mark.parametrize(
    ("suffix", "name", "change"),
    [
        (".off", "plain", (b"8 12 0", b"8 11 0")),
        (".off", "all in one line", (b"8 12 0", b"8 11 0")),
        (".off", "plain", (b"8 12 0", b"8 13 0")),
        (".ply", "text", (b"face 12", b"face 11")),
        (".ply", "little endian", (b"face 12", b"face 11")),
        (".ply", "little endian, quads and triangles", (b"face 9", b"face 8")),
        (".ply", "big endian", (b"vertex 8", b"vertex 9")),
        (".stl", "binary", (b"\x0c\0\0\0", b"\x0b\0\0\0")),
        (".stl", "text", (b"    vertex 0.000000e+00 0.000000e+00 0.000000e+00\n", b"")),
        (".obj", "negative indices between vertices", (b"f -4 ", b"f -5 ")),
    ],
)
def test_counts_that_are_wrong_are_refused(suffix, name, change, tmp_path):
    data = next(c.data for c in CASES if (c.suffix, c.name) == (suffix, name))
    assert change[0] in data
    path = tmp_path / f"cube{suffix}"
    path.write_bytes(data.replace(*change, 1))
    with pytest.raises(FileFormatError, match="cube"):
        read(path)
