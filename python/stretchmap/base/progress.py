"""Progress of long computations: the protocol the library calls, and bars to look at.

A library function takes ``progress=None`` and calls :func:`report` once per outer step. What is
called may raise :class:`stretchmap.errors.Cancelled` to stop the computation. The library itself
never prints; :func:`progress_bar` makes a bar for a notebook or a terminal, :func:`terminal` for
the latter alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any, Protocol, TextIO

__all__ = ["Progress", "progress_bar", "report", "terminal", "throttled"]


class Progress(Protocol):
    """Anything that can be called with the state of a computation.

    Examples
    --------
    >>> import stretchmap as sm
    >>> stages = set()
    >>> def note(stage, done, total, **values):
    ...     stages.add(stage)
    >>> result = sm.area_map(sm.samples.torus_surface(24, 12), progress=note)
    >>> "area" in stages
    True
    """

    def __call__(self, stage: str, done: int, total: int, **values: float) -> None:
        """Take note of a step.

        Parameters
        ----------
        stage : str
            Name of the running stage, such as ``"volume"``.
        done, total : int
            Steps done and the most that will be done; ``total`` is 0 when it is not known.
        **values : float
            Figures of the step (``energy``, ``flips``, ...).
        """


def report(
    progress: Progress | None, stage: str, done: int, total: int = 0, **values: float
) -> None:
    """Call ``progress`` when there is one."""
    if progress is not None:
        progress(stage, done, total, **values)


def throttled(
    progress: Progress,
    *,
    delay: float = 1.0,
    interval: float = 0.1,
    clock: Callable[[], float] = time.monotonic,
) -> Progress:
    """Pass on calls not before ``delay`` seconds and then at most every ``interval`` seconds.

    Parameters
    ----------
    progress : Progress
    delay : float
        Seconds during which nothing is passed on, so that quick work leaves no trace.
    interval : float
        Least number of seconds between two calls.
    clock : callable
        Source of time in seconds.
    """
    due = clock() + delay

    def pass_on(stage: str, done: int, total: int, **values: float) -> None:
        nonlocal due
        now = clock()
        if now >= due:
            due = now + interval
            progress(stage, done, total, **values)

    return pass_on


@contextmanager
def terminal(quiet: bool = False, stream: TextIO | None = None) -> Iterator[Progress | None]:
    """Progress bar for a terminal, removed at the end; ``None`` when quiet or not a terminal.

    Uses rich when it is installed and a plain line otherwise.

    Parameters
    ----------
    quiet : bool
        Show nothing.
    stream : text file, optional
        Where to draw, ``sys.stderr`` by default.
    """
    stream = sys.stderr if stream is None else stream
    if quiet or not stream.isatty():
        yield None
        return
    try:
        from rich.console import Console
    except ImportError:
        bar: _PlainBar | _RichBar = _PlainBar(stream)
    else:
        bar = _RichBar(Console(file=stream))
    try:
        yield throttled(bar)
    finally:
        bar.close()


@contextmanager
def progress_bar() -> Iterator[Progress | None]:
    """A bar to hand to ``progress=``, in a notebook as in a terminal, removed at the end.

    Returns
    -------
    context manager of Progress or None
        None, which shows nothing, where output goes to a file or a pipe.

    Examples
    --------
    >>> import stretchmap as sm
    >>> with sm.progress_bar() as bar:
    ...     result = sm.volume_map(sm.samples.solid_torus(600), progress=bar)
    >>> result.certificate.certified
    True
    """
    if not _in_notebook():
        with terminal() as bar:
            yield bar
        return
    notebook = _NotebookBar()
    try:
        yield throttled(notebook)
    finally:
        notebook.close()


def _in_notebook() -> bool:
    """Whether this is a kernel whose front end shows HTML."""
    module = sys.modules.get("IPython")
    shell = module.get_ipython() if module is not None else None
    return shell is not None and shell.has_trait("kernel")


def _figures(values: dict[str, float]) -> str:
    return "  ".join(
        f"{name} {int(value) if float(value).is_integer() else format(value, '.4g')}"
        for name, value in values.items()
    )


class _PlainBar:
    """One line, redrawn."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._width = 0

    def __call__(self, stage: str, done: int, total: int, **values: float) -> None:
        count = f"{done}/{total}" if total else f"{done}"
        filled = round(20 * min(done / total, 1.0)) if total else 0
        line = f"{stage:<10.10} [{'#' * filled:<20}] {count}  {_figures(values)}"[:100]
        self._stream.write("\r" + line.ljust(self._width))
        self._stream.flush()
        self._width = len(line)

    def close(self) -> None:
        if self._width:
            self._stream.write("\r" + " " * self._width + "\r")
            self._stream.flush()


class _NotebookBar:
    """An HTML bar by IPython alone: those of rich and tqdm need ipywidgets in a notebook."""

    def __init__(self) -> None:
        self._handle: Any = None

    def __call__(self, stage: str, done: int, total: int, **values: float) -> None:
        from IPython.display import HTML, display

        at = f'value="{done}" max="{total}"' if total else ""
        count = f"{done}/{total}" if total else f"{done}"
        text = escape(f"{stage} {count}  {_figures(values)}")
        shown = HTML(f"<progress {at}></progress> <code>{text}</code>")
        if self._handle is None:
            self._handle = display(shown, display_id=True)
        else:
            self._handle.update(shown)

    def close(self) -> None:
        if self._handle is not None:
            from IPython.display import HTML

            self._handle.update(HTML(""))


class _RichBar:
    """The same through rich; the bar appears with the first call."""

    def __init__(self, console: Any) -> None:
        self._console = console
        self._bar: Any = None
        self._task: Any = None

    def __call__(self, stage: str, done: int, total: int, **values: float) -> None:
        if self._bar is None:
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[figures]}"),
                console=self._console,
                transient=True,
            )
            self._bar.start()
            self._task = self._bar.add_task(stage, figures="")
        self._bar.update(
            self._task,
            description=stage,
            completed=done,
            total=total or None,
            figures=_figures(values),
        )

    def close(self) -> None:
        if self._bar is not None:
            self._bar.stop()
