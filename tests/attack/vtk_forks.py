"""VTK's reader in forks of a process that has loaded it, since loading takes a hundred readings."""

from __future__ import annotations

import functools
import os
import signal
import sys
import tempfile
import traceback
from pathlib import Path
from typing import NoReturn

import stretchmap as sm
from stretchmap.io import foreign


def read_in_forks() -> None:
    """From here on ``read_pyvista`` does in a fork what it does in a process of its own else."""
    foreign.run_vtk = _forked  # type: ignore[assignment]


@functools.cache
def _load() -> None:
    """What is loaded only by reading, by the parent, once: else it is by every fork."""
    import pyvista

    with tempfile.TemporaryDirectory() as folder:
        for name in ("sound.vtp", "sound.vtk"):
            path = Path(folder, name)
            sm.samples.torus_surface(8, 6).to_pyvista().save(path)
            grid = pyvista.read(path).cast_to_unstructured_grid()
            assert len(grid.celltypes) and len(grid.cell_connectivity) and len(grid.offset)


def _forked(path: Path, out: Path) -> tuple[int, str]:
    _load()
    said = out.with_name("said")
    pid = os.fork()
    if pid == 0:
        _read_and_exit(path, out, said)
    status = os.waitpid(pid, 0)[1]
    text = said.read_text(errors="replace") if said.exists() else ""
    return os.waitstatus_to_exitcode(status), text


def _read_and_exit(path: Path, out: Path, said: Path) -> NoReturn:
    code = 1
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT), 2)
        os.chdir(out.parent)
        sys.argv = ["-c", str(path.resolve()), str(out)]
        exec(compile(foreign.VTK_SCRIPT, "vtk", "exec"), {"__name__": "__main__"})
        code = 0
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
    finally:
        os._exit(code)
