"""Map files, reports and records: what goes in comes out, and a failure leaves nothing behind."""

import dataclasses
import json
import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from stretchmap import TetMesh, Torus, certify, read, samples
from stretchmap.base.files import atomic_path
from stretchmap.base.tables import table
from stretchmap.certificate.findings import Certificate
from stretchmap.errors import FileFormatError, IndexRangeError, MeshError
from stretchmap.maps.files import load_map
from stretchmap.maps.history import IterationRecord
from stretchmap.maps.result import MapResult

REQUIRED = set(
    """
    n_vertices n_elements flips ring_mean ring_std element_error_mean element_std ratio_min
    ratio_max total_distortion energy iterations converged stop_reason seconds torus versions
    """.split()
)
TORUS = Torus(3.0, 1.0)
HISTORY = (
    IterationRecord("vsem", 0, energy=3.0, flips=2),
    IterationRecord("vsem", 1, energy=2.5, step=1.0, flips=0, seconds=0.25),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidMap(MapResult):
    _title = "volume map"

    certificate: Certificate

    def extra_arrays(self) -> dict[str, Any]:
        return {"height": self.mesh.V[:, 2]}

    def extra_scalars(self) -> dict[str, Any]:
        return {"c": np.float64(10.0), "certified": self.certificate.certified}


class SurfaceMap(MapResult):
    def extra_arrays(self):
        return {"angles": self.angles}


@pytest.fixture(scope="module")
def solid_map():
    solid = samples.solid_torus(1_500)
    image = solid.V * [1.0, 1.0, 0.999]
    return SolidMap(
        mesh=solid,
        image=image,
        torus=TORUS,
        history=HISTORY,
        certificate=certify(solid, image, TORUS, tolerance=0.1),
        converged=False,
        stop_reason="step limit",
        seconds={"volume": 1.5},
    )


@pytest.fixture(scope="module")
def surface_map():
    surface = samples.torus_surface(20, 10)
    u, v, _ = TORUS.coordinates(surface.V)
    angles = np.stack([u - 1.0, v + 2.0], axis=1)
    return SurfaceMap(
        mesh=surface,
        image=TORUS.xi(*angles.T),
        torus=TORUS,
        angles=angles,
        converged=True,
        stop_reason="tolerance",
        seconds={"area": 0.5},
    )


def test_report_holds_what_it_must(solid_map):
    report = json.loads(solid_map.to_json())
    assert report.keys() >= REQUIRED
    assert report["n_elements"] == len(solid_map.mesh.T)
    assert report["flips"] == 0 and report["certified"] is True
    assert report["torus"] == {"R": 3.0, "r": 1.0}
    assert report["iterations"] == 1
    assert report["c"] == 10.0
    assert report["seconds"] == {"volume": 1.5}
    assert report["versions"].keys() == {"stretchmap", "python", "numpy", "scipy"}
    assert report["energy"] == pytest.approx(solid_map.distortion.stretch_energy)


def test_json_is_strict_where_numbers_are_not_finite(solid_map):
    text = solid_map.to_json(history=True)
    history = json.loads(text, parse_constant=lambda name: pytest.fail(name))["history"]
    assert history[0]["step"] is None and history[1]["step"] == 1.0


def test_summary(solid_map):
    text = solid_map.summary()
    for fragment in ("volume map", "ring std", "R = 3, r = 1", "step limit", "seconds, volume"):
        assert fragment in text
    assert len({line.index("  ") > 0 for line in text.splitlines()}) == 1


def test_map_file_comes_back(solid_map, tmp_path):
    path = tmp_path / "map.npz"
    solid_map.save(path)
    with np.load(path) as file:
        assert {"V", "T", "image", "ratios", "meta", "height", "torus"} <= set(file.files)
    back = load_map(path)
    np.testing.assert_array_equal(back.mesh.T, solid_map.mesh.T)
    np.testing.assert_array_equal(back.image, solid_map.image)
    np.testing.assert_array_equal(back.arrays["height"], solid_map.mesh.V[:, 2])
    assert back.torus == TORUS and back.title == "volume map"
    assert (back.converged, back.stop_reason) == (False, "step limit")
    assert back.history[1] == HISTORY[1]
    assert math.isnan(back.history[0].step) and back.history[0].flips == 2
    assert back.distortion.to_dict() == solid_map.distortion.to_dict()
    again = tmp_path / "again.npz"
    back.save(again)
    np.testing.assert_array_equal(load_map(again).image, solid_map.image)
    assert isinstance(read(path), TetMesh)


def test_map_of_somebody_else(tmp_path):
    surface = samples.torus_surface(8, 6)
    path = tmp_path / "map.npz"
    np.savez(path, V=surface.V.astype("f4"), F=surface.F.astype(">i8"), image=surface.V)
    back = load_map(path)
    assert back.torus is None and back.history == () and not back.converged
    assert back.distortion.ring_std < 1e-6
    assert "map" in back.summary()


def test_a_file_of_version_0_1_is_read(tmp_path):
    record = {"stage": "sem", "iteration": 1, "energy": 2.0, "step": 1.0, "residual": None}
    record |= {"flips": 0, "ring_sd": 0.25, "element_sd": 0.5, "seconds": 1.0}
    meta = json.dumps({"history": [record]})
    np.savez(tmp_path / "old.npz", V=np.eye(3), F=[[0, 1, 2]], image=np.eye(3), meta=meta)
    (read,) = load_map(tmp_path / "old.npz").history
    assert read.ring_std == 0.25 and read.element_std == 0.5


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_solid_as_unstructured_grid(solid_map, tmp_path, suffix):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / f"map{suffix}"
    solid_map.save(path)
    grid = meshio.read(path)
    np.testing.assert_allclose(grid.point_data["image"], solid_map.image)
    np.testing.assert_allclose(grid.cell_data["ratio"][0], solid_map.distortion.ratios)
    np.testing.assert_allclose(grid.points, solid_map.mesh.V)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
@pytest.mark.parametrize("converged", [True, False])
def test_files_for_viewers_keep_whether_the_map_converged(solid_map, tmp_path, suffix, converged):
    pytest.importorskip("meshio")
    dataclasses.replace(solid_map, converged=converged).save(tmp_path / f"map{suffix}")
    back = load_map(tmp_path / f"map{suffix}")
    assert back.converged is converged and back.stop_reason == "the file does not say"
    assert "converged" not in back.point_fields


def test_a_file_with_one_end_of_a_map_is_refused_by_what_holds_both(solid_map, tmp_path):
    pytest.importorskip("meshio")
    solid_map.save(tmp_path / "map.msh")
    with pytest.raises(FileFormatError, match=r"no \.npz archive, and .*\.vtu, \.vtk, \.xdmf hold"):
        load_map(tmp_path / "map.msh")


def test_solid_in_a_surface_format_is_the_boundary_of_the_image(solid_map, tmp_path):
    path = tmp_path / "map.ply"
    solid_map.save(path)
    surface = read(path)
    assert len(surface.F) == len(solid_map.mesh.surface.F)
    assert surface.volume == pytest.approx(solid_map.distortion.image_total, rel=1e-5)


def test_surface_as_obj_keeps_the_source_and_its_chart(surface_map, tmp_path):
    path = tmp_path / "map.obj"
    surface_map.save(path)
    np.testing.assert_allclose(read(path).V, surface_map.mesh.V, rtol=1e-12)
    uv = np.array(
        [line.split()[1:3] for line in path.read_text().splitlines() if line.startswith("vt ")],
        float,
    )
    assert uv.min() > -1 and uv.max() < 2 and len(uv) > len(surface_map.mesh.V)


def test_surface_as_ply_is_its_image(surface_map, tmp_path):
    path = tmp_path / "map.ply"
    surface_map.save(path)
    np.testing.assert_allclose(read(path).V, surface_map.image, rtol=1e-6, atol=1e-6)


def test_unknown_format(solid_map, tmp_path):
    with pytest.raises(FileFormatError):
        solid_map.save(tmp_path / "map.docx")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arrays",
    [
        {"V": np.eye(3)},
        {"V": np.eye(3), "F": [[0, 1, 2]]},
        {"V": np.eye(3), "F": [[0, 1, 2]], "image": np.eye(3)[:2]},
        {"V": np.eye(3), "F": [[0, 1, 2]], "T": [[0, 1, 2, 0]], "image": np.eye(3)},
        {"V": np.eye(3), "F": [[0, 1, 2]], "image": np.eye(3), "meta": "{"},
        {"V": np.eye(3), "F": [[0, 1, 2]], "image": np.eye(3), "meta": "[]"},
        {"V": np.eye(3), "F": [[0, 1, 2]], "image": np.eye(3), "torus": 1.0},
        {"V": np.eye(3), "F": [[0, 1, 2]], "image": np.eye(3), "meta": '{"history": 5}'},
        {"V": np.eye(3), "F": [[0, 1, 2]], "image": np.eye(3), "meta": '{"history": [{}]}'},
    ],
)
def test_files_that_are_no_maps(tmp_path, arrays):
    path = tmp_path / "map.npz"
    np.savez(path, **arrays)
    with pytest.raises(FileFormatError):
        load_map(path)


