"""How many threads the core uses."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

from .. import _core
from .options import whole

__all__ = ["takes_threads", "threads"]

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Let everything inside a ``with`` block use this many threads.

    The number belongs to the calling Python thread, others keep theirs; afterwards it is what it
    was. Results do not depend on it, to the last bit, unless the time limit of a map runs out.

    A forked process (``multiprocessing`` forks by default on Linux up to Python 3.13) computes with
    one thread whatever is asked, since the threads of its parent are not there any more. Threads
    started there, and processes that are spawned, have as many as they like.

    Parameters
    ----------
    count : int or None
        At least 1. None leaves the number as it is: that of ``OMP_NUM_THREADS``, else one per
        processor.

    Raises
    ------
    OptionError
        ``count`` is no positive integer.

    Examples
    --------
    >>> import stretchmap as sm
    >>> with sm.threads(1):
    ...     result = sm.area_map(sm.samples.torus_surface(24, 12))
    """
    if count is None:
        yield
        return
    wanted = whole("threads", count, 1, 1024)
    before = _core.base.thread_count()
    _core.base.set_thread_count(wanted)
    try:
        yield
    finally:
        _core.base.set_thread_count(before)


def takes_threads(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Run a function that has a keyword ``threads`` with that many of them."""

    @functools.wraps(function)
    def run(*args: _Arguments.args, **keywords: _Arguments.kwargs) -> _Result:
        with threads(keywords.get("threads")):  # type: ignore[arg-type]
            return function(*args, **keywords)

    return run
