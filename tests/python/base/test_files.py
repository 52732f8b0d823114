"""Files appear whole, keep what they are, and nothing is left behind."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

import stretchmap as sm
from stretchmap.base import files
from stretchmap.base.files import atomic_path, open_to_read
from stretchmap.errors import FileFormatError

posix = pytest.mark.skipif(os.name == "nt", reason="modes, links and pipes of POSIX systems")


def write(path, text="new"):
    with atomic_path(path) as temporary:
        temporary.write_text(text)


@posix
def test_modes_and_links_are_kept(tmp_path):
    for mode in (0o600, 0o640, 0o755):
        path = tmp_path / "a.npz"
        path.write_text("old")
        path.chmod(mode)
        write(path)
        assert path.read_text() == "new" and stat.S_IMODE(path.stat().st_mode) == mode
    link = tmp_path / "link.npz"
    link.symlink_to("folder/../a.npz")
    (tmp_path / "folder").mkdir()
    write(link, "newer")
    assert link.is_symlink() and path.read_text() == "newer"
    dangling = tmp_path / "dangling.npz"
    dangling.symlink_to(tmp_path / "folder" / "b.npz")
    write(dangling)
    assert dangling.is_symlink() and (tmp_path / "folder" / "b.npz").read_text() == "new"


@posix
def test_a_new_file_has_the_mode_of_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        write(tmp_path / "a.npz")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.npz").stat().st_mode) == 0o640


@pytest.mark.parametrize("name", ["x" * 246 + ".npz", "ü" * 123 + ".npz", "a." + "s" * 200])
def test_long_names(tmp_path, name):
    write(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_failure_leaves_nothing(tmp_path):
    (tmp_path / "a.npz").write_text("old")
    with pytest.raises(ZeroDivisionError), atomic_path(tmp_path / "a.npz") as temporary:
        temporary.write_text("half")
        raise ZeroDivisionError
    assert (tmp_path / "a.npz").read_text() == "old" and len(list(tmp_path.iterdir())) == 1


@posix
def test_leftovers_of_a_killed_run_are_removed_and_running_ones_are_not(tmp_path):
    script = (
        "import sys, time\n"
        "from stretchmap.base.files import atomic_path\n"
        "with atomic_path(sys.argv[1]) as path:\n"
        "    path.write_text('half'); print('ready', flush=True); time.sleep(600)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(sm.__file__).parents[1])}
    runs, held = [], []
    try:
        for name in ("a.npz", "b.npz"):
            command = [sys.executable, "-c", script, tmp_path / name]
            runs.append(subprocess.Popen(command, stdout=subprocess.PIPE, env=environment))
            assert runs[-1].stdout.readline() == b"ready\n"
            held.append((set(tmp_path.iterdir()) - {*held}).pop())
        for path in held:
            os.utime(path, (time.time() - 3600,) * 2)
        runs[0].send_signal(signal.SIGKILL)
        runs[0].wait()
        (tmp_path / ".stretchmap-fresh.npz").write_text("just begun")
        write(tmp_path / "c.npz")
        assert set(tmp_path.iterdir()) == {
            held[1], tmp_path / "c.npz", tmp_path / ".stretchmap-fresh.npz",
        }  # fmt: skip
    finally:
        for run in runs:
            run.kill()
            run.communicate()


@posix
def test_pipes_and_devices_are_neither_read_nor_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "zero.stl").symlink_to("/dev/zero")
    (tmp_path / "zero.npz").symlink_to("/dev/zero")
    for name, read in (
        ("pipe.obj", sm.read), ("zero.stl", sm.read), ("zero.npz", sm.load_map),
        ("zero.npz", sm.certify_file), ("zero.npz", sm.read),
    ):  # fmt: skip
        with pytest.raises(FileFormatError, match="a pipe or a device"):
            read(tmp_path / name)
    for name in ("pipe.obj", "zero.stl"):
        with pytest.raises(FileFormatError, match="no file that can be replaced"):
            write(tmp_path / name)
    with pytest.raises(IsADirectoryError):
        write(tmp_path)
    with pytest.raises(IsADirectoryError, match=str(tmp_path)), open_to_read(tmp_path):
        pass
    before = len(os.listdir("/proc/self/fd")) if sys.platform == "linux" else 0
    for name in (".", "pipe.obj"):
        with pytest.raises((IsADirectoryError, FileFormatError)), open_to_read(tmp_path / name):
            pass
    assert not before or len(os.listdir("/proc/self/fd")) == before


def test_without_locks_the_temporary_file_is_closed_before_it_is_renamed(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "fcntl", None)
    closed, close = [], os.close
    monkeypatch.setattr(files.os, "close", lambda handle: (closed.append(handle), close(handle)))
    with atomic_path(tmp_path / "a.txt") as temporary:
        assert len(closed) == 1
        temporary.write_text("a", encoding="utf-8")
    assert len(closed) == 1 and (tmp_path / "a.txt").read_text(encoding="utf-8") == "a"


def test_a_full_disk_is_named(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    with pytest.raises(OSError, match="No space left") as caught, atomic_path(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert caught.value.filename == str(path)
    with pytest.raises(AttributeError), atomic_path(path):
        raise AttributeError
    monkeypatch.setattr(files.shutil, "disk_usage", lambda folder: type("U", (), {"free": 0}))
    with pytest.raises(OSError, match="No space left") as caught, atomic_path(path):
        raise AttributeError("of a writer that did not look")
    assert caught.value.filename == str(path) and not list(tmp_path.iterdir())
