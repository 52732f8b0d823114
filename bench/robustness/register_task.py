"""One registration in a process of its own; called by `registrations`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import figures
import task

import stretchmap as sm
from stretchmap.registration.suggest import landmarks_between


def map_registration(source: sm.TetMesh, job: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Register the source to ``job["target"]``; landmarks by rule from an earlier map, if named."""
    target = task.load(job["target"])
    marks = None
    if job["guide"]:
        marks = landmarks_between(sm.load_map(job["guide"]), job["landmarks"])
    options = sm.FillOptions(time_limit=job["per_element"])
    result = sm.register(source, target, marks, keep_best=True, options=options)
    found = figures.of_solid_map(source, result)
    return result, found | {
        "landmarks": len(result.landmarks),
        "landmark_error": float(result.landmark_error),
        "boundary_splits": int(result.boundary_splits),
    }


if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    task.write_json(Path(job["record"]), task.run(job, {"register": map_registration}))