@pytest.mark.parametrize("image", [np.full((3, 3), np.nan), [["a"] * 3] * 3, np.eye(3)[0]])
def test_images_that_are_no_points(tmp_path, image):
    np.savez(tmp_path / "map.npz", V=np.eye(3), F=[[0, 1, 2]], image=image)
    with pytest.raises(MeshError, match="image"):
        load_map(tmp_path / "map.npz")


def test_damaged_files(tmp_path):
    path = tmp_path / "map.npz"
    np.savez(path, V=np.eye(3), F=[[0, 1, 3]], image=np.eye(3))
    with pytest.raises(IndexRangeError):
        load_map(path)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(FileFormatError):
        load_map(path)
    path.write_bytes(b"")
    with pytest.raises(FileFormatError):
        load_map(path)
    with pytest.raises(FileNotFoundError):
        load_map(tmp_path / "absent.npz")


def test_atomic_write_leaves_nothing_on_failure_and_keeps_the_old_file(tmp_path):
    path = tmp_path / "out.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic_path(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.txt"]
    with atomic_path(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == "new"
    umask = os.umask(0)
    os.umask(umask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~umask


def test_table():
    assert table({"ring_std": 0.5, "x": None, "converged": True}) == (
        "ring std   0.5\nx          -\nconverged  yes"
    )
    assert table({}) == ""
