"""Compare C++ benchmark and finished maps with a stored baseline, in units of what a machine does.

    python bench/regression.py [--executable FILE] [--margin 1.6] [--repeat 3]
    python bench/regression.py --update            # store a new baseline for this kind of processor

Seconds differ between machines and between quiet and busy hours, so no absolute time is compared,
and times are those of the processor. Besides the stages of the executable the area map of a surface
and a certified map are made by the package, as users make them.
Every stage is divided by the geometric mean of all stages of its run (the shape of the profile:
which stage got slower than the others), and that mean by the time the machine needs to copy as many
bytes as the assembly moves (all stages got slower together). Of every stage the best of several
runs counts. A baseline holds for one kind of processor, by the name it gives itself. Exit code 1 if
a ratio exceeds the stored one by more than the margin, or if an exact figure, such as the number of
flips, differs; 2 without executable or baseline.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import stretchmap as sm

HERE = Path(__file__).resolve().parent
BASELINE = HERE / "baseline.json"
SIZE = 100_000
MAP_SIZE = 10_000  # tets of the solid that is mapped by the package
GROUPS = "mesh,surface,linalg,volume,newton"
# Shorter stages measure the clock and the scheduler.
LEAST_MS = 1.0
EXACT = ("faces", "defects", "genus", "euler", "rows", "entries", "flips", "certified")


def find_executable(root: Path = HERE.parent) -> Path | None:
    """The newest built executable of this checkout, None if there is none."""
    found = [path for path in root.glob("build/*/stretchmap_bench*") if path.is_file()]
    return max(found, key=lambda path: path.stat().st_mtime, default=None)


def kind_of_processor() -> str:
    """What the processor calls itself."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def map_rows(size: int) -> list[dict[str, Any]]:
    """Finished maps of one generated solid, on one thread."""
    solid = sm.samples.vertebra_like(size)
    stages: dict[str, Callable[[], sm.AreaMap | sm.VolumeMap]] = {
        "map.area": lambda: sm.area_map(solid.surface),
        "map.certified": lambda: sm.volume_map(solid),
    }
    rows: list[dict[str, Any]] = []
    with sm.threads(1):
        for name, make in stages.items():
            begin = time.process_time()
            found = make()
            milliseconds = 1e3 * (time.process_time() - begin)
            flips, certified = found.distortion.flips, int(found.certificate.certified)
            row = {"name": f"{name}/{size}/threads:1", "cpu_time": milliseconds}
            rows.append({**row, "flips": flips, "certified": certified})
    return rows


def run(executable: Path, size: int, repeat: int) -> list[list[dict[str, Any]]]:
    """The rows of ``repeat`` runs on one thread, which neighbours disturb least."""
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "rows.json")
        arguments = ["--sizes", str(size), "--threads", "1", "--only", GROUPS, "--json", str(out)]
        for _ in range(repeat):
            subprocess.run([str(executable), *arguments], check=True, capture_output=True)
            rows = json.loads(out.read_text())["benchmarks"]
            runs.append(rows + map_rows(min(size, MAP_SIZE)))
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
            name, milliseconds = row["name"], row["cpu_time"]
            if name.startswith("bandwidth/"):
                busy = milliseconds / row["real_time"]  # the rest of the time it waited
                copy = min(copy, 1e3 * busy / row["bytes_per_second"])
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
    """Print the comparison; exit code 1 on a regression, 2 without executable or baseline."""
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
    kind = kind_of_processor()
    stored = json.loads(options.baseline.read_text()) if options.baseline.exists() else {}
    if not options.update and kind not in stored:
        print(f"no baseline for {kind}: store one with --update", file=sys.stderr)
        return 2
    now = summarize(run(options.executable, options.size, options.repeat))
    if options.update:
        options.baseline.write_text(json.dumps(stored | {kind: now}, indent=1) + "\n")
        print(f"stored {options.baseline}")
        return 0
    then = stored[kind]
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
