"""One step of a run: the template mapped onto one shape, as files.

A task reads what it needs from the run folder and leaves a map and a record there, the record last.
One that finds the record of the same inputs has nothing to do; so a run can be taken up again, and
an executor may start a task twice.
"""

from __future__ import annotations

import hashlib
import json
import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..base.files import atomic_path
from ..base.tables import plain_dict
from ..base.threads import threads
from ..deformation.fitting import Anchors, Template
from ..deformation.pose import looks_mirrored
from ..errors import LandmarkError, MissingDependencyError, StretchmapError
from ..io.reading import read_solid
from ..registration.mirror import MIRROR_ADVICE, mirrored_landmarks
from .correspondence import Along, correspond
from .shapes import Shape

__all__ = ["Job", "Record", "failed", "map_file", "run_job"]

Record = dict[str, Any]

# What another run, on another machine or after something was installed, need not meet again.
_OF_THE_MACHINE = (MissingDependencyError, OSError, MemoryError)


@dataclass(frozen=True, eq=False)
class Job:
    """What `run_job` needs; travels to other processes and machines.

    Attributes
    ----------
    shape : Shape
    folder : Path
        Of the run; all workers see it.
    round : int
    template : str
        Digest of the file ``template-ROUND.npz``.
    warm : bool
        Start from the map of the round before.
    along, volume_weight
        As in `correspond`.
    """

    shape: Shape
    folder: Path = field(repr=False)
    round: int
    template: str = field(repr=False)
    warm: bool
    along: Along
    volume_weight: float

    @property
    def map_file(self) -> Path:
        """From the template of this round to the shape."""
        return map_file(self.folder, self.shape.name, self.round)

    @property
    def image_file(self) -> Path:
        """Where the template's vertices go in this round, and where smoothly."""
        return self.folder / "images" / f"{self.shape.name}-{self.round}.npy"

    @property
    def image_before(self) -> Path:
        """The same in the round before."""
        return self.folder / "images" / f"{self.shape.name}-{self.round - 1}.npy"

    @property
    def record_file(self) -> Path:
        """Of the shape in this round."""
        return self.folder / "records" / f"{self.shape.name}-{self.round}.json"

    def key(self) -> str:
        """Digest of all that the outcome depends on."""
        before = self.image_before
        start = before.read_bytes() if self.warm and before.exists() else b""
        text = (self.shape.digest(), self.template, hashlib.sha256(start).hexdigest(), __version__)
        options = (self.round, self.along, self.volume_weight)
        return hashlib.sha256(repr((text, options)).encode()).hexdigest()


def map_file(folder: Path, name: str, number: int) -> Path:
    """Where a run keeps the map of a round's template to a shape."""
    return folder / "maps" / f"{name}-{number}.npz"


def run_job(job: Job) -> Record:
    """Map the template onto the shape, unless it has been done; returns the record.

    What is wrong with a shape goes into its record: one bad file does not end a run.
    """
    key = job.key()
    done = _done(job, key)
    if done is not None:
        return done
    clock = time.perf_counter()
    try:
        with threads(1), _one_blas_thread():
            record = _mapped(job)
    except (StretchmapError, OSError, MemoryError) as error:
        record = failed(job, f"{type(error).__name__}: {error}")
        record["once_more"] = isinstance(error, _OF_THE_MACHINE)
    record |= {"key": key, "seconds": time.perf_counter() - clock}
    _write(job, record)
    return record


def _one_blas_thread() -> AbstractContextManager[Any]:
    """Where threadpoolctl is installed: workers of a cluster often have one, this process more."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return nullcontext()
    limits: AbstractContextManager[Any] = threadpool_limits(1, user_api="blas")
    return limits


def failed(job: Job, error: str) -> Record:
    """The record of a shape that is skipped."""
    return {"name": job.shape.name, "round": job.round, "ok": False, "error": error}


def _mapped(job: Job) -> Record:
    template = _template(job.folder / f"template-{job.round}.npz", job.template)
    solid, marks = job.shape.load(), job.shape.load_landmarks()
    if marks is not None and template.anchors is not None:
        wanted = len(template.anchors.faces)
        if len(marks) != wanted:
            raise LandmarkError(f"{len(marks)} landmarks, the template has {wanted}")
        surface = template.solid.surface
        mirrored = mirrored_landmarks(template.anchors.at(surface.V, surface.F), marks)
        if mirrored:
            raise LandmarkError(mirrored)
    start = None
    if job.warm and job.image_before.exists():
        start = np.load(job.image_before)[0, template.solid.boundary_vertices]
    found = correspond(
        template, solid, start=start, landmarks=marks, along=job.along,
        volume_weight=job.volume_weight,
    )  # fmt: skip
    found.save(job.map_file)
    with atomic_path(job.image_file) as temporary, open(temporary, "wb") as file:
        np.save(file, np.stack([found.image[: template.solid.n_vertices], found.smooth]))
    # An average of shapes some of which are mirrored is as good as symmetric and does not tell.
    doubtful = job.round == 0 and marks is None
    doubtful = doubtful and looks_mirrored(template.solid.surface, solid.surface)
    return {
        "name": job.shape.name,
        "round": job.round,
        "ok": True,
        "doubt": f"closer to the template after a reflection: {MIRROR_ADVICE}" if doubtful else "",
        "n_tets": solid.n_tets,
        "volume": solid.volume,
        "certified": found.certificate.certified,
        "along": found.along,
        "note": found.note,
        "distance": found.distance,
        "flips": found.distortion.flips,
        "volume_ratio_std": found.distortion.element_std,
    }


@lru_cache(maxsize=2)
def _template(path: Path, digest: str) -> Template:
    """Read once by each process; the digest tells apart files of one name."""
    solid = read_solid(path)
    with np.load(path) as data:
        if "landmark_faces" not in data:
            return Template(solid)
        weights: NDArray[np.float64] = data["landmark_weights"]
        return Template(solid, Anchors(data["landmark_faces"], weights))


def _done(job: Job, key: str) -> Record | None:
    try:
        record = json.loads(job.record_file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(record, dict) or record.get("key") != key or record.get("once_more"):
        return None
    there = job.image_file.exists() and job.map_file.exists()
    return record if there or not record.get("ok") else None


def _write(job: Job, record: Record) -> None:
    with atomic_path(job.record_file) as temporary:
        temporary.write_text(json.dumps(plain_dict(record), indent=1), encoding="utf-8")
