"""Where the tasks of a run are done: here, in a pool of processes, or on a Dask cluster.

All have one method, ``run(task, jobs)``, that yields the number of a job and what the task
returned, in whatever order they are done; or a `WorkerLost` if whoever did it died time and again.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import re
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, Protocol

from .. import _core
from ..base.options import shown, whole
from ..errors import MissingDependencyError, OptionError, SolverError, StretchmapError

__all__ = ["Dask", "Executor", "Processes", "Serial", "WorkerLost", "as_executor"]

_ATTEMPTS = 3  # of a job whose worker dies
_SCHEME = "dask://"
_ADDRESS = re.compile(r"dask://[^\s/]+:[0-9]{1,5}")

Task = Callable[[Any], Any]


class WorkerLost(StretchmapError):
    """The process that did a job died, and so did those that tried it again."""


class Executor(Protocol):
    """Anything that does jobs."""

    def run(self, task: Task, jobs: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """Do all jobs; yields the number of a job and its outcome, or a `WorkerLost`.

        Parameters
        ----------
        task : callable
            Of a module, so that other processes find it.
        jobs : sequence
        """
        ...


class Serial:
    """One job after the other in this process.

    Examples
    --------
    >>> from stretchmap.population.executors import Serial
    >>> list(Serial().run(abs, [-2, 3]))
    [(0, 2), (1, 3)]
    """

    def run(self, task: Task, jobs: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As `Executor.run`."""
        for i, job in enumerate(jobs):
            yield i, task(job)


