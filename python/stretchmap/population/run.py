"""A population from its shapes: template, correspondences, mean, modes."""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import read_only
from ..base.files import atomic_path
from ..base.options import as_path, callback, flag, one_of, real, shown, whole
from ..base.progress import Progress, report
from ..deformation.fitting import Anchors
from ..errors import LandmarkError, OptionError, SolverError, StretchmapError
from ..io.npz import save_npz
from ..mesh.given import as_solid
from ..mesh.meshes import TetMesh
from ..mesh.refinement import refine_overconstrained
from .correspondence import Along
from .executors import Executor, as_executor
from .mean import certified_mean, movement
from .procrustes import generalized_procrustes
from .result import Population
from .run_folder import prepare_folder
from .shape_model import shape_model
from .shapes import Shape, gather_landmarks, gather_shapes, require_landmarks
from .task import Job, Record, failed, run_job

__all__ = ["fit"]

_log = logging.getLogger("stretchmap")

_COLD_ROUNDS = 2  # in which every shape is laid on the template anew; then from where it was
_TEMPLATE = "template"  # name of its landmarks, if it is none of the shapes
_OTHER_UNIT = 5.0  # times longer or shorter than the median

Array = NDArray[np.float64]
Solids = str | Path | Sequence[Any] | Mapping[str, Any]


def fit(
    solids: Solids,
    template: TetMesh | str | Path | None = None,
    landmarks: Any = None,
    *,
    folder: str | Path | None = None,
    executor: str | Executor | None = None,
    along: Along = "smooth",
    scale: bool = True,
    volume_weight: float = 1.0,
    max_rounds: int = 6,
    tol: float = 1e-3,
    progress: Progress | None = None,
) -> Population:
    """Bring shapes into correspondence, find their mean and the modes by which they differ.

    A template is mapped onto every shape, the images are brought into one pose and averaged, and
    the average is the next template, until it stays where it is.

    Parameters
    ----------
    solids : folder, or sequence or mapping of TetMesh and paths
        Solid tori. Files are read one at a time, when their turn comes.
    template : TetMesh, name of a shape, or path, optional
        Where to start; the first shape that can be read by default. Its mesh is that of the result,
        with vertices put in after its own where the boundary alone would decide about a tet.
    landmarks : folder of NAME.csv, mapping by name, or array_like (k, l, 3), optional
        Points on the surfaces that correspond. A template that is none of the shapes has its own
        under the name ``"template"``.
    folder : path, optional
        The run folder: a JSON record of every shape and round, a map of every shape. A run that was
        stopped goes on where it was, with the same result; shapes may be added. Without it the maps
        are kept in a temporary folder and thrown away.
    executor : {"serial", "processes", "processes:N", "dask://host:port"}, client or object
        Where shapes are mapped. The result does not depend on it, to the last bit, unless a map
        runs short of time.
    along : {"smooth", "area"}
        What decides where points go along the surface, see `correspond`.
    scale : bool
        Take out size as well as pose.
    volume_weight : float
        See `correspond`.
    max_rounds : int
        Most rounds.
    tol : float
        The template is at rest when averaging moves its surface along the normals by no more than
        this share of its size, root mean square.
    progress : Progress, optional
        Called once per shape and round.

    Returns
    -------
    Population

    Raises
    ------
    OptionError
        An option out of range, names that are not unique, or a folder that holds another run or
        the shapes.
    LandmarkError
        A folder has landmarks of fewer than two shapes.
    SolverError
        Fewer than two shapes could be mapped; the message has the first reason.
    CertificationError
        The mean cannot be made free of flipped tets.

    Notes
    -----
    A shape that cannot be read or mapped is skipped: it is in ``skipped`` with the reason; so is
    one whose landmarks are those of a mirror image. One that is mapped though it looks mirrored, or
    far larger or smaller than the others, is in ``doubts``.
    Groupwise mean after Joshi, Davis, Jomier, Gerig, NeuroImage 23, 2004, with correspondences in
    place of diffeomorphisms.

    Examples
    --------
    >>> import stretchmap as sm
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:3], max_rounds=1)
    >>> found.correspondences.shape == (3, bones.solids[0].n_vertices, 3)
    True
    """
    one_of("along", along, ("smooth", "area"))
    scale, tol = flag("scale", scale), real("tol", tol, 0.0)
    volume_weight = real("volume_weight", volume_weight, above=0.0)
    max_rounds = whole("max_rounds", max_rounds, 1, 1000)
    callback("progress", progress)
    workers = as_executor(executor)
    shapes = gather_landmarks(gather_shapes(solids), landmarks)
    if not shapes:
        raise OptionError("no shapes are given; two are needed at least")
    if folder is not None and isinstance(solids, (str, os.PathLike)):
        if os.path.realpath(as_path(folder)) == os.path.realpath(as_path(solids)):
            raise OptionError(
                f"the run folder {shown(str(folder))} is that of the shapes: what a run leaves "
                "would be taken for shapes; name another one"
            )
    require_landmarks(shapes)
    solid, marks, chosen = _start(shapes, template, landmarks)
    # Where all corners of a tet lie on the boundary only new vertices inside can keep it upright;
    # put in once they are in every map and in the mean.
    solid = refine_overconstrained(solid).solid
    with ExitStack() as stack:
        place = (
            Path(stack.enter_context(tempfile.TemporaryDirectory()))
            if folder is None
            else as_path(folder).absolute()
        )
        settings = {"along": along, "scale": scale, "volume_weight": volume_weight}
        prepare_folder(place, settings | {"template": chosen}, shapes)
        anchors = None if marks is None else Anchors.of(solid.surface, marks)
        run = _Run(place, shapes, workers, along, scale, volume_weight, progress)
        found = run.until_at_rest(solid, anchors, max_rounds, tol)
    return replace(found, folder=None) if folder is None else found


