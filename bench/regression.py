"""Compare the C++ benchmark with the stored baseline, in units of what this machine does.

    python bench/regression.py [--executable FILE] [--margin 1.6] [--repeat 3]
    python bench/regression.py --update            # store a new baseline

Seconds differ between machines and between quiet and busy hours, so no absolute time is compared.
Every stage is divided by the geometric mean of all stages of its run (the shape of the profile:
which stage got slower than the others), and that mean by the time the machine needs to copy as many
bytes as the assembly moves (all stages got slower together). Of every stage the best of several
runs counts. Exit code 1 if a ratio exceeds the stored one by more than the margin, or if an exact
figure, such as the number of flips, differs.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
BASELINE = HERE / "baseline.json"
SIZE = 100_000
GROUPS = "mesh,linalg,volume"
# Shorter stages measure the clock and the scheduler.
LEAST_MS = 1.0
EXACT = ("faces", "defects", "genus", "euler", "rows", "entries", "flips")


def find_executable(root: Path = HERE.parent) -> Path | None:
    """The newest built executable of this checkout, None if there is none."""
    found = [path for path in root.glob("build/*/stretchmap_bench*") if path.is_file()]
    return max(found, key=lambda path: path.stat().st_mtime, default=None)


def run(executable: Path, size: int, repeat: int) -> list[list[dict[str, Any]]]:
    """The rows of ``repeat`` runs on one thread, which neighbours disturb least."""
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "rows.json")
        arguments = ["--sizes", str(size), "--threads", "1", "--only", GROUPS, "--json", str(out)]
        for _ in range(repeat):
            subprocess.run([str(executable), *arguments], check=True, capture_output=True)
            runs.append(json.loads(out.read_text())["benchmarks"])
    return runs


def summarize(runs: list[list[dict[str, Any]]]) -> dict[str, Any]:
    """Ratios and exact figures of several runs of the same stages.

    Returns
    -------
    dict
        ``overall``: geometric mean of the stages over the time of a copy; ``stages``: each stage
        over that mean; ``exact``: figures that have to agree to the last digit.
    """
    best: dict[str, float] = {}
    exact: dict[str, float] = {}
    copy = math.inf
    for rows in runs:
        for row in rows:
            name, milliseconds = row["name"], row["real_time"]
            if name.startswith("bandwidth/"):
                copy = min(copy, 1e3 / row["bytes_per_second"])
            elif not name.startswith("sample/"):
                best[name] = min(milliseconds, best.get(name, math.inf))
                exact |= {f"{name} {key}": row[key] for key in EXACT if key in row}
    moved = next(row["bytes"] for row in runs[0] if row["name"].startswith("volume.assemble/"))
    mean = math.exp(sum(map(math.log, best.values())) / len(best))
    stages = {name: value / mean for name, value in best.items() if value >= LEAST_MS}
    return {"overall": mean / (moved * copy), "stages": stages, "exact": exact}


def regressions(now: dict[str, Any], then: dict[str, Any], margin: float) -> list[str]:
    """What got worse, one line each; empty if nothing did."""
    lines = []
    # The copy is one number against all the stages: noise of its own on top of theirs.
    if now["overall"] > margin**2 * then["overall"]:
        lines.append(f"all stages: {now['overall'] / then['overall']:.2f} times the baseline")
    for name, share in then["stages"].items():
        if name not in now["stages"]:
            continue  # below the clock's noise by now
        ratio = now["stages"][name] / share
        if ratio > margin:
            lines.append(f"{name}: {ratio:.2f} times the baseline")
    for name, value in then["exact"].items():
        if now["exact"].get(name) != value:
            lines.append(f"{name}: {now['exact'].get(name)} instead of {value}")
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Print the comparison; exit code 1 on a regression, 2 without an executable."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--executable", type=Path, default=find_executable())
    parser.add_argument("--baseline", type=Path, default=BASELINE)
    parser.add_argument("--size", type=int, default=SIZE, help="tets; those of the baseline")
    parser.add_argument("--margin", type=float, default=1.6, help="ratio still taken for noise")
    parser.add_argument("--repeat", type=int, default=3, help="runs; the best of them counts")
    parser.add_argument("--update", action="store_true", help="store this run as the baseline")
    options = parser.parse_args(arguments)
    if options.executable is None or not options.executable.exists():
        print("no stretchmap_bench; build it first (bench/README.md)", file=sys.stderr)
        return 2
    now = summarize(run(options.executable, options.size, options.repeat))
    if options.update:
        options.baseline.write_text(json.dumps(now, indent=1) + "\n")
        print(f"stored {options.baseline}")
        return 0
    then = json.loads(options.baseline.read_text())
    print(f"{'':44}{'now':>10}{'baseline':>10}{'ratio':>8}")
    rows = {"all stages": (now["overall"], then["overall"])}
    rows |= {name: (now["stages"].get(name), share) for name, share in then["stages"].items()}
    for name, (value, share) in rows.items():
        if value is not None:
            print(f"{name:44}{value:10.3f}{share:10.3f}{value / share:8.2f}")
    found = regressions(now, then, options.margin)
    print("\n".join(f"REGRESSION {line}" for line in found) or "no regression")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