class Processes:
    """A pool of processes on this machine; one that dies is replaced and its job done again.

    The processes are spawned, so a script that uses them needs the usual
    ``if __name__ == "__main__":``. They end at once when the run is interrupted, or this process
    does, whatever they are at.

    Parameters
    ----------
    workers : int, optional
        As many as there are processors by default.

    Raises
    ------
    OptionError
        Not a positive number.

    Examples
    --------
    >>> from stretchmap.population.executors import Processes
    >>> Processes(2).workers
    2
    """

    def __init__(self, workers: int | None = None) -> None:
        count = max(_core.base.processors(), 1)
        self.workers = count if workers is None else whole("workers", workers, 1, 4096)

    def run(self, task: Task, jobs: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As `Executor.run`."""
        waiting, attempts = list(range(len(jobs))), [0] * len(jobs)
        while waiting:
            # What was running when a worker died is tried again alone: one of them is to blame.
            suspects = [i for i in waiting if attempts[i]]
            lost: list[int] = []
            for i, outcome in self._until_it_breaks(task, jobs, suspects[:1] or waiting, lost):
                waiting.remove(i)
                yield i, outcome
            for i in lost:
                attempts[i] += 1
                if attempts[i] >= _ATTEMPTS:
                    waiting.remove(i)
                    yield i, WorkerLost(f"the worker process died {_ATTEMPTS} times")

    def _until_it_breaks(
        self, task: Task, jobs: Sequence[Any], ids: Sequence[int], lost: list[int]
    ) -> Iterator[tuple[int, Any]]:
        """Jobs in a pool; those it was at when it broke go to ``lost``."""
        context = multiprocessing.get_context("spawn")
        workers = min(self.workers, len(ids))
        theirs, ours = context.Pipe(duplex=False)
        with theirs, ours, ProcessPoolExecutor(workers, context, _end_with, (theirs,)) as pool:
            try:
                _require_started(pool)
                yield from self._done_in(pool, task, jobs, list(reversed(ids)), lost)
            except BaseException:
                ours.close()  # or leaving the pool would wait for what it is at
                raise

    def _done_in(
        self,
        pool: ProcessPoolExecutor,
        task: Task,
        jobs: Sequence[Any],
        waiting: list[int],
        lost: list[int],
    ) -> Iterator[tuple[int, Any]]:
        running: dict[Future[Any], int] = {}
        while (waiting or running) and not lost:
            try:
                while waiting and len(running) < self.workers:
                    running[pool.submit(task, jobs[waiting[-1]])] = waiting[-1]
                    waiting.pop()
            except BrokenProcessPool:
                pass  # told by the futures that are running
            done = wait(running, return_when=FIRST_COMPLETED).done
            if any(isinstance(future.exception(), BrokenProcessPool) for future in done):
                done = wait(running).done
            for future in done:
                i = running.pop(future)
                if isinstance(future.exception(), BrokenProcessPool):
                    lost.append(i)
                else:
                    yield i, future.result()


class Dask:
    """The workers of a Dask cluster; jobs of one that dies go to another.

    They need stretchmap, and the run folder and the files of the shapes under the same paths.

    Parameters
    ----------
    cluster : str or distributed.Client
        Address of the scheduler, ``"dask://host:port"``, or a client.

    Raises
    ------
    MissingDependencyError
        ``distributed`` is not installed.
    OptionError
        It is neither.

    Examples
    --------
    >>> import stretchmap as sm
    >>> from stretchmap.population.executors import Dask
    >>> Dask("dask://localhost:1").address
    'tcp://localhost:1'
    """

    def __init__(self, cluster: Any) -> None:
        if importlib.util.find_spec("distributed") is None:
            raise MissingDependencyError(
                "a Dask cluster needs distributed: pip install 'stretchmap[cluster]'"
            )
        address = cluster if isinstance(cluster, str) else ""
        if not _ADDRESS.fullmatch(address) and not _is_client(cluster):
            raise OptionError(
                f"cluster must be 'dask://host:port' or a Dask client, got {shown(cluster)}"
            )
        self.client = None if address else cluster
        self.address = address.replace(_SCHEME, "tcp://", 1)

    def run(self, task: Task, jobs: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As `Executor.run`.

        Raises
        ------
        OSError
            The scheduler is not there.
        """
        import distributed

        client = self.client or distributed.Client(self.address, timeout=10)
        try:
            futures = {client.submit(task, job, pure=False): i for i, job in enumerate(jobs)}
            for future in distributed.as_completed(futures):
                try:
                    outcome = future.result()
                except distributed.scheduler.KilledWorker:
                    outcome = WorkerLost("workers of the cluster died of it again and again")
                yield futures.pop(future), outcome
        finally:
            if self.client is None:
                client.close()


def as_executor(executor: Any) -> Executor:
    """The executor of a name: None, ``"serial"``, ``"processes:4"``, ``"dask://host:port"``.

    Raises
    ------
    OptionError
        No such executor.
    MissingDependencyError
        It needs a package that is not installed.
    """
    if executor is None:
        return Serial()
    if isinstance(executor, str):
        if executor == "serial":
            return Serial()
        name, _, count = executor.partition(":")
        if name == "processes" and (not count or count.isdecimal()):
            return Processes(int(count) if count else None)
        if executor.startswith(_SCHEME):
            return Dask(executor)
    elif _is_client(executor):
        return Dask(executor)
    elif callable(getattr(executor, "run", None)):
        found: Executor = executor
        return found
    raise OptionError(
        "executor must be 'serial', 'processes', 'processes:N', 'dask://host:port', a Dask client "
        f"or an object with a method run(task, jobs), got {shown(executor)}"
    )


def _end_with(pipe: Connection) -> None:
    """End this process, a worker, when the other end of a pipe is closed, as by the end of whoever
    holds it."""

    def watch() -> None:
        with suppress(EOFError, OSError):
            pipe.recv()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _require_started(pool: ProcessPoolExecutor) -> None:
    """Each worker runs the main script once more, but for what its guard keeps from it.

    Raises
    ------
    SolverError
        One ends before it has done anything.
    """
    try:
        pool.submit(os.getpid).result()
    except BrokenProcessPool:
        raise SolverError(
            "worker processes end as they start: a script that asks for them has to make its calls "
            "under `if __name__ == '__main__':`"
        ) from None


def _is_client(given: Any) -> bool:
    return hasattr(given, "scheduler_info") and callable(getattr(given, "submit", None))
