"""Jobs done one by one in a process of their own, which may die, hang or run out of memory.

The process is a script called with ``--worker``: it reads a job per line and answers with one line
of JSON, `serve` does that. One process does many jobs; after a death or a hang the next one takes
over where it stopped.
"""

from __future__ import annotations

import json
import os
import resource
import selectors
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import stretchmap
from stretchmap.errors import StretchmapError

# What a worker may use; a size that is not bounded before memory is meets this.
MEMORY = 6 * 2**30
START = 300.0  # seconds a worker may take to get ready
RETURNED, OURS, SYSTEM, FOREIGN, SILENT = "returned", "ours", "system", "foreign", "silent"


@dataclass
class Tally:
    """Counts of outcomes, and the jobs that ended badly."""

    counts: Counter[str] = field(default_factory=Counter)
    bad: list[tuple[Any, str, str]] = field(default_factory=list)

    def add(self, job: Any, outcome: str, detail: str) -> None:
        self.counts[outcome] += 1
        if outcome in ("death", "hang", FOREIGN, SILENT):
            self.bad.append((job, outcome, detail))
            print(f"{outcome}: {json.dumps(job)}: {detail}", flush=True)

    def line(self, what: str) -> str:
        """The last line of a script."""
        c = self.counts
        return (
            f"{c.total()} {what}, {c['death']} deaths, {c['hang']} hangs, {c[FOREIGN]} foreign "
            f"errors, {c[SILENT]} silent changes"
        )


def run(script: Path, jobs: Sequence[Any], limit: float, arguments: Iterable[str] = ()) -> Tally:
    """Do the jobs in workers, each in at most ``limit`` seconds."""
    tally, at = Tally(), 0
    while at < len(jobs):
        at = _one_worker(
            [sys.executable, str(script), "--worker", *arguments], jobs, at, limit, tally
        )
    return tally


def _one_worker(
    command: list[str], jobs: Sequence[Any], at: int, limit: float, tally: Tally
) -> int:
    """Do jobs until the worker ends; returns the next one to be done."""
    package = str(Path(stretchmap.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": package, "OMP_NUM_THREADS": "1"}
    worker = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, bufsize=0
    )
    assert worker.stdin is not None and worker.stdout is not None
    answers = _Lines(worker.stdout.fileno())
    try:
        if answers.next(START) != "ready":
            raise RuntimeError(f"{' '.join(command)} does not start")
        for job in jobs[at:]:
            at += 1
            try:
                worker.stdin.write(json.dumps(job).encode() + b"\n")
                answer = answers.next(limit)
            except BrokenPipeError:
                answer = ""
            if not answer:
                hangs = answer is None
                tally.add(job, "hang" if hangs else "death", f"after {limit} s" * hangs)
                break
            tally.add(job, *json.loads(answer))
    finally:
        worker.kill()
        worker.wait()
        worker.stdin.close()
        worker.stdout.close()
    return at


class _Lines:
    """Lines of a pipe, waited for no longer than one likes."""

    def __init__(self, pipe: int) -> None:
        self._pipe, self._rest = pipe, b""
        self._selector = selectors.DefaultSelector()
        self._selector.register(pipe, selectors.EVENT_READ)

    def next(self, limit: float) -> str | None:
        """The next line; empty at the end, None when it takes longer."""
        end = time.monotonic() + limit
        while b"\n" not in self._rest:
            if not self._selector.select(max(0.0, end - time.monotonic())):
                return None
            found = os.read(self._pipe, 1 << 16)
            if not found:
                return ""
            self._rest += found
        line, self._rest = self._rest.split(b"\n", 1)
        return line.decode()


def serve(work: Callable[[Any], tuple[str, str]], memory: int = MEMORY) -> None:
    """Answer jobs from standard input until it ends, standard output kept clean."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    print("ready", file=answers, flush=True)
    for line in sys.stdin:
        print(json.dumps(work(json.loads(line))), file=answers, flush=True)


def outcome_of(action: Callable[[], Any]) -> tuple[str, str]:
    """How a call ends: with a result, one of our errors, the system's or somebody else's."""
    try:
        action()
    except StretchmapError as error:
        return (OURS, str(error)) if str(error).strip() else (FOREIGN, "an error without a word")
    except OSError as error:
        return SYSTEM, str(error)
    except BaseException as error:
        return FOREIGN, f"{type(error).__name__}: {error}"[:300]
    return RETURNED, ""
