"""What of a volume map runs on one thread only, stage by stage.

    python bench/scaling.py [CASE ...] [--method certified|vsem] [--json FILE] [--write]

A case is a file of a mesh or a number of tets of a generated solid torus. The map is made with two
threads. The core counts the processor time that the first spends in loops that it shares; the rest
of its time is serial, whoever else uses the machine. A stage ends when its last step is reported;
what leads to its first step counts with it.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

from speed_page import METHODS, parser_of, run_worker, save, show, solid_of

LAST = "certificate, result"


class Stages:
    """A progress callback that shares out time among the stages it is told of."""

    def __init__(self) -> None:
        self.rows: dict[str, dict[str, float]] = {}
        self._then = self._now()

    @staticmethod
    def _now() -> tuple[float, float, float]:
        from stretchmap import _core

        alone = time.thread_time() - _core.base.shared_seconds()
        return time.perf_counter(), time.process_time(), alone

    def __call__(self, stage: str, done: int, total: int, **values: float) -> None:
        now = self._now()
        wall, both, alone = (b - a for a, b in zip(self._then, now, strict=True))
        row = self.rows.setdefault(stage, {"wall": 0.0, "processor": 0.0, "serial": 0.0})
        row["wall"] += wall
        row["processor"] += both
        row["serial"] += alone
        self._then = now


def worker(case: str, method: str) -> dict[str, Any]:
    """The map of one case in this process."""

    import stretchmap as sm

    # Modules imported on first use are none of the mesh's business.
    sm.volume_map(sm.samples.solid_torus(500), **METHODS[method])
    solid = solid_of(case)
    stages = Stages()
    result = sm.volume_map(solid, progress=stages, **METHODS[method])
    stages(LAST, 1, 1)
    return {
        "case": Path(case).stem,
        "method": method,
        "tets": solid.n_tets,
        "certified": result.certificate.certified,
        "stages": stages.rows,
    }


def table(rows: list[dict[str, Any]]) -> str:
    """A line per stage and case."""
    lines = [
        "| mesh | tets | method | stage | processor s | serial s | serial share |",
        "|---|---:|---|---|---:|---:|---:|",
    ]
    for row in rows:
        both = {key: 0.0 for key in ("processor", "serial")}
        for values in row["stages"].values():
            both = {key: total + values[key] for key, total in both.items()}
        for stage, values in [*row["stages"].items(), ("all", both)]:
            share = values["serial"] / max(values["processor"], 1e-9)
            lines.append(
                f"| {row['case']} | {row['tets']:,} | {row['method']} | {stage} "
                f"| {values['processor']:.2f} | {values['serial']:.2f} | {100.0 * share:.0f} % |"
            )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure or draw."""
    parser = parser_of(__doc__)
    parser.add_argument("cases", nargs="*", default=["100000"])
    parser.add_argument("--method", choices=list(METHODS), default="certified")
    options = parser.parse_args(arguments)
    if options.worker:
        print(json.dumps(worker(options.worker, options.method)))
        return 0
    if options.draw:
        rows = json.loads(options.draw.read_text())
    else:
        rows = [
            run_worker(__file__, [case, "--method", options.method], threads=2)
            for case in options.cases
        ]
    save(options.json, rows)
    show(options, "scaling", table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
