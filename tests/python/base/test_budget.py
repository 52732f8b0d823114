"""Processor time: whose counts."""

import threading
import time

import stretchmap as sm
from stretchmap import samples
from stretchmap.base.budget import Budget, processor_seconds


def test_what_other_threads_compute_is_not_charged():
    budget = Budget(100.0)

    def work():
        end = time.thread_time() + 0.3
        while time.thread_time() < end:
            pass

    other = threading.Thread(target=work)
    other.start()
    other.join()
    assert budget.left > 99.9
    work()
    assert 99.0 < budget.left < 99.75


def test_threads_that_share_the_loops_are_charged():
    solid = samples.bumpy_torus(40000)

    def of_helpers():
        return processor_seconds() - time.thread_time()

    before = of_helpers()
    sm.volume_map(solid, c=0.0, max_iter=4, threads=2)
    assert of_helpers() - before > 1e-3
