"""Files: those read are files, those written appear whole or not at all."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ..errors import FileFormatError, KindError, StretchmapError
from .options import as_path

try:
    import fcntl
except ImportError:  # Windows: leftovers are not told from files being written, and stay
    fcntl = None  # type: ignore[assignment]

_PREFIX = ".stretchmap-"
_LEFT_OVER = 60.0  # seconds after which a file nobody holds counts as left over
_FULL = 1 << 20  # bytes below which a failure is put down to the disk


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside ``path``, renamed to it at the end and removed on failure.

    A file that is replaced keeps its mode, and a link to it stays a link. What a killed process
    has left in the folder is removed.

    Parameters
    ----------
    path : path-like
        Where the finished file goes; its suffix is kept.

    Raises
    ------
    FileFormatError
        There is something else of that name, such as a pipe or a device.
    OSError
        The file cannot be written; names it.
    """
    path = as_path(path)
    final = Path(os.path.realpath(path))
    mode = _mode(final)
    _remove_leftovers(final.parent)
    suffix = final.suffix if len(os.fsencode(final.suffix)) < 64 else ""
    try:
        handle, name = tempfile.mkstemp(prefix=_PREFIX, suffix=suffix, dir=final.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    temporary = Path(name)
    if fcntl is None:
        os.close(handle)  # no open file can be renamed there
    try:
        if fcntl is not None:
            fcntl.flock(handle, fcntl.LOCK_SH)  # for as long as the file is being written
        with _naming(path):
            yield temporary
            temporary.chmod(mode)
            os.replace(temporary, final)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    finally:
        if fcntl is not None:
            os.close(handle)


@contextmanager
def open_to_read(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A file opened for reading bytes; a pipe or a device, which may never end, is refused.

    Raises
    ------
    FileFormatError
        It is none.
    OSError
        It cannot be opened.
    """
    path = as_path(path)
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    mode = os.fstat(handle).st_mode
    if not stat.S_ISREG(mode):
        os.close(handle)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        raise FileFormatError(f"{path} is a pipe or a device; save what comes from it first")
    with os.fdopen(handle, "rb") as file:
        yield file


@contextmanager
def parsing(path: Path) -> Iterator[None]:
    """Turn whatever a parser raises into one error that names the file."""
    try:
        yield
    except (FileFormatError, KindError) as error:
        raise FileFormatError(f"{path} cannot be read: {error}") from error
    except StretchmapError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise FileFormatError(f"{path} is damaged or not what its name says: {reason}") from error


def _mode(final: Path) -> int:
    """Mode of the file to be replaced, or that of a new one."""
    try:
        found = final.stat().st_mode
    except FileNotFoundError:
        umask = os.umask(0)
        os.umask(umask)
        return 0o666 & ~umask
    if stat.S_ISDIR(found):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(final))
    if not stat.S_ISREG(found):
        raise FileFormatError(f"{final} is a pipe or a device, no file that can be replaced")
    if not os.access(final, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(final))
    return stat.S_IMODE(found)


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Errors of writing, with the name of the file; a full disk is told whatever hides it."""
    try:
        yield
    except StretchmapError:
        raise
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
    except Exception as error:
        if shutil.disk_usage(path.parent).free > _FULL:
            raise
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path)) from error


def _remove_leftovers(folder: Path) -> None:
    """Delete old temporary files that no process holds a lock on."""
    if fcntl is None:
        return
    now = time.time()
    for path in folder.glob(f"{_PREFIX}*"):
        try:
            if path.is_symlink() or now - path.stat().st_mtime < _LEFT_OVER:
                continue
            with path.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()
        except OSError:  # held, gone or not ours
            continue
