"""Tasks that kill the process they run in."""

from __future__ import annotations

import os
import signal
from pathlib import Path

# Windows has no such signal, and ends a process by any it knows.
KILL = getattr(signal, "SIGKILL", signal.SIGTERM)


def die_at_two(path: Path) -> str:
    if path.name == "2":
        os.kill(os.getpid(), KILL)
    return path.name


def die_once_at_two(path: Path) -> str:
    if path.name == "2" and not path.exists():
        path.touch()
        os.kill(os.getpid(), KILL)
    return path.name
