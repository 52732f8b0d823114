"""Ctrl-C: how long every stage leaves a signal unheard, and that it ends a run."""

from __future__ import annotations

import signal
import time

import pytest

import stretchmap as sm
from stretchmap import samples
from stretchmap.mesh.refinement import refine_overconstrained

pytestmark = [
    pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timers here"),
    pytest.mark.filterwarnings("ignore"),
]
# Seconds of processor time, which waiting behind other work does not lengthen. Half a second is
# promised, and what is not interrupted grows with the mesh, which has 100k tets here.
LIMIT = 0.1


class Probe:
    """Sends a signal every few milliseconds and notes the longest work between two of them heard.

    The handler only takes notes, so that one run tries every moment of it.
    """

    def __init__(self, period=0.005):
        self.period, self.worst, self.heard, self.over = period, 0.0, 0, False

    def arm(self):
        self.start = time.thread_time()
        signal.setitimer(signal.ITIMER_REAL, self.period)

    def note(self):
        self.worst = max(self.worst, time.thread_time() - self.start)

    def hear(self, *_):
        self.note()
        self.heard += 1
        if not self.over:  # a signal on its way out would come when nobody listens any more
            self.arm()

    def __enter__(self):
        self.before = signal.signal(signal.SIGALRM, self.hear)
        self.arm()
        return self

    def __exit__(self, *_):
        self.over = True
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        self.note()
        signal.signal(signal.SIGALRM, self.before)


@pytest.fixture(scope="module")
def solid():
    return samples.bumpy_torus(100_000)


@pytest.fixture(scope="module")
def mapped(solid):
    return sm.volume_map(solid, method="vsem", max_iter=3)


STAGES = {
    "diagnosis": lambda solid, mapped: sm.TetMesh(solid.V, solid.T).diagnose(),
    "boundary": lambda solid, mapped: sm.TetMesh(solid.V, solid.T).surface,
    "edges": lambda solid, mapped: sm.TetMesh(solid.V, solid.T).edges,
    "refinement": lambda solid, mapped: refine_overconstrained(solid),
    "homology": lambda solid, mapped: sm.homology_basis(solid.surface, solid),
    "loops": lambda solid, mapped: sm.homology_basis(solid.surface).tunnel_loops,
    "conformal": lambda solid, mapped: sm.conformal_map(solid.surface),
    "area": lambda solid, mapped: sm.area_map(solid.surface),
    "vsem": lambda solid, mapped: sm.volume_map(solid, method="vsem", max_iter=5),
    "certificate": lambda solid, mapped: sm.certify(solid, mapped.image),
    "partition": lambda solid, mapped: sm.partition(mapped, [0.5, 0.5], by="s"),
    "grid": lambda solid, mapped: sm.hex_mesh(mapped, sections=32),
    "points": lambda solid, mapped: sm.PointMap(mapped).forward(solid.V),
}


@pytest.mark.parametrize("stage", STAGES)
def test_no_stage_is_deaf(stage, solid, mapped):
    with Probe() as probe:
        STAGES[stage](solid, mapped)
    assert probe.worst < LIMIT


def test_certified_route_is_not_deaf():
    solid = samples.bumpy_torus(20_000)
    with Probe() as probe:
        sm.volume_map(solid)
    assert probe.heard > 10
    assert probe.worst < LIMIT


def test_registration_is_not_deaf():
    pair = samples.vertebra_pair(n_tets=(3_000, 4_000))
    with Probe() as probe:
        sm.register(pair.source, pair.target, max_iter=20)
    assert probe.heard > 10
    assert probe.worst < LIMIT


@pytest.mark.parametrize("delay", [0.01, 0.1, 0.3])
def test_an_interrupt_ends_a_run(solid, delay):
    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    start = time.thread_time()
    signal.setitimer(signal.ITIMER_REAL, delay)
    try:
        with pytest.raises(KeyboardInterrupt):
            while True:
                sm.volume_map(sm.TetMesh(solid.V, solid.T), method="vsem")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert time.thread_time() - start < delay + LIMIT
