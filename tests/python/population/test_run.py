"""Whole runs: planted modes, resuming, bad files, workers that die, the same bits everywhere."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import stretchmap as sm
from population import dying
from population.truth import correspondence_errors, material, mode_angles, size
from stretchmap.errors import MissingDependencyError, OptionError, SolverError
from stretchmap.population import task
from stretchmap.population.executors import WorkerLost, as_executor
from stretchmap.population.shapes import gather_shapes
from stretchmap.samples.solids import cut_cells

ROUNDS = {"max_rounds": 2, "tol": 0.01}


@pytest.fixture(scope="module")
def bones():
    return sm.samples.vertebra_population(6, seed=2, n_tets=1600)


@pytest.fixture(scope="module")
def folder(bones, tmp_path_factory):
    """Three bones as files, and one that is none."""
    place = tmp_path_factory.mktemp("bones")
    for i, solid in enumerate(bones.solids[:3]):
        sm.write(place / f"bone{i}.npz", solid)
    (place / "bad.npz").write_bytes(b"no bone")
    return place


@pytest.fixture(scope="module")
def landmarks(bones, tmp_path_factory):
    """Of the three bones, as files: with them no pose is searched for."""
    place = tmp_path_factory.mktemp("landmarks")
    for i, points in enumerate(bones.landmarks[:3]):
        np.savetxt(place / f"bone{i}.csv", points, delimiter=",")
    return place


@pytest.fixture(scope="module")
def serial(folder, tmp_path_factory):
    return sm.population.fit(folder, folder=tmp_path_factory.mktemp("serial"), **ROUNDS)


@pytest.fixture(scope="module")
def guided(folder, landmarks):
    """The same by landmarks: most of the time goes to poses."""
    return sm.population.fit(folder, landmarks=landmarks, **ROUNDS)


def same(one, other):
    assert one.names == other.names and one.moved == other.moved
    for name in ("correspondences", "aligned"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    assert np.array_equal(one.mean.V, other.mean.V)


def test_planted_modes_are_recovered(bones):
    found = sm.population.fit(bones.solids, max_rounds=2, tol=0.01)
    assert found.converged and found.certificate.certified and not found.skipped
    assert all(r["certified"] and r["along"] == "smooth" for r in found.records)
    assert found.mean.tet_volumes.min() > 0.0
    errors, places = correspondence_errors(bones, found.correspondences)
    assert np.median(errors) < 0.006
    angles = mode_angles(bones, found.model, places.mean(axis=0))
    assert (
        angles[0] < 10.0 and angles[:3].max() < 20.0
    )  # 2000 tets, and the weakest mode 0.5 % of it
    assert found.outliers() == {}


def test_a_bad_file_is_named_and_skipped(serial, folder):
    assert set(serial.skipped) == {"bad"} and serial.names == ("bone0", "bone1", "bone2")
    assert "bad.npz" in serial.skipped["bad"]
    assert "bad" in serial.summary()
    record = json.loads((serial.folder / "records" / "bad-0.json").read_text())
    assert record["ok"] is False and record["error"] == serial.skipped["bad"]


def test_what_was_the_fault_of_the_machine_is_tried_again(folder, landmarks, tmp_path, monkeypatch):
    mapped, calls = task._mapped, []

    def once(job):
        calls.append(job.shape.name)
        if job.shape.name == "bone1" and calls.count("bone1") == 1:
            raise MissingDependencyError("reading needs a package")
        return mapped(job)

    monkeypatch.setattr(task, "_mapped", once)
    options = {"landmarks": landmarks, "folder": tmp_path, "max_rounds": 1, "tol": 0.0}
    first = sm.population.fit(folder, **options)
    assert set(first.skipped) == {"bad", "bone1"}
    again = sm.population.fit(folder, **options)
    assert set(again.skipped) == {"bad"}
    assert calls.count("bad") == calls.count("bone0") == 1


def test_maps_are_kept(serial):
    found = serial.map("bone2")
    n = serial.mean.n_vertices
    assert np.array_equal(found.image[:n], serial.correspondences[2])
    assert sm.certify(found.mesh, found.image).certified
    with pytest.raises(OptionError, match="bone9"):
        serial.map("bone9")


def test_a_map_is_that_of_the_round_it_is_asked_of(bones, tmp_path):
    solids = dict(zip("123", bones.solids, strict=False))  # names that are numbers stay
    options = {"landmarks": bones.landmarks[:3], "folder": tmp_path, "tol": 0.0}
    last = sm.population.fit(solids, max_rounds=2, **options)
    first = sm.population.fit(solids, max_rounds=1, **options)
    n = first.mean.n_vertices
    assert first.names == ("1", "2", "3")
    for found in (first, last):
        assert np.array_equal(found.map("2").image[:n], found.correspondences[1])
    assert not np.array_equal(first.map("2").image[:n], last.map("2").image[:n])
    (tmp_path / "maps" / "2-0.npz").unlink()
    again = sm.population.fit(solids, max_rounds=1, **options)
    assert np.array_equal(again.map("2").image, first.map("2").image)


@pytest.mark.skipif(os.name == "nt", reason="pipes of POSIX systems")
def test_a_pipe_among_the_files_is_named_and_skipped(folder, landmarks, tmp_path):
    os.mkfifo(tmp_path / "pipe.npz")
    paths = [folder / "bone0.npz", folder / "bone1.npz", tmp_path / "pipe.npz"]
    found = sm.population.fit(paths, landmarks=landmarks, max_rounds=1, tol=0.0)
    assert found.names == ("bone0", "bone1") and "pipe" in found.skipped["pipe"]


def test_no_landmarks_at_all_are_none(bones):
    plain = sm.population.fit(bones.solids[:2], max_rounds=1, tol=0.0)
    none = sm.population.fit(bones.solids[:2], landmarks=np.zeros((2, 0, 3)), max_rounds=1, tol=0.0)
    same(plain, none)


def test_a_finished_run_is_taken_up_as_it_is(serial, folder):
    times = {p: p.stat().st_mtime_ns for p in (serial.folder / "images").iterdir()}
    again = sm.population.fit(folder, folder=serial.folder, **ROUNDS)
    same(serial, again)
    assert times == {p: p.stat().st_mtime_ns for p in (serial.folder / "images").iterdir()}


def test_a_run_killed_goes_on_with_the_same_bits(guided, folder, landmarks, tmp_path):
    script = (
        "import sys, stretchmap as sm\n"
        f"sm.population.fit(sys.argv[1], landmarks=sys.argv[2], folder=sys.argv[3], **{ROUNDS!r})\n"
    )
    run = subprocess.Popen(
        [sys.executable, "-c", script, str(folder), str(landmarks), str(tmp_path)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
    )
    while not (tmp_path / "records" / "bone1-0.json").exists():
        assert run.poll() is None
        time.sleep(0.01)
    run.kill()
    run.wait()
    done = sorted(p.name for p in (tmp_path / "records").iterdir())
    assert "bone2-1.json" not in done  # it was not over
    same(guided, sm.population.fit(folder, landmarks=landmarks, folder=tmp_path, **ROUNDS))


def test_a_pool_of_processes_gives_the_same_bits(serial, folder, tmp_path):
    same(serial, sm.population.fit(folder, folder=tmp_path, executor="processes:2", **ROUNDS))


def test_a_worker_that_dies_is_replaced(tmp_path):
    jobs = [tmp_path / str(i) for i in range(5)]
    outcomes = dict(as_executor("processes:2").run(dying.die_once_at_two, jobs))
    assert outcomes == {i: str(i) for i in range(5)}


def test_a_job_that_kills_its_worker_is_given_up_and_the_others_are_not(tmp_path):
    jobs = [tmp_path / str(i) for i in range(5)]
    outcomes = dict(as_executor("processes:2").run(dying.die_at_two, jobs))
    assert isinstance(outcomes.pop(2), WorkerLost)
    assert outcomes == {i: str(i) for i in (0, 1, 3, 4)}


def test_workers_end_with_a_run_that_is_left_whatever_they_are_at():
    run, begun = as_executor("processes:2").run(time.sleep, [100.0, 0.0]), time.monotonic()
    assert next(run) == (1, None)
    run.close()
    assert time.monotonic() - begun < 60.0


def test_workers_end_with_whoever_runs_them(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import time\n"
        "from stretchmap.population.executors import Processes\n"
        "if __name__ == '__main__':\n"
        "    for done in Processes(2).run(time.sleep, [0.0, 100.0]):\n"
        "        print(done, flush=True)\n",
        encoding="utf-8",
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, env=env) as run:
        assert run.stdout.readline().strip() == b"(0, None)"
        run.kill()
        run.communicate(timeout=60.0)  # workers have its output, too


@pytest.mark.slow
def test_a_dask_cluster_with_a_worker_killed_gives_the_same_bits(
    guided, folder, landmarks, tmp_path
):
    if importlib.util.find_spec("distributed") is None:
        pytest.skip("distributed is not installed")
    import distributed

    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        killed = []

        def kill(stage, done, total, **values):
            if not killed:
                os.kill(pids[0], dying.KILL)
                killed.append(pids[0])

        found = sm.population.fit(
            folder, landmarks=landmarks, folder=tmp_path, executor=client, progress=kill, **ROUNDS
        )
        assert killed and killed[0] not in client.run(os.getpid).values()
    same(guided, found)


def test_landmarks_and_a_template_of_its_own(bones, tmp_path):
    names = [f"b{i}" for i in range(3)]
    template, points = (
        bones.reference,
        bones.reference.V[bones.reference.boundary_vertices[[0, 40]]],
    )
    for i, name in enumerate(names):
        np.savetxt(tmp_path / f"{name}.csv", bones.place(i, points), delimiter=",")
    np.savetxt(tmp_path / "template.csv", points, delimiter=",")
    solids = dict(zip(names, bones.solids, strict=False))
    found = sm.population.fit(solids, template, tmp_path, max_rounds=1, tol=1.0)
    assert found.names == tuple(names) and found.mean.n_tets == template.n_tets
    (tmp_path / "b1.csv").unlink()
    found = sm.population.fit(solids, template, tmp_path, max_rounds=1, tol=1.0)
    assert found.names == ("b0", "b2") and "no landmarks" in found.skipped["b1"]


def test_tets_that_the_boundary_alone_decides_about_are_split():
    cells = np.ones((3, 3, 1), bool)
    cells[1, 1] = False
    V, T = cut_cells(cells.repeat(2, 0).repeat(2, 1))
    solids = [sm.TetMesh(V * [1.0 + 0.1 * i, 1.0, 0.7 + 0.2 * i], T) for i in range(3)]
    assert len(solids[0].boundary_vertices) == solids[0].n_vertices
    found = sm.population.fit(solids, max_rounds=1, tol=1.0)
    added = found.mean.n_vertices - solids[0].n_vertices
    assert added > 0 and len(found.correspondences) == 3
    assert found.certificate.certified and found.mean.tet_volumes.min() > 0.0


def test_solids_of_the_population(serial):
    assert np.allclose(serial.mode(0, 0.0).V, serial.mean.V)
    two = serial.mode(0, 2.0)
    deviation = np.sqrt(serial.model.variances[0])
    assert np.linalg.norm(two.V - serial.mean.V) == pytest.approx(2.0 * deviation)
    assert np.allclose(serial.reconstruct(serial.model.scores[1]).V, serial.aligned[1])
    assert len(serial.sample(3, seed=1)) == 3
    with pytest.raises(OptionError, match="modes"):
        serial.mode(99, 1.0)


def test_what_is_saved_can_be_read(serial, tmp_path):
    serial.save(tmp_path / "population.npz")
    with np.load(tmp_path / "population.npz") as data:
        assert np.array_equal(data["correspondences"], serial.correspondences)
        assert json.loads(str(data["meta"]))["skipped"].keys() == {"bad"}


@pytest.mark.slow
def test_an_outlier_is_named(serial):
    odd = sm.samples.bumpy_torus(1500)
    assert serial.outliers(threshold=1e-6)  # somebody is always farthest
    solids = {f"ring{i}": sm.samples.solid_torus(600 + 100 * i) for i in range(3)} | {"odd": odd}
    found = sm.population.fit(solids, max_rounds=1, tol=1.0)
    assert list(found.outliers()) == ["odd"]


def test_shapes_are_found_and_named(tmp_path, bones):
    assert [s.name for s in gather_shapes(list(bones.solids[:2]))] == ["0", "1"]
    with pytest.raises(OptionError, match="holds no mesh"):
        gather_shapes(tmp_path)
    with pytest.raises(OptionError, match="two shapes are named 'a'"):
        gather_shapes([tmp_path / "a.npz", tmp_path / "b" / "a.msh"])
    with pytest.raises(FileNotFoundError):
        gather_shapes(tmp_path / "nowhere")
    for bad in (3, {"": bones.solids[0]}, {"a/b": bones.solids[0]}):
        with pytest.raises(OptionError):
            gather_shapes(bad)


def test_surfaces_in_the_folder_are_named_not_passed_over(tmp_path, bones, caplog):
    for i in range(7):
        sm.write(tmp_path / f"scan{i}.ply", bones.solids[0].surface)
    (tmp_path / "notes.txt").write_text("no mesh")
    with pytest.raises(OptionError, match=r"scan0.ply, .* and 2 more as surfaces: fill them first"):
        gather_shapes(tmp_path)
    sm.write(tmp_path / "bone.npz", bones.solids[0])
    assert [s.name for s in gather_shapes(tmp_path)] == ["bone"]
    (told,) = [r.getMessage() for r in caplog.records]
    assert "scan4.ply and 2 more left out" in told and "notes" not in told


def test_a_script_without_a_guard_is_told_of_it_at_once(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import stretchmap as sm\n"
        "print('run', flush=True)\n"
        "solids = [sm.samples.solid_torus(600, R=R) for R in (2.0, 2.1, 2.2)]\n"
        "sm.population.fit(solids, executor='processes:2', max_rounds=1)\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
    )  # fmt: skip
    assert done.returncode == 1 and "under `if __name__ == '__main__':`" in done.stderr
    assert done.stdout.count("run") <= 3  # itself and its workers, once each


def test_what_is_skipped_is_told_once(folder, landmarks, caplog):
    found = sm.population.fit(folder, landmarks=landmarks, max_rounds=2, tol=0.0)
    assert len(found.moved) == 2 and set(found.skipped) == {"bad"}
    assert sum("bad is skipped" in r.getMessage() for r in caplog.records) == 1


def test_a_folder_is_that_of_its_shapes(bones, tmp_path):
    place, solids = tmp_path / "run", bones.solids
    options = {"folder": place, "max_rounds": 1, "tol": 0.0}
    shapes = dict(zip("ab", solids, strict=False))
    marks = dict(zip("abc", bones.landmarks, strict=False))
    first = sm.population.fit(shapes, landmarks=marks, **options)
    before = {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}
    for others, moved, template, match in (
        ({"a": solids[0], "b": solids[3]}, marks, None, "other shapes by the names of b"),
        (shapes, marks | {"a": marks["a"][:-1]}, None, "names of a, or with other landmarks"),
        (shapes, marks, "b", "other settings"),
    ):
        with pytest.raises(OptionError, match=match):
            sm.population.fit(others, template, landmarks=moved, **options)
    assert before == {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}
    again = sm.population.fit(shapes | {"c": solids[2]}, landmarks=marks, **options)
    assert again.names == ("a", "b", "c")
    np.testing.assert_array_equal(again.map("a").image, first.map("a").image)
    assert before[place / "maps" / "a-0.npz"] == (place / "maps" / "a-0.npz").read_bytes()


def test_a_shape_without_a_map_may_be_replaced_and_a_file_be_gone(bones, landmarks, tmp_path):
    files = [tmp_path / f"bone{i}.npz" for i in range(3)]
    for file, solid in zip(files, bones.solids, strict=False):
        sm.write(file, solid)
    files[1].write_bytes(b"no bone")
    options = {
        "landmarks": landmarks, "folder": tmp_path / "run", "max_rounds": 1, "tol": 0.0,
    }  # fmt: skip
    assert set(sm.population.fit(files, **options).skipped) == {"bone1"}
    sm.write(files[1], bones.solids[1])
    files[2].rename(tmp_path / "elsewhere.npz")
    assert set(sm.population.fit(files, **options).skipped) == {"bone2"}
    (tmp_path / "elsewhere.npz").rename(files[2])
    assert not sm.population.fit(files, **options).skipped


def test_a_result_finds_its_files_from_another_directory(bones, landmarks, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for i, solid in enumerate(bones.solids[:2]):
        sm.write(f"bone{i}.npz", solid)
    files = ["bone0.npz", "bone1.npz"]
    found = sm.population.fit(files, landmarks=landmarks, folder="run", max_rounds=1, tol=0.0)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert found.map("bone0").mesh.n_vertices >= found.mean.n_vertices
    assert found.shapes[1].load().n_tets == bones.solids[1].n_tets


def test_runs_that_cannot_be(serial, folder, bones):
    with pytest.raises(OptionError, match="other settings"):
        sm.population.fit(folder, folder=serial.folder, along="area")
    with pytest.raises(OptionError, match=r"neither the name of a shape \(0, 1, .*\.\.\.\) nor"):
        sm.population.fit(bones.solids, "bone0")
    with pytest.raises(SolverError, match="two are needed"):
        sm.population.fit(bones.solids[:1])
    with pytest.raises(SolverError, match="no shape can be read"):
        sm.population.fit([Path("nowhere.npz"), Path("nothing.npz")])
    with pytest.raises(OptionError, match="no shapes are given"):
        sm.population.fit({})
    with pytest.raises(OptionError, match="name another one"):
        sm.population.fit(folder, folder=folder / ".." / folder.name)
    for options in (
        {"along": "both"}, {"tol": -1.0}, {"max_rounds": 0}, {"executor": "cloud"}, {"scale": 1},
        {"volume_weight": 0.0}, {"executor": "processes:x"},
    ):  # fmt: skip
        with pytest.raises(OptionError):
            sm.population.fit(bones.solids, **options)


@pytest.mark.parametrize(
    "name",
    [
        "dask://",
        "dask://host",
        "dask://:8786",
        "dask://host:x",
        "dask://tcp://host:1",
        "processes:²",
    ],
)
def test_executors_that_name_no_place_are_refused(name):
    if name.startswith("dask"):
        pytest.importorskip("distributed")
    with pytest.raises(OptionError, match="must be"):
        as_executor(name)


def test_material_points_are_found_again(bones):
    points = bones.solids[1].V
    assert np.abs(material(bones, 1, points) - bones.material[1]).max() < 1e-9 * size(points)