def _start(
    shapes: list[Shape], template: Any, landmarks: Any
) -> tuple[TetMesh, Array | None, str | None]:
    """The first template, its landmarks, and its digest unless it is the default."""
    if template is None:
        reasons, unmarked = [], []
        for shape in shapes:
            try:
                return shape.load(), shape.load_landmarks(), None
            except LandmarkError:
                unmarked.append(shape.name)
            except (StretchmapError, OSError) as error:
                reasons.append(f"{shape.name}: {error}")
        why = reasons[:1]
        if unmarked:
            names = f"{', '.join(unmarked[:5])}{', ...' if len(unmarked) > 5 else ''}"
            why.append(
                f"{len(unmarked)} of {len(shapes)} have no landmarks in {landmarks}: {names}"
            )
        raise SolverError(f"no shape can be read; {'; '.join(why)}")
    for shape in shapes:
        if isinstance(template, str) and shape.name == template:
            return shape.load(), shape.load_landmarks(), shape.digest()
    if isinstance(template, (str, os.PathLike)):
        path = as_path(template).absolute()
        if not path.exists():
            raise OptionError(
                f"template {str(template)!r} is neither the name of a shape "
                f"({', '.join(s.name for s in shapes[:5])}{', ...' if len(shapes) > 5 else ''}) "
                "nor a file"
            )
        own = Shape(_TEMPLATE, path)
    else:
        own = Shape(_TEMPLATE, as_solid(template, "template"))
    if landmarks is not None:
        if not isinstance(landmarks, (str, os.PathLike, Mapping)):
            raise OptionError(
                "a template that is none of the shapes needs landmarks of its own: pass a mapping "
                f"or a folder with those of {_TEMPLATE!r}"
            )
        (own,) = gather_landmarks([own], landmarks)
    return own.load(), own.load_landmarks(), own.digest()


