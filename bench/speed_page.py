"""What the benchmarks with a table on docs/speed.md share: a process per case, rows, the page."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parent / "python"
PAGE = HERE.parent / "docs" / "speed.md"
METHODS: dict[str, dict[str, Any]] = {
    "certified": {},
    "vsem": {"method": "vsem", "c": 10.0, "max_iter": 20},
}


def parser_of(text: str | None) -> argparse.ArgumentParser:
    """With what all of them take."""
    parser = argparse.ArgumentParser(description=(text or "").splitlines()[0])
    parser.add_argument("--json", type=Path, help="where the rows go")
    parser.add_argument("--draw", type=Path, help="rows to draw the table of, instead of measuring")
    parser.add_argument("--write", action="store_true", help="put the table on docs/speed.md")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    return parser


def sample_of(case: str) -> tuple[str, int]:
    """Kind and number of tets of a sample, "9000" or "bumpy:9000"; 0 tets of anything else."""
    kind, _, size = case.rpartition(":")
    return (kind or "torus"), int(size) if size.isdigit() else 0


def solid_of(case: str) -> Any:
    """The solid of a case: a sample, or a file."""
    import numpy as np

    import stretchmap as sm

    kind, n_tets = sample_of(case)
    if n_tets:
        return {"torus": sm.samples.solid_torus, "bumpy": sm.samples.bumpy_torus}[kind](n_tets)
    with np.load(case) as arrays:
        return sm.TetMesh(arrays["V"], arrays["T"])


def run_worker(
    script: str, arguments: list[str], threads: int, package: Path = PACKAGE
) -> dict[str, Any]:
    """The row a script prints last, run by itself as ``--worker`` with the package of a folder.

    Threads sleep while they have nothing to do, OpenMP's of earlier versions as well, so that
    processor time is that of work.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": str(package),
        "OMP_NUM_THREADS": str(threads),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_WAIT_POLICY": "passive",
    }
    command = [sys.executable, str(Path(script).resolve()), "--worker", *arguments]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def save(file: Path | None, data: Any) -> None:
    """All there is so far, in the file if one is asked for."""
    if file:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(data, indent=1) + "\n")


def show(options: argparse.Namespace, name: str, text: str) -> None:
    """The table, and between its two marks on the page if that is asked for."""
    print(text)
    if options.write:
        begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
        head, rest = PAGE.read_text().split(begin)
        PAGE.write_text(head + begin + "\n\n" + text + "\n\n" + end + rest.split(end)[1])
