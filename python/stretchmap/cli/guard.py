"""Around every command: exit codes, one sentence on standard error, quick interruption."""

from __future__ import annotations

import errno
import logging
import os
import re
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..errors import Cancelled, SolverError, StretchmapError

SUCCESS, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130

# Seconds an interrupted computation gets to clean up before the process ends all the same.
_GRACE = 1.0
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
_NO_FAULT_OF_THE_INPUT = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE
}  # fmt: skip


def guarded(run: Callable[[], object]) -> int:
    """Call ``run`` and turn its outcome into an exit code, and an exception into one sentence.

    Parameters
    ----------
    run : callable
        May return an exit code.

    Returns
    -------
    int
    """
    try:
        with _warnings_on_stderr(), _ended_like_interrupted(), _quick_interrupt():
            code = run()
        if code == INTERRUPTED:  # typer has seen it first
            raise KeyboardInterrupt
        return code if isinstance(code, int) else SUCCESS
    except (KeyboardInterrupt, Cancelled):
        # One that came out of an ``exec`` of a string, as dataclasses are made by, Python counts as
        # unhandled until the next, and ends a module it runs by SIGINT whatever the exit code.
        exec("")
        return _say("interrupted", INTERRUPTED)
    except BrokenPipeError:
        # The reader of our output is gone; nothing more may be written, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except SolverError as error:
        return _say(in_words_of_the_command_line(str(error)), FAILED)
    except StretchmapError as error:
        return _say(in_words_of_the_command_line(str(error)), MISUSED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        code = FAILED if error.errno in _NO_FAULT_OF_THE_INPUT else MISUSED
        return _say(f"{where}{error.strerror or error}", code)
    except MemoryError:
        return _say("not enough memory", FAILED)
    except Exception as error:
        usage = getattr(error, "format_message", None)
        if usage is not None:  # raised by typer; where its class lives depends on the version
            said = usage().rstrip()
            said += "" if said.endswith((".", "?")) else "."
            return _say(f"{said} Try --help.", MISUSED)
        if os.environ.get("STRETCHMAP_DEBUG"):
            raise
        name = type(error).__name__
        return _say(f"internal error, {name}: {error}; set STRETCHMAP_DEBUG=1 to see where", FAILED)


def in_words_of_the_command_line(message: str) -> str:
    """Python's ``name=True`` and ``name='value'`` in a message as the options they are here."""
    message = re.sub(r"\b(\w+)=True\b", lambda m: "--" + m[1].replace("_", "-"), message)
    message = re.sub(r"\b(\w+)='(\w+)'", lambda m: f"--{m[1].replace('_', '-')} {m[2]}", message)
    return message.replace("compact() does", "--compact does")


def _say(message: str, code: int) -> int:
    kind = "" if code == INTERRUPTED else "error: "
    print(f"stretchmap: {kind}{' '.join(message.split())}", file=sys.stderr)
    return code


class _OneLine(logging.Handler):
    """Warnings of the library, one line each, to whatever standard error is at the time."""

    def emit(self, record: logging.LogRecord) -> None:
        text = in_words_of_the_command_line(record.getMessage())
        print(f"stretchmap: {record.levelname.lower()}: {text}", file=sys.stderr)


@contextmanager
def _warnings_on_stderr() -> Iterator[None]:
    logger = logging.getLogger("stretchmap")
    handler, before = _OneLine(logging.WARNING), logger.propagate
    logger.addHandler(handler)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = before


@contextmanager
def _ended_like_interrupted() -> Iterator[None]:
    """Let what asks a process to end do so by Ctrl-C's way: nothing is left behind."""
    in_main = threading.current_thread() is threading.main_thread()
    ours = [s for s in _ENDING if in_main and signal.getsignal(s) == signal.SIG_DFL]
    for each in ours:
        signal.signal(each, signal.default_int_handler)
    try:
        yield
    finally:
        for each in ours:
            signal.signal(each, signal.SIG_DFL)


@contextmanager
def _quick_interrupt() -> Iterator[None]:
    """End the process soon after Ctrl-C even while a long call keeps Python from noticing it.

    Python raises KeyboardInterrupt between two of its own instructions. The signal itself writes
    to a socket at once; a thread that reads it waits a little and then ends the process. Output
    files are safe: they appear by renaming only.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    before = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    done = threading.Event()

    def watch() -> None:
        while True:
            received = reader.recv(1)
            if not received:
                return
            if received[0] in (signal.SIGINT, *_ENDING) and not done.wait(_GRACE):
                os.write(2, b"stretchmap: interrupted\n")
                os._exit(INTERRUPTED)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        signal.set_wakeup_fd(before)
        writer.close()
        watcher.join()
        reader.close()
