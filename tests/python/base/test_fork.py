"""Processes made by fork and by spawn compute, whatever their parent has done before."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import stretchmap as sm

LIMIT = 240.0  # seconds: a child that waits for threads that are gone waits for ever
METHODS = [m for m in ("fork", "spawn") if m in multiprocessing.get_all_start_methods()]


def mapped(seed: int) -> bytes:
    """A map made with two threads, as a user's worker would."""
    solid = sm.samples.vertebra_like(700, seed=seed)
    return np.asarray(sm.volume_map(solid, threads=2).image).tobytes()


def threads_of_a_child(queue) -> None:
    counts = []
    with sm.threads(2):
        counts.append(sm._core.base.thread_count())
    other = threading.Thread(target=lambda: counts.append(_count_with_two()))
    other.start()
    other.join()
    queue.put(counts)


def _count_with_two() -> int:
    with sm.threads(2):
        mapped(0)
        return sm._core.base.thread_count()


@pytest.fixture(scope="module")
def expected():
    """Maps of eight solids; afterwards this process has a pool of threads."""
    return [mapped(seed) for seed in range(8)]


@pytest.mark.parametrize("method", METHODS)
def test_a_pool_of_four_maps_eight_solids(expected, method, capfd):
    with multiprocessing.get_context(method).Pool(4) as pool:
        assert pool.map_async(mapped, range(8)).get(LIMIT) == expected
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("method", METHODS)
def test_futures(expected, method):
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        found = [pool.submit(mapped, seed) for seed in range(2)]
        assert [f.result(LIMIT) for f in found] == expected[:2]


@pytest.mark.parametrize("backend", ["loky", "multiprocessing", "threading"])
def test_joblib(expected, backend):
    joblib = pytest.importorskip("joblib")
    run = joblib.Parallel(n_jobs=2, backend=backend, timeout=LIMIT)
    assert run(joblib.delayed(mapped)(seed) for seed in range(2)) == expected[:2]


@pytest.mark.skipif("fork" not in METHODS, reason="this system does not fork")
def test_a_forked_process_has_one_thread_and_its_threads_have_more(expected):
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    with sm.threads(2):
        in_the_parent = sm._core.base.thread_count()
        child = context.Process(target=threads_of_a_child, args=(queue,))
        child.start()
        counts = queue.get(timeout=LIMIT)
        child.join(LIMIT)
    assert child.exitcode == 0 and counts == [1, in_the_parent]


@pytest.mark.skipif("fork" not in METHODS, reason="this system does not fork")
def test_a_child_forked_in_the_middle_of_a_map(expected):
    """Progress is called between parallel regions; a fork there is a fork like any other."""
    script = (
        "import os, sys, stretchmap as sm\n"
        "solid = sm.samples.solid_torus(1500)\n"
        "state = {}\n"
        "def look(stage, done, total, **values):\n"
        "    if 'child' not in state:\n"
        "        state['child'] = os.fork()\n"
        "result = sm.volume_map(solid, threads=2, progress=look)\n"
        "if state['child'] == 0:\n"
        "    os._exit(0 if result.certificate.certified else 1)\n"
        "sys.exit(os.waitstatus_to_exitcode(os.waitpid(state['child'], 0)[1]))\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(sm.__file__).parents[1])}
    run = subprocess.run(
        [sys.executable, "-c", script], env=environment, timeout=LIMIT, capture_output=True,
        check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr.decode()