@dataclass
class _Run:
    """What stays the same from round to round."""

    folder: Path
    shapes: list[Shape]
    executor: Executor
    along: Along
    scale: bool
    volume_weight: float
    progress: Progress | None
    faults: dict[int, str] = field(default_factory=dict)  # of shapes, in the last round
    doubts: dict[str, str] = field(default_factory=dict)  # by name, from the first round

    def until_at_rest(
        self, solid: TetMesh, anchors: Anchors | None, max_rounds: int, tol: float
    ) -> Population:
        """Rounds until the template stays where it is."""
        moved: list[float] = []
        for number in range(max_rounds):
            records, images, smooth = self._round(number, solid, anchors)
            poses = generalized_procrustes(images, scale=self.scale, start=solid.V)
            # Smooth deformations are averaged: points that were put onto surfaces crowd at their
            # edges, more so with every round.
            average = np.mean([m(x) for m, x in zip(poses.moves, smooth, strict=True)], axis=0)
            moved.append(movement(solid, average))
            _log.info("round %d: the template moved by %.3g of its size", number, moved[-1])
            if moved[-1] <= tol or number == max_rounds - 1:
                break
            solid = certified_mean(solid, average, self.volume_weight)[0]
        mean, certificate = certified_mean(solid, poses.mean, self.volume_weight)
        at_rest = moved[-1] <= tol
        if not at_rest:
            _log.warning("the template is not at rest after %d rounds (tol=%g)", len(moved), tol)
        return Population(
            names=tuple(r["name"] for r in records if r["ok"]),
            mean=mean,
            certificate=certificate,
            correspondences=read_only(images),
            aligned=poses.aligned,
            model=shape_model(poses.aligned, poses.mean),
            records=tuple(records),
            moved=tuple(moved),
            converged=at_rest,
            stop_reason="template at rest" if at_rest else "most rounds done",
            doubts=self.doubts,
            folder=self.folder,
            shapes=tuple(self.shapes),
        )

    def _round(
        self, number: int, solid: TetMesh, anchors: Anchors | None
    ) -> tuple[list[Record], Array, Array]:
        """The template mapped onto every shape; records of all, and of those done the images and
        the smooth deformations, (k, n, 3)."""
        digest = _write_template(self.folder / f"template-{number}.npz", solid, anchors)
        jobs = [
            Job(shape, self.folder, number, digest, number >= _COLD_ROUNDS, self.along,
                self.volume_weight)
            for shape in self.shapes
        ]  # fmt: skip
        records: dict[int, Record] = {}
        for i, outcome in self.executor.run(run_job, jobs):
            lost = isinstance(outcome, Exception)
            records[i] = failed(jobs[i], str(outcome)) if lost else outcome
            fault = "" if records[i]["ok"] else records[i]["error"]
            if fault and self.faults.get(i) != fault:  # the same in every round
                _log.warning("%s is skipped: %s", jobs[i].shape.name, fault)
            self.faults[i] = fault
            report(self.progress, f"round {number + 1}", len(records), len(jobs))
        done = [i for i in range(len(jobs)) if records[i]["ok"]]
        if len(done) < 2:
            reason = next((r["error"] for r in records.values() if not r["ok"]), "only one given")
            raise SolverError(f"{len(done)} shapes could be mapped, two are needed; {reason}")
        if number == 0:
            self.doubts = _doubts([records[i] for i in done])
            for name, doubt in self.doubts.items():
                _log.warning("%s: %s", name, doubt)
        images, smooth = np.stack([np.load(jobs[i].image_file) for i in done], axis=1)
        return [records[i] for i in range(len(jobs))], images, smooth


def _doubts(records: list[Record]) -> dict[str, str]:
    """What may be wrong with shapes that could be mapped, by name."""
    lengths = np.cbrt([record["volume"] for record in records])
    found = {}
    for record, times in zip(records, lengths / np.median(lengths), strict=True):
        far = max(times, 1.0 / times)
        doubts = [record["doubt"]] if record["doubt"] else []
        if far > _OTHER_UNIT:
            word = "large" if times > 1.0 else "small"
            doubts.append(f"{far:.4g} times as {word} as the median: is it in another unit?")
        if doubts:
            found[record["name"]] = "; ".join(doubts)
    return found


def _write_template(path: Path, solid: TetMesh, anchors: Anchors | None) -> str:
    """Write the template for the workers; returns the digest of what is in it."""
    arrays: dict[str, NDArray[Any]] = {"V": solid.V, "T": solid.T}
    if anchors is not None:
        arrays |= {"landmark_faces": anchors.faces, "landmark_weights": anchors.weights}
    found = hashlib.sha256()
    for array in arrays.values():
        found.update(np.ascontiguousarray(array).tobytes())
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        save_npz(file, arrays)
    return found.hexdigest()
