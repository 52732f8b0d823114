"""Every public function is called with every hostile value for every argument.

Run: python tests/attack/calls.py [--rounds N] [--seed S] [--only NAME ...]

A round calls each function once with each hostile value for each argument, the others sound;
further rounds give hostile values to two arguments at a time, drawn at random. What went wrong is
printed as it happens; then follow the calls of each NAME, the last line counts them all.
"""

from __future__ import annotations

import argparse
import random
import sys
from pathlib import Path
from typing import Any

import watch
from hostile import HOSTILE
from table import Entry, Sound, entries

LIMIT = 60.0


def jobs(found: list[Entry], only: str, rounds: int, seed: int) -> list[list[Any]]:
    """[function, {parameter: name of a hostile value}]; with none of them a sound call."""
    every: list[list[Any]] = []
    draw = random.Random(seed)
    for entry in found:
        if only not in entry.name:
            continue
        every.append([entry.name, {}])
        values = {
            name: [v for v in HOSTILE[kind.rstrip("?")] if not (kind[-1] == "?" and v == "none")]
            for name, (kind, _) in entry.parameters.items()
        }
        every += [[entry.name, {name: value}] for name, of in values.items() for value in of]
        for _ in range((rounds - 1) * sum(map(len, values.values()))):
            chosen = draw.sample(sorted(values), min(2, len(values)))
            every.append([entry.name, {name: draw.choice(values[name]) for name in chosen}])
    return every


def serve() -> None:
    """The worker: one call per job."""
    sound = Sound()
    known = {entry.name: entry for entry in entries(sound)}

    def work(job: list[Any]) -> tuple[str, str]:
        name, hostile = job
        entry = known[name]
        arguments: dict[str, Any] = {}
        for parameter, (kind, make) in entry.parameters.items():
            given = parameter in hostile
            arguments[parameter] = (
                HOSTILE[kind.rstrip("?")][hostile[parameter]]() if given else make(sound)
            )
        function = entry.function(sound)
        outcome, detail = watch.outcome_of(lambda: _called(function, arguments))
        if hostile and outcome == watch.RETURNED:
            return watch.SILENT, detail
        if not hostile and outcome != watch.RETURNED:
            return watch.FOREIGN, f"the sound call fails: {detail}"
        return outcome, detail

    watch.serve(work)


def _called(function: Any, arguments: dict[str, Any]) -> None:
    result = function(**arguments)
    if hasattr(result, "__enter__"):  # checked on entry
        with result:
            pass


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=[""], help="parts of the names of functions")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        serve()
        return 0
    found = entries(Sound())
    rooms = {only: jobs(found, only, options.rounds, options.seed) for only in options.only}
    tally = watch.run(Path(__file__), [job for room in rooms.values() for job in room], LIMIT)
    for only, room in rooms.items():
        print(f"{only}: {len(room)}")
    print(tally.line("calls"))
    return 1 if tally.bad else 0


if __name__ == "__main__":
    sys.exit(main())
