"""Scripts in a process of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stretchmap.base.child import run_script


def test_a_script_gets_its_options_in_its_folder(tmp_path):
    script = "import json, pathlib\npathlib.Path('found').write_text(json.loads(sys.argv[1])['a'])"
    assert run_script(script, {"a": "b"}, tmp_path).returncode == 0
    assert (tmp_path / "found").read_text() == "b"


def test_one_that_does_not_end_is_killed(tmp_path):
    with pytest.raises(subprocess.TimeoutExpired):
        run_script("import time\ntime.sleep(60)", {}, tmp_path, timeout=0.5)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells children")
def test_it_ends_with_a_parent_that_is_killed(tmp_path):
    child = "import os, pathlib, time; pathlib.Path('pid').write_text(str(os.getpid())); "
    code = (
        "from stretchmap.base.child import run_script\n"
        f"run_script({child + 'time.sleep(60)'!r}, {{}}, {str(tmp_path)!r})"
    )
    with subprocess.Popen([sys.executable, "-c", code]) as parent:
        pid = _appears(tmp_path / "pid")
        parent.send_signal(signal.SIGKILL)
    for _ in range(100):
        if not _runs(pid):
            return
        time.sleep(0.05)
    os.kill(pid, signal.SIGKILL)
    pytest.fail("it went on")


def _appears(file: Path) -> int:
    for _ in range(600):
        if file.exists() and (text := file.read_text()):
            return int(text)
        time.sleep(0.05)
    raise AssertionError("it did not begin")


def _runs(pid: int) -> bool:
    stat = Path(f"/proc/{pid}/stat")
    try:
        return stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
