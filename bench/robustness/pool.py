"""Jobs in processes of their own, each with a limit; what has a record is not run again."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from cases import Case
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from task import write_json

HERE = Path(__file__).resolve().parent
_DRAWING = 300.0  # seconds by the clock a mesh may take to be drawn
_DRAWINGS = 2  # tries: the meshers hang now and then, the same seed passes the second time
# Clock seconds per processor second allowed: a busy machine is no fault of the map.
_SLACK = 40.0


def run_process(command: list[str], threads: int, timeout: float) -> tuple[int, str]:
    """Exit code (negative: the signal) and the line of the exception it ended with."""
    env = os.environ | {"OMP_NUM_THREADS": str(threads)}
    # A session of its own, so that the helpers a task starts end with it.
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env,
        start_new_session=True,
    )  # fmt: skip
    try:
        _, complaint = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return -signal.SIGALRM, f"no end after {timeout:g} seconds"
    except BaseException:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    lines = complaint.strip().splitlines() or [""]
    # The text of an exception may go on over several lines, indented ones most of all.
    named = [line for line in lines if re.match(r"[\w.]*(Error|Exception|Rejected)\b", line)]
    return process.returncode, (named or lines)[-1]


def mesh_ready(case: Case) -> str:
    """Draw the mesh unless it is there; returns what went wrong."""
    if case.path.exists():
        return ""
    if case.seed is None:
        return "there is no such file"
    case.path.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, str(HERE / "draw.py"), case.group, str(case.seed)]
    command += ["--size", str(case.size), "--file", str(case.path)]
    for _ in range(_DRAWINGS):
        code, complaint = run_process(command, 1, _DRAWING)
        if code != -signal.SIGALRM:
            break
    return "" if code == 0 else f"not drawn: {complaint}"


def ending(job: dict[str, Any], code: int, complaint: str) -> str:
    """Why a process left no record."""
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"killed at {1e3 * job['per_element']:g} ms of processor time per element"
    return complaint if code == -signal.SIGALRM else f"ended with {code}: {complaint}"


def unfinished(job: dict[str, Any], reason: str, killed: bool = False) -> dict[str, Any]:
    """The record of a case that was not mapped."""
    kept = {key: job[key] for key in ("kind", "group", "name", "seed", "size")}
    return {**kept, "certified": False, "converged": False, "reason": reason, "killed": killed}


def run_case(case: Case, job: dict[str, Any], threads: int, script: Path) -> dict[str, Any]:
    """Record of one case, from its file if it was run before."""
    record = Path(job["record"])
    if record.exists():
        return json.loads(record.read_text())
    record.parent.mkdir(parents=True, exist_ok=True)
    complaint = mesh_ready(case)
    if not complaint and job.get("guide") and not Path(job["guide"]).exists():
        complaint = "there is no map without landmarks to place them by"
    if complaint:
        write_json(record, unfinished(job, complaint))
        return json.loads(record.read_text())
    size = case.path.stat().st_size / 40.0  # about the number of elements, for the clock's limit
    timeout = 120.0 + _SLACK * job["per_element"] * max(size, 5_000.0)
    code, complaint = run_process([sys.executable, str(script), json.dumps(job)], threads, timeout)
    if not record.exists():
        killed = code in (-signal.SIGXCPU, -signal.SIGKILL, -signal.SIGALRM)
        write_json(record, unfinished(job, ending(job, code, complaint), killed))
    return json.loads(record.read_text())


def run_all(
    cases: Sequence[Case],
    jobs: Sequence[dict[str, Any]],
    *,
    processes: int,
    threads: int,
    script: Path = HERE / "task.py",
    again: bool = False,
) -> list[dict[str, Any]]:
    """Records of all cases, in their order.

    Parameters
    ----------
    cases, jobs : sequence
        Job i runs on the mesh of case i.
    processes, threads : int
        Processes at a time, threads of each.
    script : Path
        What each process runs.
    again : bool
        Run also what has a record.
    """
    if again:
        for job in jobs:
            Path(job["record"]).unlink(missing_ok=True)
    records: list[dict[str, Any]] = [{}] * len(cases)
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    shown = [TextColumn(c) if isinstance(c, str) else c for c in columns]
    with Progress(*shown) as bar, ThreadPoolExecutor(processes) as pool:
        task = bar.add_task("", total=len(cases))
        waiting = {
            pool.submit(run_case, case, job, threads, script): i
            for i, (case, job) in enumerate(zip(cases, jobs, strict=True))
        }
        failed = 0
        for future in as_completed(waiting):
            i = waiting[future]
            records[i] = future.result()
            failed += not records[i]["certified"]
            bar.update(
                task, advance=1, description=f"{cases[i].group} {cases[i].name}, {failed} failed"
            )
    return records
