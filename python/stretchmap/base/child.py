"""What libraries do that may abort, or not end: in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

__all__ = ["run_script"]

# A library that does not give the interpreter back cannot be told that nobody waits any more.
_ENDS_WITH_PARENT = """
import sys
if sys.platform == "linux":
    import ctypes
    ctypes.CDLL(None).prctl(1, 9)  # PR_SET_PDEATHSIG, SIGKILL
"""


def run_script(
    script: str, options: dict[str, Any], folder: str | Path, timeout: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a Python script in a folder, with options as JSON in its first argument.

    It ends with this process, on Linux also if that is killed.

    Raises
    ------
    subprocess.TimeoutExpired
        It has not ended after ``timeout`` seconds; it is killed.
    """
    return subprocess.run(
        [sys.executable, "-c", _ENDS_WITH_PARENT + script, json.dumps(options)],
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=timeout,
        check=False,
    )
