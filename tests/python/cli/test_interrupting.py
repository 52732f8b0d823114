"""What ends a command from outside: at once, with exit code 130, and nothing left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import stretchmap as sm
from stretchmap import samples

pytest.importorskip("typer")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")

# Processes of their own find the package wherever this one did.
ENV = {**os.environ, "PYTHONPATH": str(Path(sm.__file__).parents[1])}


def as_in_a_terminal():
    """However the tests were started: in the background, or by nohup, signals are ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.mark.parametrize("how", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_interrupting_exits_130_at_once_without_traceback(tmp_path, how):
    sm.write(tmp_path / "big.npz", samples.vertebra_like(120_000))
    run = subprocess.Popen(
        [sys.executable, "-m", "stretchmap", "volume", "big.npz", "-o", "map.npz"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENV,
        preexec_fn=as_in_a_terminal,
    )
    time.sleep(2.0)
    run.send_signal(getattr(signal, how))
    sent = time.perf_counter()
    _, err = run.communicate(timeout=60)
    assert run.returncode == 130, err
    assert time.perf_counter() - sent < 5.0
    assert "Traceback" not in err and "interrupted" in err
    assert {p.name for p in tmp_path.iterdir()} == {"big.npz"}


def test_a_long_call_that_never_returns_to_python_is_ended_too():
    script = (
        "import os, signal, threading, time\n"
        "from stretchmap.cli.guard import guarded\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()\n"
        "def deaf():\n"
        "    while True:\n"
        "        try: time.sleep(20.0)\n"
        "        except KeyboardInterrupt: pass\n"
        "guarded(deaf)\n"
    )
    started = time.perf_counter()
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=ENV)
    assert run.returncode == 130
    assert time.perf_counter() - started < 15.0
    assert run.stderr == "stretchmap: interrupted\n"


def test_an_interrupt_within_an_exec_has_the_same_exit_code(tmp_path):
    script = (
        "import sys\n"
        "from stretchmap.cli.guard import guarded\n"
        "sys.exit(guarded(lambda: exec('raise KeyboardInterrupt')))\n"
    )
    (tmp_path / "interrupted.py").write_text(script, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "-m", "interrupted"], cwd=tmp_path, capture_output=True, text=True, env=ENV
    )
    assert (run.returncode, run.stderr) == (130, "stretchmap: interrupted\n")
