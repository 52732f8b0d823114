"""What a population is: names, mean, correspondences, modes, and what was said of each shape."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import as_reals
from ..base.files import atomic_path
from ..base.options import as_path, one_of, real, whole
from ..base.tables import HasSummary, plain_dict, table, versions
from ..certificate.findings import Certificate
from ..errors import FileFormatError, OptionError
from ..io.npz import save_npz
from ..maps.files import LoadedMap, load_map
from ..mesh.meshes import TetMesh
from .measures import ModelMeasures, measure_model
from .outliers import modified_z_scores
from .shape_model import ShapeModel
from .shapes import Shape
from .task import map_file

__all__ = ["Population"]

_UNLIKE = 3.5  # robust standard deviations


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Population(HasSummary):
    """Shapes in correspondence, their mean, and the modes by which they differ.

    Attributes
    ----------
    names : tuple of str
        Of the k shapes that were mapped.
    mean : TetMesh
        The mean shape on the mesh of the template.
    certificate : Certificate
        That mapping the last template to the mean turns no tet over and is one to one.
    correspondences : ndarray, shape (k, n, 3)
        Where every vertex of the template lies on every shape, as that was given.
    aligned : ndarray, shape (k, n, 3)
        The same in one pose (and size).
    model : ShapeModel
    records : tuple of dict
        Of every shape, skipped ones, too: ``name``, ``ok``, ``error``, ``certified``, ``along``,
        ``note``, ``distance``, ``seconds``, ...
    moved : tuple of float
        How far averaging moved the template's surface along its normals in every round, root mean
        square over its size.
    converged : bool
    stop_reason : str
    doubts : dict of str to str
        By name, what may be wrong with shapes that were mapped all the same: that they look
        mirrored, or are in another unit.
    folder : Path or None
        With a map of every shape.
    shapes : tuple of Shape
        As they were given.

    Examples
    --------
    >>> import stretchmap as sm
    >>> bones = sm.samples.vertebra_population(6, seed=2, n_tets=600)
    >>> found = sm.population.fit(bones.solids[:3], max_rounds=1)
    >>> found.names, found.skipped, found.model.n_modes
    (('0', '1', '2'), {}, 2)
    >>> found.reconstruct([0.0]).n_tets == found.mean.n_tets
    True
    """

    names: tuple[str, ...]
    mean: TetMesh
    certificate: Certificate
    correspondences: NDArray[np.float64]
    aligned: NDArray[np.float64]
    model: ShapeModel
    records: tuple[dict[str, Any], ...]
    moved: tuple[float, ...]
    converged: bool
    stop_reason: str
    doubts: dict[str, str] = field(default_factory=dict)
    folder: Path | None = None
    shapes: tuple[Shape, ...] = field(default=(), repr=False)

    def __repr__(self) -> str:
        return f"Population({len(self.names)} shapes, {self.mean.n_tets} tets)"

    @property
    def skipped(self) -> dict[str, str]:
        """Names of the shapes that are left out, and why."""
        return {r["name"]: r["error"] for r in self.records if not r["ok"]}

    @cached_property
    def measures(self) -> ModelMeasures:
        """Compactness, generalization and specificity, see `measure_model`."""
        return measure_model(self.model)

    def reconstruct(self, scores: ArrayLike) -> TetMesh:
        """The solid of some scores, see `ShapeModel.reconstruct`.

        Far from the mean tets may be turned over: ``tet_volumes`` tells.

        Raises
        ------
        ArrayError, NonFiniteError
            No such scores.
        """
        scores = as_reals(scores, "scores", (None,))
        return TetMesh(self.model.reconstruct(scores), self.mean.T)

    def sample(self, n: int = 1, seed: int = 0) -> tuple[TetMesh, ...]:
        """Random solids of the population, see `ShapeModel.sample`.

        Raises
        ------
        OptionError
            A number out of range.
        """
        return tuple(TetMesh(points, self.mean.T) for points in self.model.sample(n, seed))

    def mode(self, number: int, deviations: float) -> TetMesh:
        """The mean moved along a mode, counted from 0, by so many standard deviations.

        Raises
        ------
        OptionError
            There is no such mode.
        """
        if whole("number", number, 0) >= self.model.n_modes:
            raise OptionError(f"there are {self.model.n_modes} modes, counted from 0; no {number}")
        amount = real("deviations", deviations) * np.sqrt(self.model.variances[number])
        return TetMesh(self.mean.V + amount * self.model.modes[number], self.mean.T)

    @cached_property
    def distances(self) -> NDArray[np.float64]:
        """(k,) Root mean square distance of every aligned shape from the mean."""
        gaps = self.aligned - self.model.mean
        return np.asarray(np.sqrt((gaps**2).sum(axis=2).mean(axis=1)))

    def outliers(self, threshold: float = _UNLIKE) -> dict[str, float]:
        """Names of shapes unlike the others, and by how many robust standard deviations.

        Judged by the distance from the mean and, of three shapes or more, by what the model of all
        others leaves unexplained; the larger counts. Both by their logarithms, since distances
        spread by factors: in a sound population, too, one is often twice as far as the next.

        Parameters
        ----------
        threshold : float

        Returns
        -------
        dict of str to float
            The farthest first.

        Raises
        ------
        OptionError
            The threshold is not positive.
        """
        threshold = real("threshold", threshold, above=0.0)
        scores = modified_z_scores(_logarithms(self.distances))
        if len(self.names) > 2:
            unexplained = modified_z_scores(_logarithms(self.measures.generalization[-1]))
            scores = np.maximum(scores, unexplained)
        order = np.argsort(-scores, kind="stable")
        return {self.names[i]: float(scores[i]) for i in order if scores[i] > threshold}

    def map(self, name: str) -> LoadedMap:
        """The map from the last template to a shape, from the run folder.

        Raises
        ------
        OptionError
            There is no such shape, or the run kept no maps.
        """
        one_of("name", name, self.names)
        if self.folder is None:
            raise OptionError("no maps were kept; name a run folder, fit(..., folder='run')")
        return load_map(map_file(self.folder, name, len(self.moved) - 1))

    def to_dict(self) -> dict[str, Any]:
        """Everything scalar, ready for JSON."""
        found: dict[str, Any] = {
            "n_shapes": len(self.names),
            "skipped": self.skipped,
            "doubts": self.doubts,
            "n_vertices": self.mean.n_vertices,
            "n_tets": self.mean.n_tets,
            "all_certified": all(r["certified"] for r in self.records if r["ok"]),
            "by_areas": [r["name"] for r in self.records if r["ok"] and r["note"]],
            "mean_certified": self.certificate.certified,
            "rounds": len(self.moved),
            "moved": self.moved,
            "converged": self.converged,
            "stop_reason": self.stop_reason,
            "standard_deviations": np.sqrt(self.model.variances),
        }
        if len(self.names) > 2:
            m = self.measures
            found |= {
                "compactness": m.compactness,
                "generalization": m.generalization.mean(axis=1),
                "specificity": m.specificity.mean(axis=1),
                "outliers": self.outliers(),
            }
        return plain_dict({**found, "shapes": self.records, "versions": versions()})

    def summary(self) -> str:
        """A table of what was found."""
        found = self.to_dict()
        rows = {
            name: found[name]
            for name in ("n_shapes", "n_vertices", "n_tets", "all_certified", "mean_certified",
                         "rounds", "converged", "stop_reason")
        }  # fmt: skip
        rows["template moved, last"] = self.moved[-1]
        rows["skipped"] = ", ".join(self.skipped) or "none"
        rows["doubtful"] = ", ".join(self.doubts) or "none"
        rows["by areas, not smooth"] = ", ".join(found["by_areas"]) or "none"
        rows["standard deviations"] = found["standard_deviations"][:6]
        for name in ("compactness", "generalization", "specificity"):
            if name in found:
                rows[name] = found[name][:6]
        if "outliers" in found:
            rows["outliers"] = ", ".join(found["outliers"]) or "none"
        return table(rows)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all arrays and figures to an ``.npz``.

        Raises
        ------
        FileFormatError
            Another suffix.
        OSError
            The file cannot be written.
        """
        path = as_path(path)
        if path.suffix.lower() != ".npz":
            raise FileFormatError(f"{path}: a population is saved as .npz")
        arrays: dict[str, NDArray[Any]] = {
            "V": self.mean.V,
            "T": self.mean.T,
            "correspondences": self.correspondences,
            "aligned": self.aligned,
            "modes": self.model.modes,
            "variances": self.model.variances,
            "scores": self.model.scores,
            "meta": np.array(json.dumps(self.to_dict(), allow_nan=False)),
        }
        with atomic_path(path) as temporary, open(temporary, "wb") as file:
            save_npz(file, arrays)


def _logarithms(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of distances, those of nothing as of rounding."""
    least = 1e-12 * float(distances.max(initial=0.0)) or 1.0
    return np.asarray(np.log(np.maximum(distances, least)))
