"""Damaged files of every format are read, in processes that may die, hang or run out of memory.

Run: python tests/attack/files.py [--count N] [--seed S] [--only FORMAT] [--keep FOLDER]

Every file must be read for what it says or be refused by an error of ours or the operating
system's. What went wrong is printed as it happens, the last line counts.
"""

from __future__ import annotations

import argparse
import importlib.util
import logging
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import vtk_forks
import watch
from formats import FORMATS, NEEDS, misread, sound
from mutation import mutant

LIMIT = 120.0  # seconds for one file; VTK, which takes some to load, has five of processor time


class _Notices(logging.Handler):
    """What the reader says of things it left out or changed."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if "left out" in record.getMessage() or "split" in record.getMessage():
            self.found.append(record.getMessage())


def serve() -> None:
    """The worker: one damaged file per job."""
    warnings.simplefilter("ignore")
    vtk_forks.read_in_forks()
    notices = _Notices()
    log = logging.getLogger("stretchmap")
    log.handlers, log.propagate = [notices], False
    log.setLevel(logging.INFO)
    seeds: dict[str, bytes] = {}
    folder = tempfile.TemporaryDirectory(prefix="stretchmap-attack-")

    def work(job: list[str | int]) -> tuple[str, str]:
        name, seed = str(job[0]), job[1]
        if name not in seeds:
            seeds[name] = sound(name)
        data = mutant(seeds[name], f"{name} {seed}") if seed != "sound" else seeds[name]
        path = Path(folder.name, f"file{FORMATS[name].suffix}")
        path.write_bytes(data)
        meshes: list[Any] = []
        notices.found.clear()
        outcome, detail = watch.outcome_of(lambda: meshes.append(FORMATS[name].read(path)))
        if seed == "sound" and outcome != watch.RETURNED:
            return watch.FOREIGN, f"the sound file is refused: {detail}"
        if outcome == watch.RETURNED and not notices.found:
            wrong = misread(name, data, meshes[0])
            return (watch.SILENT, wrong) if wrong else (outcome, detail)
        return outcome, detail

    with folder:
        watch.serve(work, watch.MEMORY // 2)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200, help="damaged files per format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="part of the name of a format")
    parser.add_argument("--keep", type=Path, help="folder for the files that do not go well")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        serve()
        return 0
    wanted = [name for name in FORMATS if options.only in name]
    names = [n for n in wanted if n not in NEEDS or importlib.util.find_spec(NEEDS[n])]
    if left_out := sorted(set(wanted) - set(names)):
        print(f"not installed, hence left out: {', '.join(left_out)}")
    first = options.seed * 1_000_000
    jobs: list[list[str | int]] = []
    for name in names:
        jobs += [[name, k] for k in ("sound", *range(first, first + options.count))]
    tally = watch.run(Path(__file__), jobs, LIMIT)
    if options.keep:
        options.keep.mkdir(parents=True, exist_ok=True)
        for (name, seed), *_ in tally.bad:
            data = mutant(sound(name), f"{name} {seed}") if seed != "sound" else sound(name)
            (options.keep / f"{name} {seed}{FORMATS[name].suffix}").write_bytes(data)
    accepted = tally.counts[watch.RETURNED]
    print(f"{accepted} read, {tally.counts.total() - accepted - len(tally.bad)} refused")
    print(tally.line("files"))
    return 1 if tally.bad else 0


if __name__ == "__main__":
    sys.exit(main())
