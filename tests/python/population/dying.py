"""Tasks that kill the process they run in."""

from __future__ import annotations

import os
import signal
from pathlib import Path


def die_at_two(path: Path) -> str:
    if path.name == "2":
        os.kill(os.getpid(), signal.SIGKILL)
    return path.name


def die_once_at_two(path: Path) -> str:
    if path.name == "2" and not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return path.name
